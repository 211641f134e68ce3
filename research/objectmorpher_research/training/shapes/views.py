"""A made-up object photographed several times: the camera goes around it, the scene changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F64, RGB, Mask
from objectmorpher_core.base.camera import DEFAULT_FOV

from .distance import lowest, trace
from .families import FAMILIES
from .sample import (
    COLUMNS,
    _backdrop,
    _developed,
    _Eye,
    _lamps,
    _materials,
    _picture,
    _rays,
    _Scene,
)
from .solid import turned

SHARE = 0.62  # x the picture's width, that the ball around the object takes
PITCH = (8.0, 28.0)  # degrees, from which the camera looks down
LEAST = 0.05  # x the picture, that the object covers at least


@dataclass(frozen=True, eq=False)
class TrainingView:
    """A photo by a camera of the usual field of view."""

    rgb: RGB  # (s, s, 3)
    mask: Mask  # (s, s)
    axes: F64  # (3, 3) rows: the camera's x right, y down, z forward in the object's world


def make_views(
    seed: int, yaws: tuple[float, ...], side: int, families: tuple[str, ...] | None = None
) -> tuple[TrainingView, ...]:
    """Photos of one object, the camera at these `yaws` (degrees) around it.

    Lamps and backdrop differ. The same for the same numbers. Raises ValueError where it is hardly
    seen whatever is tried.
    """
    for attempt in range(50):
        rng = np.random.default_rng([seed, attempt, 1])
        found = _try(rng, yaws, side, families or tuple(FAMILIES))
        if all(view.mask.mean() >= LEAST for view in found):
            return found
    raise ValueError(f"no object of {families} can be seen with the seed {seed}")


def _try(
    rng: np.random.Generator, yaws: tuple[float, ...], side: int, families: tuple[str, ...]
) -> tuple[TrainingView, ...]:
    built = FAMILIES[families[rng.integers(len(families))]](rng)
    solid = built.finish()
    scene = _Scene(solid, _materials(rng, built), lowest(solid, COLUMNS))
    first, pitch = rng.normal(0, 0.4), np.radians(rng.uniform(*PITCH))
    look = int(rng.integers(1 << 31))  # of the materials' grain and the lamps' power
    views = []
    for yaw in yaws:
        eye = _eye(first + np.radians(yaw), pitch)
        rays, _ = _rays(eye, side)
        out = np.zeros((side * side, 16))
        lamps = _lamps(rng, eye)
        trace(rays, eye.at, solid, lamps, scene.ground, 0, side * side, out)
        own, backdrop = np.random.default_rng(look), _backdrop(rng, side)
        picture = _picture(own, scene, eye, rays, lamps, out, side, backdrop)
        mask = (out[:, 0] > 0).reshape(side, side)
        views.append(TrainingView(_developed(rng, picture), mask, eye.axes))
    return tuple(views)


def _eye(yaw: float, pitch: float) -> _Eye:
    """A camera that looks at the middle of the object, which lies in a ball of radius 1."""
    width = float(2 * np.tan(np.radians(DEFAULT_FOV) / 2))
    axes = np.diag([1.0, -1.0, -1.0]) @ turned(0, pitch) @ turned(yaw).T
    away = 1 / np.sin(np.arctan(0.5 * SHARE * width))
    return _Eye(-away * axes[2], axes, np.zeros(2), width)
