"""The errors of predicted surfaces, beside those of the relief without a network."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.crop import Crop, rays
from objectmorpher_core.lift.relief.body import BACK, FRONT, ReliefBody
from objectmorpher_core.lift.relief.fusion import fused
from objectmorpher_core.lift.relief.shape_look import SeenShape
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette


class Surfaces(NamedTuple):
    """Surfaces in any unit."""

    front: F64  # (s, s) towards the camera
    thickness: F64  # (s, s)


class ShapeError(NamedTuple):
    """Errors over the object's mean true thickness; 0 is perfect."""

    front: float  # mean, after the best scale and shift
    thickness: float  # mean, as it is


def score(found: Surfaces, true: Surfaces, mask: Mask) -> ShapeError:
    """Within `mask` (s, s)."""
    size = max(float(true.thickness[mask].mean()), 1e-3)
    front = aligned(found.front[mask], true.front[mask])
    return ShapeError(
        float(np.abs(front - true.front[mask]).mean() / size),
        float(np.abs(found.thickness[mask] - true.thickness[mask]).mean() / size),
    )


def aligned(found: F64, true: F64) -> F64:
    """`found` (n,) with the scale, not negative, and shift that bring it nearest to `true` (n,)."""
    a, b = found - found.mean(), true - true.mean()
    scale = max(float((a * b).sum() / max((a * a).sum(), 1e-12)), 0.0)
    return scale * a + true.mean()


def relief(mask: Mask, tangents: F32, is_standing: bool = True) -> ReliefBody:
    """Return the relief lifter's surfaces of a mask (s, s) alone, seen by the crop's camera."""
    settings = LiftSettings(is_standing=is_standing)
    return ReliefBody.of(ReliefSilhouette.of(mask), camera_of(tangents, len(mask)), settings)


def learned(mask: Mask, tangents: F32, raw: F32) -> ReliefBody:
    """Return the lifter's surfaces with the network's output, (9, s, s)."""
    side = len(mask)
    seen = SeenShape.of(raw, mask, Crop(0, 0, side, tangents))
    return fused(relief(mask, tangents), seen, camera_of(tangents, side), 1.0, 1.0)


def camera_of(tangents: F32, side: int) -> Camera:
    """Return the camera of a photo that is the crop."""
    focal = side / float(tangents[2])
    centre = [0.5 * side - float(tangents[k]) * focal for k in (0, 1)]
    return Camera(focal, centre[0], centre[1], side, side)


def true_surfaces(front: F32, depth: F32, tangents: F32) -> Surfaces:
    """Return the true surfaces of a sample (s, s), towards the camera's plane, px of the crop."""
    side = len(front)
    forward = side * rays(tangents, side)[..., 2]
    away = Crop(0, 0, side, tangents).away
    return Surfaces(forward * (front - away), forward * depth)


def surfaces_of(body: ReliefBody, mask: Mask) -> Surfaces:
    """At the pixels of a mask (h, w), in its px."""
    rows, columns = np.nonzero(mask)
    xy = np.column_stack([columns, rows]).astype(np.float64) + 0.5
    heights = [body.height(xy, sheet) for sheet in (FRONT, BACK)]
    surfaces = np.zeros((2, *mask.shape))
    surfaces[0][mask], surfaces[1][mask] = heights[0], heights[0] - heights[1]
    return Surfaces(surfaces[0], surfaces[1])
