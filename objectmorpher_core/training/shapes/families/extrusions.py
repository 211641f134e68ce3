"""Outlines given a depth: letters, digits, stars, hearts, gears, arrows, puzzle pieces, signs."""

from __future__ import annotations

import numpy as np

from ....arrays import F64
from ..solid import Builder, turned
from .making import Rng, chance, ngon, pick, rounded, smooth, span, vec
from .tools import tool

BODY, MORE, THIRD = range(3)
# Strokes of letters and digits on a grid of 0..2 by 0..4; a new stroke after each space
STROKES = {
    "A": "00,14,20 0.4 1.6,1.6 1.6", "E": "20,00,04,24 02,1.6 2", "F": "00,04,24 02,1.6 2",
    "H": "00,04 20,24 02,22", "I": "10,14 00,20 04,24", "K": "00,04 24,02,20", "L": "04,00,20",
    "M": "00,04,12,24,20", "N": "00,04,20,24", "T": "10,14 04,24", "V": "04,10,24", "W": "04,00,12,20,24",
    "X": "00,24 04,20", "Y": "10,12,04 12,24", "Z": "04,24,00,20", "1": "03,14,10 00,20",
    "4": "10,14,01,21", "7": "04,24,10", "2": "03,04,24,22,00,20", "5": "24,04,02,22,20,00",
    "3": "04,24,20,00 02,22", "6": "24,04,00,20,22,02", "8": "00,20,24,04,00 02,22", "U": "04,00,20,24",
}  # fmt: skip


def extrusions(rng: Rng) -> Builder:
    """One of them, standing, leaning or lying."""
    kinds = (_letter, _letter, _word, _star, _heart, _gear, _gear, _arrow, _puzzle, _sign, _blob,
             _cookie, _comb, _stairs)  # fmt: skip
    built = Builder()
    if chance(rng, 0.35):
        tool(rng, built, _pose(rng))
    else:
        pick(rng, kinds)(rng, built, _pose(rng))
    return built


def _pose(rng: Rng) -> F64:
    """Standing, leaning back, or lying."""
    lean = pick(rng, (0.0, 0.0, -span(rng, 0, 0.5), -np.pi / 2))
    return turned(span(rng, 0, 6.3)) @ turned(0, lean) @ turned(0, 0, rng.normal(0, 0.2) * (lean != 0))


def _deep(rng: Rng) -> tuple[float, float]:
    """Half the depth and how round its edges are."""
    half = span(rng, 0.05, 0.4)
    return half, min(half, 0.12) * span(rng, 0, 0.9)


def _strokes(name: str) -> list[F64]:
    """Lines (k, 2) of a letter."""
    lines = []
    numbers = STROKES[name].replace("0.4 1.6,1.6 1.6", "a,b").replace("1.6 2", "c").split()
    special = {"a": (0.4, 1.5), "b": (1.6, 1.5), "c": (1.6, 2.0)}
    for line in numbers:
        points = [special.get(p) or (float(p[0]), float(p[1])) for p in line.split(",")]
        lines.append(np.array(points) * 0.5 - [0.5, 1.0])
    return lines


def _draw(built: Builder, lines: list[F64], shift: F64, thick: float, half: float, turn: F64, is_round: bool) -> None:  # fmt: skip
    for line in lines:
        for a, b in zip(line[:-1], line[1:], strict=True):
            middle, way = 0.5 * (a + b) + shift, b - a
            long = 0.5 * float(np.linalg.norm(way))
            if is_round:
                built.limb(turn @ vec(*(a + shift), 0), turn @ vec(*(b + shift), 0), thick, thick)
            else:
                spin = turn @ turned(0, 0, float(np.arctan2(way[1], way[0])))
                built.box(turn @ vec(*middle, 0), [long + 0.7 * thick, thick, half], 0.1 * thick, spin)


def _letter(rng: Rng, built: Builder, turn: F64) -> None:
    """One letter or digit with straight, bevelled or round strokes; or O, C, D, P."""
    half, bevel = _deep(rng)
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
            built.box(turn @ vec(-wide + 0.5 * thick, -0.5, 0), [0.5 * thick, 0.5, half], bevel, turn)
        return
    thick = span(rng, 0.1, 0.2)
    _draw(built, _strokes(pick(rng, tuple(STROKES))), vec(0, 0), thick, half, turn, chance(rng, 0.3))


def _word(rng: Rng, built: Builder, turn: F64) -> None:
    """Two to four letters side by side, on a board or alone."""
    count, half, thick = int(rng.integers(2, 5)), span(rng, 0.08, 0.25), span(rng, 0.1, 0.17)
    is_round = chance(rng, 0.25)
    for k in range(count):
        built.part(pick(rng, (BODY, BODY, MORE)))
        lines = _strokes(pick(rng, tuple(STROKES)))
        _draw(built, lines, vec(1.45 * (k - 0.5 * (count - 1)), 0), thick, half, turn, is_round)
    if chance(rng, 0.4):
        built.part(THIRD)
        built.box(turn @ vec(0, 0, -half), [0.75 * count, 1.3, 0.08], 0.03, turn)


def _star(rng: Rng, built: Builder, turn: F64) -> None:
    half, bevel = _deep(rng)
    points, inner = int(rng.integers(4, 9)), span(rng, 0.35, 0.75)
    outline = ngon(2 * points, 1.0, np.pi / 2)
    outline[1::2] *= inner
    built.part(BODY)
    built.prism([0, 0, 0], smooth(outline, pick(rng, (0, 0, 2))), half, bevel, turn)
    if chance(rng, 0.4):
        built.part(MORE)
        built.prism(turn @ vec(0, 0, half), 0.6 * outline, 0.05, 0.02, turn)
    if chance(rng, 0.2):
        built.cylinder([0, 0, 0], 0.25 * inner, 1.0, 0, turn @ turned(0, np.pi / 2), cut=True)
    if chance(rng, 0.25):
        built.part(THIRD)
        built.limb(turn @ vec(0, -0.5, 0), turn @ vec(0, -2.2, 0), 0.08, 0.08)


def _heart(rng: Rng, built: Builder, turn: F64) -> None:
    t = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    x = 16 * np.sin(t) ** 3
    y = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    outline = np.stack([x * span(rng, 0.85, 1.1), y], 1) / 16
    half, bevel = _deep(rng)
    built.part(BODY)
    if chance(rng, 0.4):  # swollen
        for sign in (1, -1):
            built.limb(turn @ vec(0, -0.85, 0), turn @ vec(0.45 * sign, 0.3, 0), 0.12, 0.5, soft=0.08)
        return
    built.prism([0, 0, 0], outline, half, bevel, turn)
    if chance(rng, 0.4):
        built.prism([0, 0, 0], 0.7 * outline, 3 * half, 0, turn, cut=True)
    elif chance(rng, 0.4):
        built.part(MORE)
        built.prism(turn @ vec(0, 0, half), 0.7 * outline, 0.06, 0.02, turn)


def _gear(rng: Rng, built: Builder, turn: F64) -> None:
    """One wheel with teeth, or two that mesh, on axles."""
    half, bevel = _deep(rng)
    for k in range(pick(rng, (1, 1, 2))):
        teeth, size = int(rng.integers(6, 13)), span(rng, 0.6, 1.0)
        deep = span(rng, 0.12, 0.25) * size
        angle = 2 * np.pi * (np.arange(4 * teeth) + 0.5) / (4 * teeth)
        radius = np.where(np.arange(4 * teeth) % 4 < 2, size, size - deep)
        outline = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        at, axle = turn @ vec(1.75 * k, 0.2 * k, 0), turn @ turned(0, np.pi / 2)
        built.part(BODY + k)
        built.prism(at, outline, half, 0.5 * bevel, turn)
        kind = pick(rng, ("spokes", "plain", "holes"))
        if kind == "spokes":
            built.cylinder(at, 0.65 * size, 3 * half, 0, axle, cut=True)
            for j in range(3):
                built.box(at, [0.7 * size, 0.09 * size, 0.8 * half], 0.01, turn @ turned(0, 0, j * np.pi / 3))
            built.cylinder(at, 0.25 * size, half, 0.01, axle)
        elif kind == "holes":
            for j in range(5):
                spot = turn @ (0.45 * size * vec(np.cos(1.2566 * j), np.sin(1.2566 * j), 0))
                built.cylinder(at + spot, 0.14 * size, 3 * half, 0, axle, cut=True)
        built.cylinder(at, span(rng, 0.08, 0.15) * size, 3 * half, 0, axle, cut=True)
        if chance(rng, 0.3):
            built.part(THIRD)
            built.cylinder(at, 0.1 * size, half + span(rng, 0.1, 0.5), 0.02, axle)


def _arrow(rng: Rng, built: Builder, turn: F64) -> None:
    """Arrows, bolts of lightning, crosses, ticks."""
    half, bevel = _deep(rng)
    wide, head = span(rng, 0.1, 0.25), span(rng, 0.4, 0.7)
    outlines = (
        [[-1, -wide], [0.3, -wide], [0.3, -head], [1, 0], [0.3, head], [0.3, wide], [-1, wide]],
        [[-0.2, -1], [0.45, 0.15], [0.05, 0.15], [0.4, 1], [-0.25, 1], [-0.45, -0.1], [-0.05, -0.1]],
        [[-wide, -1], [wide, -1], [wide, -wide], [1, -wide], [1, wide], [wide, wide], [wide, 1], [-wide, 1],
         [-wide, wide], [-1, wide], [-1, -wide], [-wide, -wide]],
        [[-1, 0], [-0.7, 0.3], [-0.3, -0.1], [0.7, 0.9], [1, 0.6], [-0.3, -0.7]],
        [[-1, -0.6], [1, -0.6], [0, 1]],
        [[-0.4, -1], [0.4, -1], [1, 0], [0.4, 1], [-0.4, 1], [-1, 0]],
    )  # fmt: skip
    spin = turn @ turned(0, 0, pick(rng, (0.0, np.pi / 2, -np.pi / 2, np.pi)))
    outline = np.array(pick(rng, outlines))
    built.part(BODY)
    built.prism([0, 0, 0], smooth(outline, 2) if chance(rng, 0.3) else outline, half, bevel, spin)


def _puzzle(rng: Rng, built: Builder, turn: F64) -> None:
    """One to four pieces with knobs and hollows."""
    half, bevel = span(rng, 0.06, 0.2), 0.03
    axle = turn @ turned(0, np.pi / 2)
    spots = [vec(0, 0), vec(1.25, 0), vec(0, 1.25), vec(1.25, 1.25)][: pick(rng, (1, 1, 2, 4))]
    for k, spot in enumerate(spots):
        built.part(BODY if chance(rng, 0.5) else 10 + k)
        at = vec(*spot, 0) * (1.0 if len(spots) > 2 else 1.15)
        built.box(turn @ at, [0.6, 0.6, half], bevel, turn)
        ways = (vec(1, 0, 0), vec(0, 1, 0), vec(-1, 0, 0), vec(0, -1, 0))
        cuts = [chance(rng, 0.5) for _ in ways]
        for is_cut in (False, True):
            for way, own in zip(ways, cuts, strict=True):
                if own != is_cut:
                    continue
                knob = turn @ (at + way * (0.45 if own else 0.72))
                built.cylinder(knob, 0.2, 3 * half if own else half, 0 if own else bevel, axle, cut=own)
                if own:
                    built.box(turn @ (at + 0.62 * way), [0.1, 0.1, 3 * half], 0, turn, cut=True)
                else:
                    built.box(turn @ (at + 0.6 * way), [0.12, 0.12, half], 0.01, turn)


def _sign(rng: Rng, built: Builder, turn: F64) -> None:
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
        lines = [0.3 * line for line in _strokes(pick(rng, tuple(STROKES)))]
        _draw(built, lines, vec(0, high + 0.2), 0.05, 0.07, post, False)


def _blob(rng: Rng, built: Builder, turn: F64) -> None:
    """A random outline: a puddle, a stone cut flat, a cloud, a state on a map; with holes."""
    half, bevel = _deep(rng)
    count = int(rng.integers(5, 12))
    outline = ngon(count) * rng.uniform(0.4, 1.1, (count, 1))
    built.part(BODY)
    built.prism([0, 0, 0], smooth(outline, pick(rng, (0, 2, 2))), half, 0.5 * bevel, turn)
    axle = turn @ turned(0, np.pi / 2)
    for _ in range(rng.integers(0, 3)):
        built.cylinder(turn @ vec(*rng.normal(0, 0.25, 2), 0), span(rng, 0.08, 0.2), 2.0, 0, axle, cut=True)
    for k in range(rng.integers(0, 3)):
        built.part(MORE + k)
        other = ngon(count) * rng.uniform(0.15, 0.4, (count, 1)) + rng.normal(0, 0.2, 2)
        built.prism(turn @ vec(0, 0, half), smooth(other, 2), span(rng, 0.04, 0.2), 0.02, turn)


def _cookie(rng: Rng, built: Builder, turn: F64) -> None:
    """A gingerbread man, a tree, a moon, a fish, a house: flat and swollen at its edges."""
    half = span(rng, 0.08, 0.2)
    built.part(BODY)
    kind = pick(rng, ("man", "moon", "tree", "fish"))
    if kind == "man":
        lines = [[[0, 0], [0, 0.3]], [[0, 0.2], [-0.6, 0.35]], [[0, 0.2], [0.6, 0.35]], [[0, -0.1], [-0.35, -0.8]],
                 [[0, -0.1], [0.35, -0.8]]]  # fmt: skip
        for a, b in lines:
            built.limb(turn @ vec(*a, 0), turn @ vec(*b, 0), 0.26, 0.2, soft=0.1)
        built.ellipsoid(turn @ vec(0, 0.75, 0), [0.33, 0.33, 0.3], turn)
        built.box([0, 0, 0], [2, 2, half], 0, turn, keep=True, soft=0.08)
        at = [vec(0.12, 0.8), vec(-0.12, 0.8), vec(0, 0.3), vec(0, 0.1), vec(0, -0.1)]
        for spot in at:
            built.part(MORE)
            built.ellipsoid(turn @ vec(*spot, half), np.full(3, 0.06))
        return
    if kind == "moon":
        axle = turn @ turned(0, np.pi / 2)
        built.cylinder([0, 0, 0], 1.0, half, 0.6 * half, axle)
        built.cylinder(turn @ vec(span(rng, 0.35, 0.6), 0.1, 0), 0.85, 1.0, 0, axle, cut=True)
        return
    outline = (
        [[-0.12, -1], [0.12, -1], [0.12, -0.7], [0.8, -0.7], [0.3, -0.1], [0.6, -0.1], [0.2, 0.4], [0.4, 0.4],
         [0, 1], [-0.4, 0.4], [-0.2, 0.4], [-0.6, -0.1], [-0.3, -0.1], [-0.8, -0.7], [-0.12, -0.7]]
        if kind == "tree"
        else [[1, 0], [0.5, 0.45], [0, 0.45], [-0.5, 0.1], [-1, 0.5], [-1, -0.5], [-0.5, -0.1], [0, -0.45], [0.5, -0.45]]
    )  # fmt: skip
    built.prism([0, 0, 0], smooth(np.array(outline), 1 + (kind == "fish")), half, 0.5 * half, turn)
    if kind == "fish":
        built.part(MORE)
        built.ellipsoid(turn @ vec(0.6, 0.12, half), np.full(3, 0.09))


def _comb(rng: Rng, built: Builder, turn: F64) -> None:
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


def _stairs(rng: Rng, built: Builder, turn: F64) -> None:
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
