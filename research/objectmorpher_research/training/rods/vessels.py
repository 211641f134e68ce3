"""Cups, jugs, cans and vases whose handle is on +x, the last of their parts."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..shapes.families.hollow import handle, hollow, saucer
from ..shapes.families.making import Rng, chance, pick, profile, span, tube
from ..shapes.solid import PrimitiveBuilder, turned

BODY, INSIDE, DISH, MORE = range(4)
SHORTEST = 0.35  # x the body's height, from end to end of a handle


def make_vessel(rng: Rng) -> PrimitiveBuilder:
    """Make a vessel that stands on y = 0 about the y axis, with one handle."""
    built, high = PrimitiveBuilder(), span(rng, 0.5, 1.6)
    outline = pick(rng, (_cup, _cup, _jug, _can, _beaker))(rng, high)
    built.part(BODY)
    if chance(rng, 0.7):
        hollow(built, outline, span(rng, 0.04, 0.1), 0.1)
    else:
        built.lathe([0, 0, 0], profile(outline, 3))
    if chance(rng, 0.25):  # what is in it
        built.part(INSIDE)
        half = 0.5 * span(rng, 0.6, 0.9) * high
        built.cylinder([0, half + 0.03, 0], 0.9 * outline[:, 0].min() - 0.02, half - 0.04)
    if chance(rng, 0.15):
        built.part(DISH)
        saucer(rng, built, 1.5 * outline[0, 0] + 0.25)
    built.part(MORE if chance(rng, 0.3) else BODY)
    _add_handle(rng, built, outline)
    return built


def _add_handle(rng: Rng, built: PrimitiveBuilder, outline: F64) -> None:
    """An ear, a ring, or one whose lower end hangs down."""
    high = float(outline[-1, 1])
    low, top = np.sort(rng.uniform(0.05, 1.0, 2))
    if top - low < SHORTEST:
        middle = 0.5 * (low + top)
        low, top = max(0.05, middle - 0.2), min(1.0, middle + 0.2)
    low, top = float(low) * high, float(top) * high
    middle = 0.5 * (low + top)
    at_low, at_middle, at_top = (
        float(np.interp(y, outline[:, 1], outline[:, 0])) for y in (low, middle, top)
    )
    x = min(at_low, at_middle, at_top)
    out, thick = span(rng, 0.25, 0.7) * (top - low) + at_middle - x, span(rng, 0.04, 0.11)
    if chance(rng, 0.65):
        handle(rng, built, x, low, top, out, thick)
    elif chance(rng, 0.7):
        built.ring([at_middle, middle, 0], 0.5 * (top - low), thick, turn=turned(0, np.pi / 2))
    else:
        drop = span(rng, -0.2, 0.2)
        knots = [[x - 0.1, low, 0], [x + 0.6 * out, low - drop, 0], [x + out, middle, 0]]
        tube(built, np.array([*knots, [at_top - 0.05, top, 0]]), thick, thick)


def _cup(rng: Rng, high: float) -> F64:
    low, top = span(rng, 0.3, 0.75), span(rng, 0.35, 0.9)
    belly = span(rng, 0.9, 1.25) * 0.5 * (low + top)
    return np.array([[low, 0], [low, 0], [belly, 0.5 * high], [top, high], [top, high]])


def _jug(rng: Rng, high: float) -> F64:
    low, wide, neck = span(rng, 0.2, 0.5), span(rng, 0.4, 0.75), span(rng, 0.2, 0.5)
    belly = [[wide, 0.4 * high], [0.8 * wide, 0.7 * high]]
    return np.array([[low, 0], [low, 0], *belly, [neck, high], [neck, high]])


def _can(rng: Rng, high: float) -> F64:
    wide = span(rng, 0.35, 0.8)
    return np.array([[wide, 0], [wide, 0], [wide, high], [wide, high]])


def _beaker(rng: Rng, high: float) -> F64:
    low, top = span(rng, 0.2, 0.45), span(rng, 0.5, 0.9)
    belly = [[0.7 * top, 0.15 * high], [0.95 * top, 0.6 * high]]
    return np.array([[low, 0], [low, 0], *belly, [top, high], [top, high]])
