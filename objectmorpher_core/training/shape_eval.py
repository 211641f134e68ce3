"""How far predicted surfaces are from true ones, beside those of the relief without a network."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import F32, F64, Mask
from ..camera import Camera
from ..document import LiftSettings
from ..lift.body import BACK, FRONT, Body
from ..lift.silhouette import Silhouette


class Surfaces(NamedTuple):
    """In crop units (`shapes.sample`)."""

    front: F64  # (s, s) towards the camera
    thickness: F64  # (s, s)


class Score(NamedTuple):
    """Errors over the object's mean true thickness; 0 is perfect."""

    front: float  # mean, after the best scale and shift
    thickness: float  # mean, as it is


def score(found: Surfaces, true: Surfaces, mask: Mask) -> Score:
    """Within `mask` (s, s)."""
    size = max(float(true.thickness[mask].mean()), 1e-3)
    front = aligned(found.front[mask], true.front[mask])
    return Score(
        float(np.abs(front - true.front[mask]).mean() / size),
        float(np.abs(found.thickness[mask] - true.thickness[mask]).mean() / size),
    )


def aligned(found: F64, true: F64) -> F64:
    """`found` (n,) with the scale, not negative, and shift that bring it nearest to `true` (n,)."""
    a, b = found - found.mean(), true - true.mean()
    scale = max(float((a * b).sum() / max((a * a).sum(), 1e-12)), 0.0)
    return scale * a + true.mean()


def relief_surfaces(mask: Mask, tangents: F32, is_standing: bool = True) -> Surfaces:
    """What the relief lifter makes of a mask (s, s) alone, seen by the crop's camera."""
    side = len(mask)
    focal = side / float(tangents[2])
    centre = [0.5 * side - float(tangents[k]) * focal for k in (0, 1)]
    camera = Camera(focal, centre[0], centre[1], side, side)
    body = Body.of(Silhouette.of(mask), camera, LiftSettings(is_standing=is_standing))
    rows, columns = np.nonzero(mask)
    xy = np.column_stack([columns, rows]).astype(np.float64) + 0.5
    heights = [body.sample(xy, sheet)[0] / side for sheet in (FRONT, BACK)]
    surfaces = np.zeros((2, side, side))
    surfaces[0][mask], surfaces[1][mask] = heights[0], heights[0] - heights[1]
    return Surfaces(surfaces[0], surfaces[1])
