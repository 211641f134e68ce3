"""Pots, teapots, plates with food, cakes."""

from __future__ import annotations

import numpy as np

from ..solid import PrimitiveBuilder, turned
from .hollow import handle, hollow, saucer
from .making import Rng, chance, curve, pick, profile, span, tube, vec

BODY, LID, INSIDE, MORE = range(4)


def pot(rng: Rng, built: PrimitiveBuilder) -> None:
    """Pots and pans with lids, ears or a long handle."""
    wide, high = span(rng, 0.5, 0.8), span(rng, 0.2, 0.8)
    built.part(BODY)
    outside = np.array(
        [[0.92 * wide, 0], [0.92 * wide, 0], [wide, 0.12], [wide, high], [wide, high]]
    )
    hollow(built, outside, 0.05, 0.06)
    if chance(rng, 0.5):
        for sign in (1, -1):
            built.part(MORE)
            turn = turned(sign * np.pi / 2)
            built.ring([sign * wide, 0.8 * high, 0], 0.17, 0.045, 1.7, turn)
    else:
        built.part(MORE)
        built.limb([wide, 0.85 * high, 0], [wide + span(rng, 0.6, 1.2), high, 0], 0.06, 0.08)
    if chance(rng, 0.6):
        tall = span(rng, 0.05, 0.3)
        built.part(LID)
        outline = [
            [1.03 * wide, high],
            [1.03 * wide, high + 0.05],
            [0.6 * wide, high + 0.8 * tall + 0.05],
            [0.05, high + tall + 0.06],
        ]
        built.lathe([0, 0, 0], profile(outline, 1))
        built.part(MORE)
        built.ellipsoid([0, high + tall + 0.13, 0], [0.11, 0.09, 0.11])


def teapot(rng: Rng, built: PrimitiveBuilder) -> None:
    """Teapots, kettles, watering cans: a spout on -x and a handle on +x."""
    wide, high = span(rng, 0.5, 0.75), span(rng, 0.6, 1.2)
    foot, top = span(rng, 0.3, 0.5), span(rng, 0.2, 0.35)
    outline = [[foot, 0], [foot, 0], [wide, 0.35 * high], [0.9 * wide, 0.75 * high], [top, high]]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, 3))
    reach = span(rng, 0.35, 0.7)
    knots = [
        [-0.7 * wide, 0.3 * high, 0],
        [-wide - 0.5 * reach, 0.45 * high, 0],
        [-wide - reach, span(rng, 0.85, 1.15) * high, 0],
    ]
    tube(built, curve(knots, 6), 0.16, 0.08, soft=0.06)
    built.part(pick(rng, (BODY, MORE)))
    if chance(rng, 0.75):
        handle(rng, built, 0.75 * wide, 0.25 * high, 0.8 * high, span(rng, 0.35, 0.6), 0.06)
    else:  # above, like a kettle's
        built.ring([0, 0.85 * high, 0], 0.85 * wide, 0.05, 1.5, turned(0, -np.pi / 2))
    built.part(LID)
    built.lathe([0, high - 0.04, 0], profile([[1.15 * top, 0], [1.1 * top, 0.06], [0.06, 0.16]], 1))
    built.ellipsoid([0, high + 0.17, 0], [0.07, 0.08, 0.07], soft=0.03)


def plate(rng: Rng, built: PrimitiveBuilder) -> None:
    """A plate, often with food on it."""
    wide = span(rng, 0.8, 1.2)
    built.part(BODY)
    saucer(rng, built, wide)
    for k in range(rng.integers(0, 5)):
        built.part(INSIDE + k % 2)
        at = 0.3 * wide * vec(np.cos(1.7 * k), 0, np.sin(1.7 * k)) * span(rng, 0.5, 1.2)
        half = vec(span(rng, 0.12, 0.4), span(rng, 0.08, 0.25), span(rng, 0.12, 0.3))
        built.superquadric(
            at + [0, half[1], 0],
            half,
            span(rng, 0.4, 1),
            span(rng, 0.4, 1),
            turned(span(rng, 0, 3)),
        )


def cheese(rng: Rng, built: PrimitiveBuilder) -> None:
    """A wheel of cheese, a cake or a pie; often a slice is gone."""
    wide, high = span(rng, 0.6, 1.0), span(rng, 0.12, 0.4)
    built.part(BODY)
    built.cylinder([0, high, 0], wide, high, span(rng, 0.02, 0.12))
    if chance(rng, 0.6):
        half = span(rng, 0.2, 0.6)
        wedge = 3 * np.array([[0, 0], [np.cos(half), -np.sin(half)], [np.cos(half), np.sin(half)]])
        built.prism([0.02, high, 0], wedge, 2 * high, 0, turned(0, np.pi / 2), cut=True)
    if chance(rng, 0.5):
        for k in range(rng.integers(1, 8)):
            built.part(MORE)
            way = 2.4 * k + 1.2
            far = wide * span(rng, 0.3, 0.75)
            built.ellipsoid(
                [-far * abs(np.cos(way)), 2 * high, far * np.sin(way)],
                np.full(3, span(rng, 0.06, 0.12)),
            )
