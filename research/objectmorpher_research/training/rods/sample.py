"""A handle of a made-up vessel as a photo shows it, and its azimuth about the vessel's axis."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB, Mask
from objectmorpher_core.base.masks import largest_piece
from objectmorpher_core.lift.crop import SIDE
from objectmorpher_core.lift.shapes.rods import AROUND, INNER, MARGIN, SMALLEST

from ..shapes.distance import lowest, trace
from ..shapes.sample import (
    COLUMNS,
    LOOSE,
    NO_GROUND,
    _aim,
    _developed,
    _Eye,
    _lamps,
    _materials,
    _picture,
    _rays,
    _Scene,
)
from ..shapes.solid import Solid, turned
from .vessels import make_vessel

DRAWN = 128  # px of a picture's side, that is then enlarged as a small photo is
COARSE = 96  # px of the first look, which finds the handle
AZIMUTHS, PITCHES, ROLL = (-60.0, 62.0), (-5.0, 42.0), 5.0  # degrees; the last a deviation
GROUNDED = 0.4  # how often it stands on something
LEAST = 200  # px of the first look, of the whole vessel
SHIFT = 0.02  # x the crop's side, that it is off
AXIS = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class RodSample:
    """A crop of a photo about a handle and what it ends on."""

    rgb: RGB  # (SIDE, SIDE, 3)
    mask: Mask  # (SIDE, SIDE) the whole vessel
    rod: Mask  # (SIDE, SIDE) what sticks out of its body
    azimuth: float  # radians, above 0 towards the camera
    lean: float  # radians, of the axis's upper end towards the camera


def make_sample(seed: int) -> RodSample:
    """Make the sample of this number."""
    for attempt in range(100):
        found = _try(np.random.default_rng([seed, attempt, 2]))
        if found is not None:
            return found
    raise ValueError(f"no handle can be seen with the seed {seed}")


def _try(rng: np.random.Generator) -> RodSample | None:
    """None where the handle is hardly seen."""
    built = make_vessel(rng)
    solid = built.finish()
    bare = solid._replace(parts=solid.parts[:-1], bounds=solid.bounds[:-1])
    eye = _aim(rng, _any_turn)
    loose = eye._replace(width=2 * LOOSE / np.sqrt(max(eye.at @ eye.at - 1.0, 0.3)))
    mask, body = (_seen(one, loose, COARSE) for one in (solid, bare))
    rod = largest_piece(mask & ~body)
    if mask.sum() < LEAST or rod.sum() < SMALLEST * mask.sum():
        return None
    eye = _framed(rng, rod, body, loose)
    ground = NO_GROUND
    if eye.axes[2, 1] < -0.05 and rng.random() < GROUNDED:
        ground = lowest(solid, COLUMNS)
    rays, _ = _rays(eye, DRAWN)
    lamps, out = _lamps(rng, eye), np.zeros((DRAWN * DRAWN, 16))
    trace(rays, eye.at, solid, lamps, ground, 0, DRAWN * DRAWN, out)
    scene = _Scene(solid, _materials(rng, built), ground)
    picture = _picture(rng, scene, eye, rays, lamps, out, DRAWN)
    picture = cv2.resize(picture, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
    seen = _enlarged((out[:, 0] > 0).reshape(DRAWN, DRAWN))
    rod = seen & ~_enlarged(_seen(bare, eye, DRAWN))
    # On the axis, as high as the ball's middle
    middle = -built.ball[0] / built.ball[1] * [1.0, 0.0, 1.0]
    return RodSample(_developed(rng, np.maximum(picture, 0)), seen, rod, *_angles(eye, middle))


def _any_turn(rng: np.random.Generator) -> F64:
    """(3, 3) for `_aim`."""
    azimuth, pitch = np.radians(rng.uniform(*AZIMUTHS)), np.radians(rng.uniform(*PITCHES))
    return turned(0, pitch, np.radians(rng.normal(0, ROLL))) @ turned(-azimuth).T


def _framed(rng: np.random.Generator, rod: Mask, body: Mask, loose: _Eye) -> _Eye:
    """The crop about a rod (COARSE, COARSE), as `rods` cuts it out of a photo."""
    rows, columns = np.flatnonzero(rod.any(1)), np.flatnonzero(rod.any(0))
    high, wide = np.ptp(rows) + 1, np.ptp(columns) + 1
    side = max(AROUND * high, (wide + INNER * high) / (1 - 2 * MARGIN))
    middle = np.array([columns.mean(), rows.mean()]) + 0.5
    if middle[0] > np.nonzero(body)[1].mean():
        middle[0] = columns[-1] + 1 - (0.5 - MARGIN) * side
    else:
        middle[0] = columns[0] + (0.5 - MARGIN) * side
    middle += rng.normal(0, SHIFT, 2) * side
    offset = (middle / COARSE - 0.5) * loose.width
    return loose._replace(middle=loose.middle + offset, width=float(side / COARSE * loose.width))


def _angles(eye: _Eye, middle: F64) -> tuple[float, float]:
    """Azimuth of +x and lean of the axis through `middle` (3,), object frame; see `Axis`."""
    view = middle - eye.at
    view /= np.linalg.norm(view)
    front = AXIS * (AXIS @ view) - view
    front /= np.linalg.norm(front)
    way = np.array([1.0, 0.0, 0.0])
    azimuth = np.arctan2(way @ front, abs(way @ np.cross(AXIS, front)))
    return float(azimuth), float(np.arcsin(-AXIS @ view))


def _seen(solid: Solid, eye: _Eye, side: int) -> Mask:
    """(side, side) where rays meet it."""
    rays, _ = _rays(eye, side)
    out = np.zeros((side * side, 16))
    trace(rays, eye.at, solid, np.zeros((0, 3)), NO_GROUND, 0, side * side, out)
    return (out[:, 0] > 0).reshape(side, side)


def _enlarged(mask: Mask) -> Mask:
    large = cv2.resize(mask.astype(np.float32), (SIDE, SIDE), interpolation=cv2.INTER_LINEAR)
    return np.asarray(large > 0.5)
