"""Chairs, stools, tables, sofas, shelves, beds, benches and lamps that stand on the floor."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .cupboards import bed, dresser, shelf
from .legs import legs
from .making import Rng, chance, curve, pick, profile, rounded, span, tube, vec

WOOD, SOFT, METAL, MORE = range(4)


def furniture(rng: Rng) -> PrimitiveBuilder:
    """Make a piece of furniture."""
    kinds = (
        _chair,
        _chair,
        _chair,
        _stool,
        _table,
        _table,
        _sofa,
        _sofa,
        shelf,
        bed,
        _bench,
        _lamp,
        _swivel,
        dresser,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _seat(rng: Rng, built: PrimitiveBuilder, half: F64, high: float) -> None:
    """A board, or a cushion on it."""
    thick = span(rng, 0.03, 0.08)
    built.part(pick(rng, (WOOD, SOFT)))
    if chance(rng, 0.6):
        built.box([0, high, 0], [half[0], thick, half[1]], 0.6 * thick)
    else:
        outline = rounded(half[0], half[1], span(rng, 0.1, 0.9) * min(half), 5)
        built.prism([0, high, 0], outline, thick, 0.02, turned(0, np.pi / 2))
    if chance(rng, 0.3):
        built.part(SOFT)
        built.superquadric(
            [0, high + thick + 0.03, 0], [0.92 * half[0], 0.09, 0.92 * half[1]], 0.8, 0.4
        )


def _back(rng: Rng, built: PrimitiveBuilder, half: F64, low: float, high: float) -> None:
    """A chair's back, at -z; it leans."""
    lean = span(rng, 0, 0.25) * (high - low)
    z = -half[1] + 0.04
    kind = pick(rng, ("slats", "rungs", "panel", "frame", "bow"))
    corners = [vec(sx * (half[0] - 0.05), low, z) for sx in (1, -1)]
    tops = [c + vec(0, high - low, -lean) for c in corners]
    thick = span(rng, 0.025, 0.045)
    if kind == "panel":
        built.part(pick(rng, (WOOD, SOFT)))
        turn = turned(0, -float(np.arctan2(lean, high - low)))
        middle = 0.25 * (sum(corners, np.zeros(3)) + sum(tops, np.zeros(3)))
        size = [half[0] - 0.03, 0.5 * (high - low), span(rng, 0.03, 0.08)]
        built.box(middle, size, 0.03, turn)
        if chance(rng, 0.4):
            built.box(middle, [0.4 * size[0], 0.3 * size[1], 1], 0.02, turn, cut=True)
        return
    built.part(WOOD)
    if kind == "bow":
        line = curve(
            [
                corners[0],
                tops[0] - [0, 0.1, 0],
                0.5 * (tops[0] + tops[1]) + [0, 0.1, 0],
                tops[1] - [0, 0.1, 0],
                corners[1],
            ],
            9,
        )
        tube(built, line, thick)
    else:
        for a, b in zip(corners, tops, strict=True):
            built.limb(a, b, thick, thick)
    count = int(rng.integers(2, 6))
    if kind in ("slats", "bow"):
        for k in range(count):
            t = (k + 1) / (count + 1)
            a, b = (p[0] * (1 - t) + p[1] * t for p in (corners, tops))
            built.limb(a, b, 0.6 * thick, 0.6 * thick)
    if kind in ("rungs", "frame", "slats"):
        levels = np.linspace(0.35, 1, count) if kind == "rungs" else np.array([0.35, 1.0])
        for t in levels:
            a, b = (c * (1 - t) + p * t for c, p in zip(corners, tops, strict=True))
            built.limb(a, b, 1.2 * thick, 1.2 * thick)
    if kind == "frame":
        built.part(SOFT)
        middle = 0.16 * sum(corners, np.zeros(3)) + 0.34 * sum(tops, np.zeros(3))
        turn = turned(0, -float(np.arctan2(lean, high - low)))
        built.box(middle, [half[0] - 0.06, 0.32 * (high - low), 0.035], 0.02, turn)


def _chair(rng: Rng, built: PrimitiveBuilder) -> None:
    """Any legs with any back, with or without arms."""
    half = vec(span(rng, 0.38, 0.55), span(rng, 0.36, 0.52))
    high, top = span(rng, 0.65, 0.95), span(rng, 0.7, 1.2)
    _seat(rng, built, half, high)
    legs(rng, built, half, high)
    _back(rng, built, half, high, high + top)
    if chance(rng, 0.35):
        for sign in (1, -1):
            built.part(WOOD)
            x, y = sign * half[0], high + span(rng, 0.3, 0.4)
            tube(
                built,
                np.array([[x, high, 0.8 * half[1]], [x, y, 0.7 * half[1]], [x, y, -half[1]]]),
                0.035,
            )


def _stool(rng: Rng, built: PrimitiveBuilder) -> None:
    """On one, three or four legs."""
    wide, high = span(rng, 0.3, 0.5), span(rng, 0.5, 1.5)
    built.part(pick(rng, (WOOD, SOFT)))
    built.cylinder([0, high, 0], wide, span(rng, 0.04, 0.12), 0.03)
    legs = pick(rng, (1, 3, 3, 4))
    if legs == 1:
        built.part(METAL)
        built.cylinder([0, 0.04, 0], 0.8 * wide, 0.04, 0.03)
        built.limb([0, 0.05, 0], [0, high, 0], 0.05, 0.05, soft=0.08)
    for k in range(legs if legs > 1 else 0):
        built.part(WOOD)
        way = vec(np.cos(k * 2 * np.pi / legs), 0, np.sin(k * 2 * np.pi / legs))
        built.limb(
            0.7 * wide * way + [0, high, 0],
            wide * way * span(rng, 0.9, 1.3) + [0, 0.03, 0],
            0.05,
            0.035,
        )
    if high > 0.8 or chance(rng, 0.3):
        built.part(METAL)
        built.ring([0, 0.35 * high, 0], wide * (0.95 if legs > 1 else 0.6), 0.025)


def _table(rng: Rng, built: PrimitiveBuilder) -> None:
    """Square, round, on four legs, on one or on trestles; sometimes laid."""
    half, high = vec(span(rng, 0.6, 1.3), span(rng, 0.4, 0.8)), span(rng, 0.4, 1.0)
    thick, is_round = span(rng, 0.025, 0.06), chance(rng, 0.35)
    built.part(WOOD)
    if is_round:
        half[1] = half[0] = span(rng, 0.5, 0.9)
        built.cylinder([0, high, 0], half[0], thick, 0.01)
    else:
        built.box([0, high, 0], [half[0], thick, half[1]], 0.01)
    if is_round and chance(rng, 0.6):
        built.part(METAL)
        built.limb([0, 0.1, 0], [0, high, 0], 0.07, 0.07)
        for k in range(3 if chance(rng, 0.5) else 4):
            way = 2.1 * k if k < 3 else 4.0
            built.limb(
                [0, 0.15, 0],
                0.6 * half[0] * vec(np.cos(way), 0, np.sin(way)) + [0, 0.03, 0],
                0.06,
                0.035,
            )
    elif chance(rng, 0.2):
        for sign in (1, -1):
            built.part(WOOD)
            for z in (1, -1):
                built.limb(
                    [0.7 * sign * half[0], high, 0],
                    [0.7 * sign * half[0], 0.04, 0.8 * z * half[1]],
                    0.04,
                    0.04,
                )
    else:
        legs(rng, built, half * (0.7 if is_round else 0.95), high)
        if chance(rng, 0.4):
            built.part(WOOD)
            built.box(
                [0, high - 0.09, 0],
                [0.85 * half[0] * (0.7 if is_round else 1), 0.07, 0.6 * half[1]],
            )
    for _ in range(rng.integers(0, 4)):
        built.part(MORE)
        at = vec(span(rng, -0.6, 0.6) * half[0], high + thick, span(rng, -0.6, 0.6) * half[1])
        if chance(rng, 0.5):
            built.cylinder(at + [0, 0.1, 0], span(rng, 0.05, 0.15), 0.1, 0.02)
        else:
            built.box(at + [0, 0.05, 0], [0.17, 0.05, 0.12], 0.01, turned(span(rng, 0, 3)))


def _sofa(rng: Rng, built: PrimitiveBuilder) -> None:
    """Armchairs and sofas with cushions."""
    seats = pick(rng, (1, 1, 2, 3))
    wide, deep, high = (
        0.45 * seats * span(rng, 0.9, 1.1),
        span(rng, 0.4, 0.55),
        span(rng, 0.3, 0.45),
    )
    arm, back, foot = span(rng, 0.08, 0.18), span(rng, 0.4, 0.8), span(rng, 0.0, 0.15)
    round_ = span(rng, 0.02, 0.1)
    built.part(SOFT)
    built.box([0, foot + 0.5 * high, 0], [wide + arm, 0.5 * high, deep], round_)
    built.part(SOFT)
    lean = turned(0, -span(rng, 0, 0.25))
    built.box(
        [0, foot + high + 0.4 * back, -deep],
        [wide + arm, 0.6 * back, span(rng, 0.1, 0.18)],
        round_,
        lean,
    )
    for sign in (1, -1):
        built.part(SOFT)
        up = span(rng, 0.2, 0.35)
        if chance(rng, 0.5):
            built.box(
                [sign * (wide + arm), foot + 0.5 * (high + up), 0],
                [arm, 0.5 * (high + up), deep],
                round_,
            )
        else:
            built.box(
                [sign * (wide + arm), foot + 0.5 * high, 0],
                [0.8 * arm, 0.5 * high + 0.1, deep],
                0.02,
            )
            at = vec(sign * (wide + arm), foot + high + 0.12, 0)
            built.cylinder(at, 1.2 * arm, 1.02 * deep, 0.04, turned(0, np.pi / 2), soft=0.05)
    _cushions(rng, built, seats, vec(wide, foot + high, deep))
    if foot > 0.04:
        legs(rng, built, vec(0.9 * wide, 0.9 * deep), foot + 0.05, "taper")


def _cushions(rng: Rng, built: PrimitiveBuilder, seats: int, size: F64) -> None:
    """One on each seat, often another behind; `size`: half the width, height, half the depth."""
    wide, high, deep = size
    for k in range(seats):
        built.part(pick(rng, (SOFT, MORE)))
        x = (2 * k + 1 - seats) * wide / seats
        built.superquadric(
            [x, high + 0.06, 0.06], [0.98 * wide / seats, 0.14, 0.95 * deep], 0.5, 0.25
        )
        if chance(rng, 0.5):
            built.part(MORE)
            turn = turned(0, -0.35, rng.normal(0, 0.2))
            built.superquadric([x, high + 0.35, -0.5 * deep], [0.28, 0.26, 0.12], 0.7, 0.7, turn)


def _bench(rng: Rng, built: PrimitiveBuilder) -> None:
    """Of slats, on two trestles."""
    half, high = vec(span(rng, 0.7, 1.2), span(rng, 0.22, 0.35)), span(rng, 0.4, 0.6)
    slats = int(rng.integers(2, 5))
    for k in range(slats):
        built.part(WOOD)
        z = half[1] * ((2 * k + 1) / slats - 1)
        built.box([0, high, z], [half[0], 0.035, 0.85 * half[1] / slats], 0.015)
    for k in range(rng.integers(0, 4)):
        built.part(WOOD)
        built.box(
            [0, high + 0.15 + 0.17 * k, -half[1] - 0.04 - 0.03 * k], [half[0], 0.06, 0.025], 0.01
        )
    for sign in (1, -1):
        built.part(METAL)
        x = 0.75 * sign * half[0]
        for z in (half[1], -half[1]):
            built.limb([x, high, 0.7 * z], [x, 0.03, z], 0.045, 0.035)
        built.limb([x, high - 0.05, half[1]], [x, high - 0.05, -half[1]], 0.035, 0.035)
        built.limb([x, high, -half[1]], [x, high + 0.62, -half[1] - 0.13], 0.035, 0.03)


def _lamp(rng: Rng, built: PrimitiveBuilder) -> None:
    """On the floor or on the desk, with an arm in two parts."""
    built.part(METAL)
    built.cylinder([0, 0.04, 0], span(rng, 0.2, 0.35), 0.04, 0.03)
    high, out = span(rng, 0.6, 1.6), span(rng, -0.4, 0.5)
    elbow = vec(out, high, 0)
    built.limb([0, 0.05, 0], elbow, 0.035, 0.035)
    reach = span(rng, 0.3, 0.9)
    end = elbow + reach * vec(np.cos(0.3), span(rng, -0.3, 0.6), 0)
    built.part(METAL)
    built.limb(elbow, end, 0.03, 0.03)
    built.ellipsoid(elbow, np.full(3, 0.06))
    built.part(SOFT)
    wide, tall = span(rng, 0.16, 0.35), span(rng, 0.2, 0.4)
    turn = turned(0, 0, span(rng, -0.5, 0.9))
    low = end - turn @ vec(0, tall, 0)
    built.lathe(low, profile([[wide, 0], [0.95 * wide, 0.4 * tall], [0.08, tall]], 1), turn)
    inside = [
        [wide, -0.05],
        [wide - 0.04, 0],
        [0.95 * wide - 0.04, 0.4 * tall],
        [0.05, 0.85 * tall],
    ]
    built.lathe(low, profile(inside, 1), turn, cavity=True)


def _swivel(rng: Rng, built: PrimitiveBuilder) -> None:
    """An office chair on castors."""
    high, half = span(rng, 0.55, 0.75), vec(span(rng, 0.36, 0.48), span(rng, 0.36, 0.45))
    built.part(SOFT)
    built.superquadric([0, high, 0], [half[0], 0.1, half[1]], 0.6, 0.5)
    built.part(SOFT)
    turn = turned(0, -span(rng, 0, 0.3))
    tall = span(rng, 0.3, 0.6)
    built.superquadric(
        [0, high + 0.25 + tall, -half[1] - 0.03], [0.9 * half[0], tall, 0.09], 0.5, 0.6, turn
    )
    built.part(METAL)
    built.limb([0, high, -half[1] + 0.05], [0, high + 0.4, -half[1] - 0.05], 0.05, 0.05)
    built.limb([0, 0.15, 0], [0, high, 0], 0.06, 0.05)
    for k in range(5):
        way = vec(np.cos(1.2566 * k), 0, np.sin(1.2566 * k))
        built.limb([0, 0.17, 0], 0.5 * way + [0, 0.12, 0], 0.05, 0.035)
        built.ellipsoid(0.5 * way + [0, 0.06, 0], [0.06, 0.06, 0.06])
    if chance(rng, 0.6):
        for sign in (1, -1):
            built.part(METAL)
            x = sign * (half[0] + 0.05)
            tube(
                built, np.array([[0.7 * x, high, 0], [x, high + 0.1, 0], [x, high + 0.3, 0]]), 0.035
            )
            built.box([x, high + 0.32, 0.05], [0.06, 0.03, 0.25], 0.02)
