"""Round things with a flat thing's picture on them: plush, balls, cushions, mugs, clocks, bowls."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, pick, span
from .prints import a_drawing

FACING = turned(0, np.pi / 2)  # what stands on its y axis lies before the camera
OUTER, INNER = 1.0, 0.9  # radii of a bowl's rim


def padded(rng: Rng) -> PrimitiveBuilder:
    """Make a round thing whose front is painted as if it were flat."""
    drawn = a_drawing(rng)
    lean = pick(rng, (0.0, 0.0, -span(rng, 0, 0.6), -np.pi / 2))
    turn = turned(rng.normal(0, 0.2), lean) @ turned(0, 0, rng.normal(0, 0.3))
    built = PrimitiveBuilder()
    built.part(0)
    kind = pick(rng, (_plush, _plush, _ball, _cushion, _mug, _clock, _bowl))
    kind(rng, built, turn, drawn.outline)
    built.prints[0] = (drawn.picture, turn)
    return built


def _plush(rng: Rng, built: PrimitiveBuilder, turn: F64, outline: F64) -> None:
    """Of that outline: a plush toy, a balloon, a biscuit."""
    half = span(rng, 0.22, 0.5)
    built.prism([0, 0, 0], outline, half, span(rng, 0.6, 0.98) * half, turn)


def _ball(rng: Rng, built: PrimitiveBuilder, turn: F64, _: F64) -> None:
    built.ellipsoid([0, 0, 0], [1.0, span(rng, 0.7, 1.0), span(rng, 0.45, 1.0)], turn)


def _cushion(rng: Rng, built: PrimitiveBuilder, turn: F64, _: F64) -> None:
    half = [span(rng, 0.7, 1.0), span(rng, 0.7, 1.0), span(rng, 0.25, 0.5)]
    built.superquadric([0, 0, 0], half, span(rng, 0.2, 0.7), 1.0, turn)


def _mug(rng: Rng, built: PrimitiveBuilder, turn: F64, _: F64) -> None:
    """Upright, its picture before the camera; now and then a tin, without a handle."""
    wide, high = span(rng, 0.5, 0.8), span(rng, 0.6, 0.95)
    built.cylinder([0, 0, 0], wide, high, span(rng, 0.01, 0.1), turn)
    if chance(rng, 0.7):
        size, side = span(rng, 0.3, 0.5), pick(rng, (1, -1))
        out = turn @ np.array([side * wide, 0.0, 0.0])
        built.ring(out, size, span(rng, 0.06, 0.1), np.pi, turn @ FACING)


def _clock(rng: Rng, built: PrimitiveBuilder, turn: F64, _: F64) -> None:
    """A thick disc with a rim: a clock, a jar's lid, a speaker."""
    half = span(rng, 0.2, 0.4)
    built.cylinder([0, 0, 0], 0.95, half, span(rng, 0.02, 0.9) * half, turn @ FACING)
    if chance(rng, 0.7):
        front = turn @ np.array([0.0, 0.0, half])
        built.ring(front, 0.9, span(rng, 0.05, 0.12), np.pi, turn @ FACING)


def _bowl(rng: Rng, built: PrimitiveBuilder, turn: F64, _: F64) -> None:
    """Seen into."""
    deep, foot, rise = span(rng, 0.35, 0.8), span(rng, 0.2, 0.5), np.linspace(0, 1, 9)
    bulge = np.sin(0.5 * np.pi * rise) ** span(rng, 0.5, 1.0)
    wide = foot + (OUTER - foot) * bulge
    outside = np.stack([wide, deep * rise], 1)
    inside = np.stack([INNER * wide, 0.1 * deep + (deep - 0.1 * deep) * rise], 1)
    ends = np.array([[0.0, 0.0]]), np.array([[0.0, 0.1 * deep]])
    built.lathe([0, 0, 0], np.concatenate([ends[0], outside, inside[::-1], ends[1]]), turn @ FACING)
