"""Solids on a ground under a lamp: made photos of which everything is known.

The ten solids of docs/lifting in linear light, with a lamp that has a size and light from all
around; they throw a shadow on a flat ground with a photographed texture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import mesh_view
import numpy as np
from skimage import data
from solids import SOLIDS, Solid, load

from objectmorpher_core.arrays import F64, Mask, Pixels
from objectmorpher_core.camera import Camera
from objectmorpher_core.rotations import turn_matrix
from objectmorpher_research.evaluation.truth.rasterise import rasterised

SIDE = 512  # px
CAMERA = Camera.from_fov(SIDE, SIDE)
SHARE = 0.34  # of the picture's width that a solid fills
AT = np.array([256.0, 250.0])  # px, where its middle is
GAMMA = 2.2
FINE = 640  # px of the shadow on the ground, REACH solids wide
REACH = 5.0
LAMPS = 12  # that stand for one with a size
SIZE = 0.06  # of it, as a tangent
FAR = 14.0  # solids: where the ground fades into a wall
SHARPEST = 1.5  # px of its texture for each px of the photo, from which it is blurred


@dataclass(frozen=True, eq=False)
class Lamp:
    """A light far away, and light from all around."""

    name: str
    direction: tuple[float, float, float]  # towards it, camera axes at rest
    ambient: float  # share of the light that comes from everywhere

    @property
    def unit(self) -> F64:
        return np.array(self.direction) / np.linalg.norm(self.direction)


LIGHTS = (
    Lamp("left", (-0.8, -0.5, -0.45), 0.3),
    Lamp("above", (0.2, -0.85, -0.5), 0.3),
    Lamp("right", (0.7, -0.5, -0.65), 0.5),
)
SUNS = (  # that throw shadows which one sees
    Lamp("beside", (-0.85, -0.6, -0.1), 0.3),
    Lamp("behind", (0.6, -0.65, 0.5), 0.35),
    Lamp("high", (-0.35, -0.9, 0.2), 0.45),
)


@dataclass(frozen=True, eq=False)
class Lit:
    """A solid as `mesh_view` draws it, turned by `turn` (3, 3), in a light that stays."""

    solid: Solid
    lamp: Lamp
    turn: F64

    @property
    def vertices(self) -> F64:
        return self.solid.vertices

    @property
    def faces(self) -> Any:
        return self.solid.faces

    def colors(self, points: F64, face: Any, corners: F64) -> F64:
        """As `Solid.colors`."""
        normals = self.solid.normals(face, corners) @ self.turn.T
        lit = np.clip(normals @ self.lamp.unit, 0, 1)
        light = self.lamp.ambient + (1 - self.lamp.ambient) * lit
        linear = self.solid.albedo(points, face, corners) ** GAMMA * light[:, None]
        return np.clip(linear, 0, 1) ** (1 / GAMMA)


@dataclass(frozen=True, eq=False)
class Stand:
    """A solid where it stands."""

    solid: Solid
    rest: F64  # (V, 3) world
    centre: F64  # (3,)
    up: F64  # (3,) world, unit

    def moved(self, turn: F64) -> F64:
        """Its vertices turned about its middle."""
        return (self.rest - self.centre) @ turn.T + self.centre


def stand(name: str, meshes: Path) -> Stand:
    solid = load(name, meshes)
    rest = solid.vertices + CAMERA.unproject(AT, CAMERA.focal / (SHARE * SIDE))
    up = turn_matrix(*SOLIDS[name][1]) @ np.array([0.0, -1.0, 0.0])
    return Stand(solid, rest, 0.5 * (rest.min(0) + rest.max(0)), up)


def draw(stood: Stand, lamp: Lamp, turn: F64) -> mesh_view.View:
    """The solid alone."""
    return mesh_view.draw(Lit(stood.solid, lamp, turn), stood.moved(turn), CAMERA)  # type: ignore[arg-type]


GROUNDS = ("brick", "gravel", "grass", "wood", "plain")


@cache
def _texture(kind: str) -> F64:
    """(h, w, 3) linear."""
    if kind == "plain":
        return np.full((8, 8, 3), 0.35) * [1.0, 0.92, 0.8]
    if kind == "wood":
        picture = data.coffee()[80:390, 490:598]
    else:
        picture = np.repeat(getattr(data, kind)()[..., None], 3, 2)
    return (picture / 255.0) ** GAMMA * [1.0, 0.93, 0.82]


def _on_ground(stood: Stand) -> tuple[F64, Mask, F64, F64]:
    """Where each pixel sees the ground (h, w, 2), whether it does, and its axes (2, 3), a point."""
    lowest = stood.rest[int((-stood.rest @ stood.up).argmax())]
    right = np.cross(stood.up, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, stood.up)])
    foot = stood.centre + ((lowest - stood.centre) @ stood.up) * stood.up
    x, y = np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5)
    rays = np.stack([(x - CAMERA.cx) / CAMERA.focal, (y - CAMERA.cy) / CAMERA.focal], -1)
    rays = np.concatenate([rays, np.ones((SIDE, SIDE, 1))], -1)
    slope = rays @ stood.up
    reach = (foot @ stood.up) / np.where(slope < -1e-6, slope, -1e-6)
    is_there = (slope < -1e-6) & (reach < FAR)
    places = (rays * np.minimum(reach, FAR)[..., None] - foot) @ axes.T
    return places, is_there, axes, foot


def _shadow(stood: Stand, lamp: Lamp, axes: F64, foot: F64) -> F64:
    """(FINE, FINE) share of the lamp that is hidden, around the foot."""
    rng = np.random.default_rng(0)
    total = np.zeros((FINE, FINE))
    for _ in range(LAMPS):
        way = lamp.unit + rng.normal(0, SIZE, 3)
        height = (stood.rest - foot) @ stood.up
        fallen = stood.rest - way * (height / (way @ stood.up))[:, None] - foot
        at = (fallen @ axes.T / REACH + 0.5) * FINE
        _, _, face, _ = rasterised(at, np.ones(len(at)), stood.solid.faces, FINE, FINE)
        total += face >= 0
    return total / LAMPS


@dataclass(frozen=True, eq=False)
class Made:
    """A made photo, and what it is made of; pixels (h, w, 3) u8."""

    photo: Pixels
    shadowless: Pixels
    empty: Pixels  # neither solid nor shadow
    dark: F64  # (h, w) share of the ground's light that the shadow takes
    view: mesh_view.View  # of the solid

    @property
    def mask(self) -> Mask:
        return self.view.alpha > 0.5


def photo(stood: Stand, lamp: Lamp, kind: str) -> Made:
    """The solid on a ground of GROUNDS."""
    places, is_there, axes, foot = _on_ground(stood)
    texture = _texture(kind)
    height, width = texture.shape[:2]
    at = np.mod(places * 170 + 37, [width - 1, height - 1]).astype(np.float32)
    ground = cv2.remap(texture.astype(np.float32), at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    away = np.clip(np.linalg.norm(places, axis=-1) / FAR * 2.5 - 0.6, 0, 1)[..., None]
    ground = np.where(is_there[..., None], ground, texture.mean((0, 1)))
    ground = ground + away * (texture.mean((0, 1)) - ground)
    facing = float(np.clip(stood.up @ lamp.unit, 0, 1))
    on = ((places / REACH + 0.5) * FINE - 0.5).astype(np.float32)
    dark = cv2.remap(_shadow(stood, lamp, axes, foot), on[..., 0], on[..., 1], cv2.INTER_LINEAR)
    dark = np.where(is_there, dark, 0)
    lit = lamp.ambient + (1 - lamp.ambient) * facing
    shaded = lamp.ambient + (1 - lamp.ambient) * facing * (1 - dark)
    view = draw(stood, lamp, np.eye(3))
    alpha = view.alpha[..., None]
    rng = np.random.default_rng(1)
    noise, pictures = rng.normal(0, 0.006, ground.shape), []
    for light in (shaded, np.full_like(dark, lit)):
        encoded = np.clip(ground * light[..., None], 0, 1) ** (1 / GAMMA)
        for cover in (alpha, 0 * alpha):
            whole = encoded + cover * (view.color - encoded) + noise
            pictures.append(np.rint(np.clip(whole, 0, 1) * 255).astype(np.uint8))
    return Made(pictures[0], pictures[2], pictures[3], 1 - shaded / lit, view)
