"""Houses with roofs, towers, and several buildings on one ground."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, ngon, pick, span, vec

BODY, FRONT, KNOB, MORE, GLASS = range(5)


def _roof(rng: Rng, built: PrimitiveBuilder, at: F64, half: F64, kind: str) -> None:
    """On a storey's upper side `at`."""
    high, over = span(rng, 0.5, 1.2) * half[2], span(rng, 0.03, 0.12)
    built.part(FRONT)
    if kind == "gable":
        wide = half[2] + over
        outline = np.array([[-wide, 0], [wide, 0], [0, high]])
        built.prism(at, outline, half[0] + over, 0, turned(np.pi / 2))
    elif kind == "hip":
        for turn, long, wide in ((0.0, half[2], half[0]), (np.pi / 2, half[0], half[2])):
            slope = np.array(
                [
                    [-wide - over, 0],
                    [wide + over, 0],
                    [max(wide - long, 0) + 0.02, high],
                    [-max(wide - long, 0) - 0.02, high],
                ]
            )
            built.prism(at, slope, long + over, 0, turned(turn), keep=turn > 0)
    elif kind == "shed":
        outline = np.array(
            [
                [-half[2] - over, 0],
                [half[2] + over, 0],
                [half[2] + over, 0.15 * high],
                [-half[2] - over, high],
            ]
        )
        built.prism(at, outline, half[0] + over, 0, turned(np.pi / 2))
    elif kind == "dome":
        built.ellipsoid(at, [half[0], high, half[2]])
        built.box(at - [0, high, 0], [3, high, 3], cut=True)
    else:
        built.box(at + [0, 0.04, 0], [half[0] + over, 0.05, half[2] + over])


def _windows(
    rng: Rng, built: PrimitiveBuilder, middle: F64, half: F64, rows: int, columns: int
) -> None:
    """On the front (+z) and one side of a storey."""
    built.part(GLASS)
    tall, wide = 0.3 * half[1] / rows * 1.6, 0.5 * half[0] / columns
    for row in range(rows):
        y = middle[1] + half[1] * (2 * (row + 0.55) / rows - 1)
        for column in range(columns):
            x = middle[0] + half[0] * (2 * (column + 0.5) / columns - 1)
            built.box([x, y, middle[2] + half[2]], [wide, tall, 0.02])
        built.box([middle[0] + half[0], y, middle[2]], [0.02, tall, 0.35 * half[2]])
    if chance(rng, 0.7):
        built.part(KNOB)
        x = middle[0] + span(rng, -0.6, 0.6) * half[0]
        tall = min(0.3, 0.6 * half[1])
        built.box([x, middle[1] - half[1] + tall, middle[2] + half[2]], [0.12, tall, 0.035])


def house(rng: Rng, built: PrimitiveBuilder) -> None:
    """Make a house with a roof of some kind, windows, a chimney, a wing."""
    half = vec(0.8, 0.4, 0.5) * np.exp(rng.normal(0, 0.2, 3))
    middle = vec(0, half[1], 0)
    built.part(BODY)
    built.box(middle, half)
    kind = pick(rng, ("gable", "gable", "hip", "shed", "flat"))
    _windows(rng, built, middle, half, int(rng.integers(1, 3)), int(rng.integers(1, 4)))
    _roof(rng, built, vec(0, 2 * half[1], 0), half, kind)
    if chance(rng, 0.6):  # a chimney
        built.part(KNOB)
        x = span(rng, -0.6, 0.6) * half[0]
        built.box([x, 2 * half[1] + 0.3, 0.3 * half[2]], [0.08, 0.36, 0.08])
    if chance(rng, 0.5):  # a wing
        wing = half * rng.uniform(0.4, 0.8, 3)
        at = vec(span(rng, -0.5, 0.5) * half[0], wing[1], half[2] + 0.6 * wing[2])
        built.part(BODY)
        built.box(at, wing)
        _roof(rng, built, at + [0, wing[1], 0], wing, pick(rng, ("hip", "shed", "gable")))


def tower(rng: Rng, built: PrimitiveBuilder) -> None:
    """Storeys that get narrower; round, square or with many corners."""
    corners, y, wide = pick(rng, (0, 4, 4, 6, 8)), 0.0, span(rng, 0.4, 0.7)
    for k in range(rng.integers(2, 6)):
        high = span(rng, 0.1, 0.7)
        built.part(pick(rng, (BODY, BODY, FRONT)))
        if corners:
            turn = turned(0, np.pi / 2)
            built.prism([0, y + high, 0], ngon(corners, wide, np.pi / 4), high, 0.01, turn)
        else:
            built.cylinder([0, y + high, 0], wide, high, 0.01)
        if k % 2 == 0 and high > 0.25:
            built.part(GLASS)
            for way in range(4):
                at = 0.7 * wide * vec(np.sin(way * np.pi / 2), 0, np.cos(way * np.pi / 2))
                built.box(
                    at + [0, y + 1.1 * high, 0],
                    [0.1, 0.4 * high, 0.32 * wide],
                    0.02,
                    turned(way * np.pi / 2),
                )
        y += 2 * high
        wide *= span(rng, 0.65, 1.15)
    built.part(KNOB)
    if chance(rng, 0.7):
        built.limb([0, y, 0], [0, y + span(rng, 0.3, 1.0), 0], 0.9 * wide, 0.03)
    else:
        built.ellipsoid([0, y, 0], [0.8 * wide, span(rng, 0.2, 0.7), 0.8 * wide])


def buildings(rng: Rng, built: PrimitiveBuilder) -> None:
    """Several blocks on one ground."""
    built.part(MORE)
    built.box([0, 0.03, 0], [1.1, 0.03, 0.8])
    for _ in range(rng.integers(2, 5)):
        half = vec(0.28, 0.5, 0.25) * np.exp(rng.normal(0, 0.2, 3))
        at = vec(span(rng, -0.75, 0.75), 0.04 + half[1], span(rng, -0.45, 0.45))
        built.part(pick(rng, (BODY, FRONT)))
        built.box(at, half)
        _windows(rng, built, at, half, int(rng.integers(1, 4)), 2)
        _roof(
            rng,
            built,
            at + [0, half[1], 0],
            half,
            pick(rng, ("gable", "flat", "flat", "hip", "dome")),
        )
