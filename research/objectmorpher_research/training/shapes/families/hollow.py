"""Common parts of vessels: hollow bodies, ears, saucers."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder
from .making import Rng, chance, curve, profile, span, tube, vec


def hollow(built: PrimitiveBuilder, outside: F64, wall: float, floor: float) -> None:
    """A body turned from `outside` (k, 2), below to top, hollow and open above."""
    built.lathe([0, 0, 0], profile(outside, 3))
    inside = np.array([p for p in outside if p[1] > outside[0, 1] + floor])
    inside = inside - [wall, 0]
    first = vec(inside[0, 0], outside[0, 1] + floor)
    inside = np.concatenate([first[None], inside, inside[-1:] + [0, 0.5]])
    inside[:, 0] = np.maximum(inside[:, 0], 0.3 * outside[:, 0].min())
    built.lathe([0, 0, 0], profile(inside, 3), cavity=True)


def handle(
    rng: Rng, built: PrimitiveBuilder, x: float, low: float, high: float, out: float, thick: float
) -> None:
    """An ear at the side +x, between two heights."""
    knots = [
        [x - thick, low, 0],
        [x + 0.7 * out, low - 0.02, 0],
        [x + out, 0.45 * low + 0.55 * high, 0],
        [x + 0.75 * out, high, 0],
        [x - thick, high, 0],
    ]
    if chance(rng, 0.3):  # an ear with corners
        knots = [[x - thick, low, 0], [x + out, low, 0], [x + out, high, 0], [x - thick, high, 0]]
        tube(built, np.array(knots), thick, thick)
        return
    tube(built, curve(knots, 9), thick, thick * span(rng, 0.8, 1.2))


def saucer(rng: Rng, built: PrimitiveBuilder, wide: float) -> None:
    """A dish that rises to its rim."""
    rim = span(rng, 0.08, 0.25)
    outline = [
        [0.4 * wide, -0.06],
        [0.4 * wide, -0.06],
        [wide, rim],
        [wide, rim + 0.05],
        [0.45 * wide, 0.02],
        [0.4 * wide, 0.02],
    ]
    built.lathe([0, 0, 0], profile(outline, 1))
