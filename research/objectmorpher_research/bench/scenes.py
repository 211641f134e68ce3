"""Scenes of `bench render`: a plain cloud, and a lifted object that carries its photo."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from objectmorpher.editor.intents.posing import DRAG
from objectmorpher_core.base.arrays import F64, RGB, Mask, frozen
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import quats_along
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.control_points import COUNT, sample_control_points
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import (
    Handle,
    LiftedObject,
    LiftSettings,
    PhotoTexture,
    Placement,
    Pose,
)
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.texture import TextureLevels, build_levels

from .timing import Timing, ms, seconds

VIEW = 1024  # px, sides of the photo
FRAMES = 24  # of the drag, each another pose
SWAY = 0.25  # x diameter, how far the drag goes
PINS = 4  # control points that stay, the lowest
DEPTH = 1.35  # world units, of the cloud's middle: it is about 800 px wide
FLATNESS = 0.25  # of a Gaussian, thickness over width
MASK_RADII = 0.33, 0.48  # x side: half a megapixel of 1024 x 1024

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class BenchScene:
    """An object in the middle of a drag, and the view of it."""

    name: str
    puppet: Puppet
    texture: TextureLevels
    camera: Camera  # the view's; the photo's is `puppet.camera`
    poses: tuple[Pose, ...]  # of a drag to and fro
    solve_seconds: tuple[float, ...]  # of each of them

    def splats(self, frame: int) -> PosedSplats:
        """The object in a frame of the drag; nothing of it is computed yet."""
        return self.puppet.posed(self.poses[frame % len(self.poses)], Placement())

    def posed_gaussians(self) -> Gaussians:
        """Return the Gaussians of the first frame, for renderers that know no skinning."""
        return self.puppet.posed_gaussians(self.poses[0], Placement())

    def row(self, renderer: str, frame: Timing, sort: Timing | None, **parts: Timing) -> Row:
        """A row of the report; `sort` is None where nothing has to be sorted."""
        return {
            "renderer": renderer,
            "scene": self.name,
            "gaussians": len(self.puppet.lifted.gaussians),
            "width": self.camera.width,
            "height": self.camera.height,
            "sort_ms": ms(sort.median if sort else 0.0),
            "frame_ms": ms(frame.median),
            "frame_least_ms": ms(frame.least),
            "first_frame_ms": ms(frame.first),
            **{name: ms(part.median) for name, part in parts.items()},
            "solve_ms": ms(np.median(self.solve_seconds)),
        }

    def sized(self, size: int) -> BenchScene:
        """Return the same view on size x size px."""
        photo = self.puppet.camera
        return replace(self, camera=photo.windowed(0, 0, size, size, size / photo.width))


def cloud_scene(count: int, view: int = VIEW) -> BenchScene:
    """A closed bumpy surface of `count` plainly coloured Gaussians, standard deviation 1 to 3 px.

    Drawn one by one as 3D Gaussian splatting does; so are objects from a file.
    """
    rng = np.random.default_rng(0)
    camera = Camera.from_fov(view, view)
    points, normals = _bumpy(count, rng)
    px = DEPTH / camera.focal
    across = rng.uniform(1.0, 3.0, (count, 2)) * px * view / VIEW
    scales = np.column_stack([across, FLATNESS * across.min(1)])
    colors = 0.5 + 0.35 * normals + rng.normal(0, 0.05, (count, 3))
    arrays = (points, quats_along(normals), scales, rng.uniform(0.5, 1.0, count), colors.clip(0, 1))
    gaussians = Gaussians(*(frozen(array, np.float32) for array in arrays))
    world_from_object = np.eye(4)
    world_from_object[2, 3] = DEPTH
    seen_at = frozen(camera.project(points + world_from_object[:3, 3]), np.float32)
    none = np.zeros(count, np.float32)
    texture = PhotoTexture(seen_at, none, none + 1)
    lifted = LiftedObject(
        gaussians, texture, sample_control_points(gaussians.means, gaussians.opacities, COUNT),
        world_from_object, 2 * px, "bench", "classic",
    )  # fmt: skip
    grey = np.full((4, 4, 3), 0.5, np.float32)
    levels = build_levels(grey, np.ones((4, 4), np.float32), 0, 0)
    return _dragged("cloud", lifted, levels, camera)


def lift_scene(count: int, view: int = VIEW) -> BenchScene:
    """Half of a photo of view x view px, lifted by the embedded default."""
    camera = Camera.from_fov(view, view)
    mask = made_mask(view)
    matte, lifted = lift_mask(made_photo(view, mask), camera, mask, "relief", LiftSettings(count))
    return _dragged("lift", lifted, object_texture(matte, lifted), camera)


def made_photo(view: int, mask: Mask) -> RGB:
    """A photo (view, view, 3) u8 with texture of every fineness and an object of another hue."""
    rng = np.random.default_rng(0)
    noise = np.zeros((view, view, 3))
    for blur in (0.7, 2.0, 8.0):
        octave = cv2.GaussianBlur(rng.normal(size=noise.shape), (0, 0), blur)
        noise += octave / octave.std()
    ground = np.array([70, 105, 135]) + 14 * noise
    body = np.array([190, 120, 60]) + 14 * noise[::-1]
    soft = cv2.GaussianBlur(mask.astype(np.float64), (0, 0), 1.0)[..., None]
    return np.clip(soft * body + (1 - soft) * ground, 0, 255).astype(np.uint8)


def made_mask(view: int) -> Mask:
    y, x = (np.mgrid[:view, :view] + 0.5) / view - 0.5
    angle, radius = np.arctan2(y, x), np.hypot(x / MASK_RADII[0], y / MASK_RADII[1])
    return radius < 1 + 0.05 * np.cos(5 * angle)


def _bumpy(count: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """Points (count, 3) spread over a bumpy ball of diameter 1, and outward unit normals."""

    def radius(way: F64) -> F64:
        return 0.44 + 0.06 * np.sin(7 * way).prod(1, keepdims=True)

    def height(at: F64) -> F64:
        length = np.linalg.norm(at, axis=1, keepdims=True)
        return length - radius(at / length)

    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    points = radius(way) * way
    slope = np.hstack([height(points + e) - height(points - e) for e in 1e-4 * np.eye(3)])
    return points, slope / np.linalg.norm(slope, axis=1, keepdims=True)


def _dragged(name: str, lifted: LiftedObject, texture: TextureLevels, camera: Camera) -> BenchScene:
    """The object whose uppermost control point is dragged to the right, the lowest pinned."""
    puppet = Puppet(lifted, DeformSettings(), camera)
    points = lifted.control_points.astype(np.float64)
    down = np.argsort(points[:, 1])
    top = points[down[0]]
    pins = [Handle(int(k), points[k], points[k], is_pin=True) for k in down[-PINS:]]
    poses, solves, pose = [], [], puppet.deformer.rest()

    def solve(target: F64) -> None:
        nonlocal pose
        handles = (Handle(int(down[0]), top, target), *pins)
        pose = puppet.deformer.solve(
            handles, start=pose, seconds=DRAG["seconds"], tolerance=DRAG["tolerance"]
        ).pose

    solve(top)  # the handles are new: prepared once
    for frame in range(FRAMES):
        share = np.sin(np.pi * (frame + 1) / FRAMES)
        move = SWAY * lifted.diameter * share * np.array([1.0, 0.0, 0.0])
        solves.append(seconds(lambda move=move: solve(top + move)))
        poses.append(pose)
    return BenchScene(name, puppet, texture, camera, tuple(poses), tuple(solves))
