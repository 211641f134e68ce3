"""Letters and digits of straight strokes, and words of them."""

from __future__ import annotations

import itertools

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, depth, pick, rounded, span, vec

BODY, MORE, THIRD = range(3)

# Strokes of letters and digits on a grid of 0..2 by 0..4; a new stroke after each space
STROKES = {
    "A": "00,14,20 0.4 1.6,1.6 1.6",
    "E": "20,00,04,24 02,1.6 2",
    "F": "00,04,24 02,1.6 2",
    "H": "00,04 20,24 02,22",
    "I": "10,14 00,20 04,24",
    "K": "00,04 24,02,20",
    "L": "04,00,20",
    "M": "00,04,12,24,20",
    "N": "00,04,20,24",
    "T": "10,14 04,24",
    "V": "04,10,24",
    "W": "04,00,12,20,24",
    "X": "00,24 04,20",
    "Y": "10,12,04 12,24",
    "Z": "04,24,00,20",
    "1": "03,14,10 00,20",
    "4": "10,14,01,21",
    "7": "04,24,10",
    "2": "03,04,24,22,00,20",
    "5": "24,04,02,22,20,00",
    "3": "04,24,20,00 02,22",
    "6": "24,04,00,20,22,02",
    "8": "00,20,24,04,00 02,22",
    "U": "04,00,20,24",
}


def strokes(name: str) -> list[F64]:
    """Lines (k, 2) of a letter."""
    lines = []
    numbers = STROKES[name].replace("0.4 1.6,1.6 1.6", "a,b").replace("1.6 2", "c").split()
    special = {"a": (0.4, 1.5), "b": (1.6, 1.5), "c": (1.6, 2.0)}
    for line in numbers:
        points = [special.get(p) or (float(p[0]), float(p[1])) for p in line.split(",")]
        lines.append(np.array(points) * 0.5 - [0.5, 1.0])
    return lines


def draw(
    built: PrimitiveBuilder,
    lines: list[F64],
    shift: F64,
    thick: float,
    half: float,
    turn: F64,
    is_round: bool,
) -> None:
    """Lines (k, 2) as bars or, where they are round, as rods."""
    for line in lines:
        for a, b in itertools.pairwise(line):
            middle, way = 0.5 * (a + b) + shift, b - a
            long = 0.5 * float(np.linalg.norm(way))
            if is_round:
                built.limb(turn @ vec(*(a + shift), 0), turn @ vec(*(b + shift), 0), thick, thick)
            else:
                spin = turn @ turned(0, 0, float(np.arctan2(way[1], way[0])))
                built.box(
                    turn @ vec(*middle, 0), [long + 0.7 * thick, thick, half], 0.1 * thick, spin
                )


def letter(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Make a letter or digit with straight, bevelled or round strokes; or O, C, D, P."""
    half, bevel = depth(rng)
    built.part(BODY)
    if chance(rng, 0.3):
        kind = pick(rng, ("O", "C", "D", "P"))
        wide, thick = span(rng, 0.5, 0.8), span(rng, 0.15, 0.25)
        outer = rounded(wide, 1.0, 0.9 * wide, 6)
        if kind in ("D", "P"):
            outer = np.concatenate([[[-wide, -1.0]], outer[outer[:, 0] > 0], [[-wide, 1.0]]])
            outer = outer[np.argsort(np.arctan2(outer[:, 1], outer[:, 0]))]
        inner = outer * [(wide - thick) / wide, 1 - thick]
        up, scale = (vec(0, 0.45, 0), vec(1, 0.55)) if kind == "P" else (vec(0, 0, 0), vec(1, 1))
        built.prism(turn @ up, outer * scale, half, bevel, turn)
        built.prism(turn @ up, inner * scale, 3 * half, 0, turn, cut=True)
        if kind == "C":
            built.box(turn @ vec(wide, 0, 0), [0.7 * wide, 0.4, 3 * half], 0, turn, cut=True)
        if kind == "P":
            built.box(
                turn @ vec(-wide + 0.5 * thick, -0.5, 0), [0.5 * thick, 0.5, half], bevel, turn
            )
        return
    thick = span(rng, 0.1, 0.2)
    draw(built, strokes(pick(rng, tuple(STROKES))), vec(0, 0), thick, half, turn, chance(rng, 0.3))


def word(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Two to four letters side by side, on a board or alone."""
    count, half, thick = int(rng.integers(2, 5)), span(rng, 0.08, 0.25), span(rng, 0.1, 0.17)
    is_round = chance(rng, 0.25)
    for k in range(count):
        built.part(pick(rng, (BODY, BODY, MORE)))
        lines = strokes(pick(rng, tuple(STROKES)))
        draw(built, lines, vec(1.45 * (k - 0.5 * (count - 1)), 0), thick, half, turn, is_round)
    if chance(rng, 0.4):
        built.part(THIRD)
        built.box(turn @ vec(0, 0, -half), [0.75 * count, 1.3, 0.08], 0.03, turn)
