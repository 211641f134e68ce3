"""Shelves with things on them, beds, drawers."""

from __future__ import annotations

from ..solid import PrimitiveBuilder, turned
from .legs import legs
from .making import Rng, chance, pick, span, vec

WOOD, SOFT, METAL, MORE = range(4)


def shelf(rng: Rng, built: PrimitiveBuilder) -> None:
    """A case with boards, and things on them."""
    half = vec(span(rng, 0.35, 0.9), span(rng, 0.5, 1.2), span(rng, 0.15, 0.3))
    boards, wall = int(rng.integers(2, 5)), span(rng, 0.02, 0.04)
    built.part(WOOD)
    for sx in (1, -1):
        built.box([sx * half[0], half[1], 0], [wall, half[1], half[2]])
    if chance(rng, 0.7):
        built.box([0, half[1], -half[2]], [half[0], half[1], 0.02])
    for k in range(boards + 1):
        y = 0.06 + (2 * half[1] - 0.09) * k / boards
        built.part(WOOD)
        built.box([0, y, 0], [half[0], wall, half[2]])
        x = -half[0] + 0.1
        while x < half[0] - 0.15 and k < boards and chance(rng, 0.75):
            built.part(MORE + int(rng.integers(4)))
            wide, tall = span(rng, 0.04, 0.12), span(rng, 0.3, 0.85) * (half[1] / boards - wall)
            built.box([x + wide, y + wall + tall, 0], [wide, tall, 0.8 * half[2]], 0.01)
            x += 2 * wide + (0.01 if chance(rng, 0.6) else 0.2)


def bed(rng: Rng, built: PrimitiveBuilder) -> None:
    """A frame with a head and a foot, a mattress, a blanket and pillows."""
    half, high = vec(span(rng, 0.4, 0.8), 1.0), span(rng, 0.2, 0.4)
    built.part(WOOD)
    built.box([0, high, 0], [half[0], 0.08, half[1]], 0.02)
    for sign, tall in ((-1, span(rng, 0.3, 0.8)), (1, span(rng, 0, 0.4))):
        built.part(WOOD)
        built.box(
            [0, high + 0.3 * tall, sign * half[1]], [half[0] + 0.03, 0.5 * tall + 0.08, 0.04], 0.02
        )
    legs(rng, built, half, high)
    built.part(SOFT)
    built.box([0, high + 0.17, 0], [0.97 * half[0], 0.11, 0.96 * half[1]], 0.07)
    built.part(MORE)
    built.superquadric([0, high + 0.24, 0.3], [1.02 * half[0], 0.1, 0.68], 0.5, 0.3)
    for x in (0.0,) if half[0] < 0.55 else (-0.45, 0.45):
        built.part(SOFT)
        built.superquadric(
            [x * half[0], high + 0.34, -0.72], [0.3, 0.1, 0.2], 0.8, 0.5, turned(0, -0.2)
        )


def dresser(rng: Rng, built: PrimitiveBuilder) -> None:
    """Drawers, of which some are open."""
    half, foot = (
        vec(span(rng, 0.5, 0.9), span(rng, 0.35, 0.7), span(rng, 0.25, 0.4)),
        span(rng, 0.05, 0.25),
    )
    built.part(WOOD)
    built.box([0, foot + half[1], 0], half, 0.01)
    rows, columns = int(rng.integers(2, 5)), pick(rng, (1, 1, 2))
    for row in range(rows):
        for column in range(columns):
            built.part(pick(rng, (WOOD, MORE)))
            x = (2 * column + 1 - columns) / columns * half[0]
            y = foot + half[1] * (2 * row + 1) / rows
            out = span(rng, 0.1, 0.3) if chance(rng, 0.15) else 0.01
            size = vec(0.93 * half[0] / columns, 0.88 * half[1] / rows, 0.5 * out + 0.02)
            built.box([x, y, half[2] + 0.5 * out], size, 0.005)
            if out > 0.05:
                built.box(
                    [x, y + 0.1, half[2] + 0.5 * out - 0.03], size - [0.04, 0.03, 0.02], cavity=True
                )
            built.part(METAL)
            built.ellipsoid([x, y, half[2] + out + 0.04], [0.06, 0.03, 0.035])
    legs(rng, built, half[[0, 2]], foot + 0.03, "taper")
