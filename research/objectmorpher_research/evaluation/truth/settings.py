"""The setting of a solid in a made photo: its side, material, lamp, background and camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F64, I32, RGB, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import turn_matrix

from .materials import GAMMA, SolidMaterial, background
from .motions import PlacedSolid, TruthEdit, moved
from .rasterise import SAMPLES, Hits, interpolated, pixel_means, rasterise
from .solids import TruthSolid, make

WIDTH, HEIGHT = 480, 400  # px
FIELDS = (38.0, 50.0, 62.0)  # degrees of view, given to every method as EXIF gives it
GLOSS = 24.0  # exponent of the highlight
VISIBLE = 0.012  # solids, between a point and the nearest surface: it is seen


@dataclass(frozen=True)
class Lamp:
    """A light far away, and light from all around; neither turns with the thing."""

    direction: tuple[float, float, float]  # towards it, camera axes
    ambient: float  # share of the light that comes from everywhere

    def lit(self, albedo: F64, normals: F64, view: F64, shine: float) -> F64:
        """sRGB (n, 3) in [0, 1] of linear `albedo`; `view` (n, 3) is the unit way to the camera."""
        unit = np.array(self.direction) / np.linalg.norm(self.direction)
        facing = np.clip(normals @ unit, 0, 1)
        light = self.ambient + (1 - self.ambient) * facing
        half = unit + view
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        gleam = shine * np.clip((normals * half).sum(1), 0, 1) ** GLOSS * (facing > 0)
        return np.clip(albedo * light[:, None] + gleam[:, None], 0, 1) ** (1 / GAMMA)


@dataclass(frozen=True)
class Setting:
    """A made photo of a solid."""

    solid: str
    material: SolidMaterial
    side: tuple[float, float, float]  # degrees: yaw, pitch, roll at which it is photographed
    place: str  # the photo behind it
    lamp: Lamp
    fov: float
    share: float  # of the picture's height that the solid's largest extent fills
    at: tuple[float, float]  # px, its middle

    @property
    def camera(self) -> Camera:
        return Camera.from_fov(WIDTH, HEIGHT, self.fov)


@dataclass(frozen=True, eq=False)
class SolidView:
    """A solid as the camera sees it; colours are straight sRGB."""

    color: F64  # (H, W, 3) in [0, 1]
    alpha: F64  # (H, W)
    hits: Hits

    def over(self, plate: RGB) -> RGB:
        """(H, W, 3)"""
        alpha = self.alpha[..., None]
        whole = alpha * self.color * 255 + (1 - alpha) * plate
        return np.asarray(np.clip(whole + 0.5, 0, 255), np.uint8)


class TruthStage:
    """A setting built up: photographs the solid at rest and after edits."""

    def __init__(self, setting: Setting) -> None:
        self.setting, self.camera = setting, setting.camera
        self.solid: TruthSolid = make(setting.solid)
        self.plate = background(setting.place, WIDTH, HEIGHT)
        turn = turn_matrix(*setting.side)
        depth = self.camera.focal / (setting.share * HEIGHT)
        self._turn, self._centre = turn, self.camera.unproject(np.array(setting.at), depth)
        self._normals = self.solid.normals(self.solid.vertices)  # at rest, its own frame

    def body(self, limb: str = "") -> PlacedSolid:
        """Return the placed body."""

        def placed(points: F64) -> F64:
            return points @ self._turn.T + self._centre

        found = self.solid.limbs[limb] if limb else None
        told = (found.parts, placed(found.pivot), placed(found.tip)) if found else None
        return PlacedSolid(placed(self.solid.vertices), self.solid.parts, told)

    def moved(self, motion: TruthEdit) -> F64:
        """(V, 3) world"""
        return moved(motion, self.body(motion.limb))

    def draw(self, world: F64) -> SolidView:
        """The solid with its vertices at (V, 3)."""
        solid, setting = self.solid, self.setting
        hits = rasterise(self.camera.project(world), world[:, 2], solid.faces, (WIDTH, HEIGHT))
        colors = np.zeros((*hits.face.shape, 3))
        rows = np.concatenate([solid.vertices, self._normals, world, solid.normals(world)], axis=1)
        own, rest_normals, at, normals = np.split(interpolated(rows, solid.faces, hits), 4, axis=1)
        albedo = setting.material.albedo(own, _unit(rest_normals))
        hit = hits.face >= 0
        colors[hit] = setting.lamp.lit(albedo, _unit(normals), _unit(-at), setting.material.shine)
        alpha = hits.coverage
        color = pixel_means(colors) / np.maximum(alpha, 1e-9)[..., None]
        return SolidView(color, alpha, hits)

    def surface_points(self, xy: F64, rest: SolidView) -> tuple[I32, F64]:
        """Corners (n, 3) of the faces seen at whole px (n, 2), and their weights there (n, 3)."""
        middle = rest.hits.middles()
        column, row = xy.astype(int).T
        return self.solid.faces[middle.face[row, column]], middle.corners[row, column]

    def is_seen(self, points: F64, view: SolidView) -> Mask:
        """(n,) whether world points (n, 3) on the surface are seen in a view."""
        px = self.camera.project(points)
        column, row = np.floor(px).astype(int).T
        is_in = (column >= 0) & (column < WIDTH) & (row >= 0) & (row < HEIGHT)
        depth = view.hits.nearest[SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES]
        near = depth[np.clip(row, 0, HEIGHT - 1), np.clip(column, 0, WIDTH - 1)]
        return is_in & (np.abs(points[:, 2] - near) < VISIBLE)


def _unit(vectors: F64) -> F64:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
