"""Signs, blobs, biscuits, combs, steps and arches."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .letters import STROKES, draw, strokes
from .making import Rng, chance, depth, ngon, pick, smooth, span, vec

BODY, MORE, THIRD = range(3)


def sign(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A road sign on its post, with something raised on it."""
    post = turned(float(np.arctan2(turn[0, 2], turn[2, 2])))
    corners = pick(rng, (3, 4, 6, 8, 24))
    outline = ngon(corners, 0.6, np.pi / 2 if corners != 8 else np.pi / 8)
    high = span(rng, 1.0, 1.8)
    built.part(MORE)
    built.limb([0, 0, -0.05], [0, high, -0.05], 0.05, 0.05)
    if chance(rng, 0.4):
        built.cylinder([0, 0, -0.05], 0.3, 0.05, 0.02)
    built.part(BODY)
    built.prism([0, high + 0.2, 0], smooth(outline, 1), 0.04, 0.02, post)
    built.part(THIRD)
    if chance(rng, 0.5):
        built.prism(vec(0, high + 0.2, 0), 0.78 * outline, 0.06, 0.01, post)
    else:
        lines = [0.3 * line for line in strokes(pick(rng, tuple(STROKES)))]
        draw(built, lines, vec(0, high + 0.2), 0.05, 0.07, post, False)


def blob(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A random outline: a puddle, a stone cut flat, a cloud, a state on a map; with holes."""
    half, bevel = depth(rng)
    count = int(rng.integers(5, 12))
    outline = ngon(count) * rng.uniform(0.4, 1.1, (count, 1))
    built.part(BODY)
    built.prism([0, 0, 0], smooth(outline, pick(rng, (0, 2, 2))), half, 0.5 * bevel, turn)
    axle = turn @ turned(0, np.pi / 2)
    for _ in range(rng.integers(0, 3)):
        built.cylinder(
            turn @ vec(*rng.normal(0, 0.25, 2), 0), span(rng, 0.08, 0.2), 2.0, 0, axle, cut=True
        )
    for k in range(rng.integers(0, 3)):
        built.part(MORE + k)
        other = ngon(count) * rng.uniform(0.15, 0.4, (count, 1)) + rng.normal(0, 0.2, 2)
        built.prism(turn @ vec(0, 0, half), smooth(other, 2), span(rng, 0.04, 0.2), 0.02, turn)


def cookie(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A gingerbread man, a tree, a moon, a fish: flat, with swollen edges."""
    half = span(rng, 0.08, 0.2)
    built.part(BODY)
    kind = pick(rng, ("man", "moon", "tree", "fish"))
    if kind == "man":
        _gingerbread(built, half, turn)
    elif kind == "moon":
        axle = turn @ turned(0, np.pi / 2)
        built.cylinder([0, 0, 0], 1.0, half, 0.6 * half, axle)
        built.cylinder(turn @ vec(span(rng, 0.35, 0.6), 0.1, 0), 0.85, 1.0, 0, axle, cut=True)
    elif kind == "tree":
        x = np.array([0.12, 0.12, 0.8, 0.3, 0.6, 0.2, 0.4, 0.0])
        y = np.array([-1, -0.7, -0.7, -0.1, -0.1, 0.4, 0.4, 1])
        outline = np.concatenate([np.stack([x, y], 1), np.stack([-x, y], 1)[-2::-1]])
        built.prism([0, 0, 0], smooth(outline, 1), half, 0.5 * half, turn)
    else:
        x = np.array([1, 0.5, 0, -0.5, -1])
        y = np.array([0, 0.45, 0.45, 0.1, 0.5])
        outline = np.concatenate([np.stack([x, y], 1), np.stack([x, -y], 1)[:0:-1]])
        built.prism([0, 0, 0], smooth(outline, 2), half, 0.5 * half, turn)
        built.part(MORE)
        built.ellipsoid(turn @ vec(0.6, 0.12, half), np.full(3, 0.09))


def _gingerbread(built: PrimitiveBuilder, half: float, turn: F64) -> None:
    """A man of round limbs, cut flat, with eyes and buttons."""
    ends = ((0, 0, 0, 0.3), (0, 0.2, 0.6, 0.35), (0, 0.2, -0.6, 0.35))
    for a, b, c, d in (*ends, (0, -0.1, 0.35, -0.8), (0, -0.1, -0.35, -0.8)):
        built.limb(turn @ vec(a, b, 0), turn @ vec(c, d, 0), 0.26, 0.2, soft=0.1)
    built.ellipsoid(turn @ vec(0, 0.75, 0), [0.33, 0.33, 0.3], turn)
    built.box([0, 0, 0], [2, 2, half], 0, turn, keep=True, soft=0.08)
    for x, y in ((0.12, 0.8), (-0.12, 0.8), (0, 0.3), (0, 0.1), (0, -0.1)):
        built.part(MORE)
        built.ellipsoid(turn @ vec(x, y, half), np.full(3, 0.06))


def comb(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A comb, a rake, a fence, a xylophone: many bars side by side."""
    count, half = int(rng.integers(5, 12)), span(rng, 0.03, 0.1)
    high, slope = span(rng, 0.5, 1.2), span(rng, -0.4, 0.4)
    built.part(BODY)
    built.box(turn @ vec(0, 0.1, 0), [1.05, 0.1, half], 0.4 * half, turn)
    if chance(rng, 0.5):
        built.box(turn @ vec(0, -0.55 * high, 0), [1.05, 0.07, 0.8 * half], 0.01, turn)
    for k in range(count):
        x = 2 * (k + 0.5) / count - 1
        long = 0.5 * high * (1 + slope * x)
        built.part(pick(rng, (BODY, MORE)))
        built.box(turn @ vec(x, -long + 0.1, 0.3 * half), [0.6 / count, long, half], 0.01, turn)


def stairs(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Steps, a zigzag, a wall with battlements, an arch, a bridge."""
    half = span(rng, 0.2, 0.7)
    turn = turned(float(np.arctan2(turn[0, 2], turn[2, 2])))
    kind = pick(rng, ("steps", "wall", "arch", "bridge"))
    built.part(BODY)
    if kind == "steps":
        count = int(rng.integers(3, 7))
        corners = [[k / count, (k + j) / count] for k in range(count) for j in (0, 1)]
        built.prism([0, 0, 0], np.array([*corners, [1, 1], [1, 0]]) * [2, 1.4], half, 0.01, turn)
        return
    wide, high = span(rng, 0.8, 1.4), span(rng, 0.5, 1.0)
    built.box([0, 0.5 * high, 0], [wide, 0.5 * high, 0.5 * half], 0.01, turn)
    axle = turn @ turned(0, np.pi / 2)
    if kind == "wall":
        for x in np.arange(-wide + 0.2, wide, 0.4):
            built.box(turn @ vec(x, high, 0), [0.1, 0.18, 2], 0, turn, cut=True)
    holes = pick(rng, (2, 3)) if kind == "bridge" else 1
    for k in range(holes):
        x, r = wide * ((2 * k + 1) / holes - 1), min(0.75 * wide / holes, 0.8 * high)
        built.cylinder(turn @ vec(x, 0, 0), r, 2.0, 0, axle, cut=True)
    if kind == "arch" and chance(rng, 0.5):
        built.part(MORE)
        built.box([0, high + 0.06, 0], [1.08 * wide, 0.07, 0.6 * half], 0.01, turn)
