"""Chairs, stools, tables, sofas, shelves, beds, benches and lamps that stand on the floor."""

from __future__ import annotations

import numpy as np

from ....arrays import F64
from ..solid import Builder, turned
from .making import Rng, chance, curve, pick, profile, rounded, span, tube, vec

WOOD, SOFT, METAL, MORE = range(4)


def furniture(rng: Rng) -> Builder:
    """One piece."""
    kinds = (_chair, _chair, _chair, _stool, _table, _table, _sofa, _sofa, _shelf, _bed, _bench,
             _lamp, _swivel, _dresser)  # fmt: skip
    built = Builder()
    pick(rng, kinds)(rng, built)
    return built


def _legs(rng: Rng, built: Builder, half: F64, high: float, kind: str | None = None) -> None:
    """Four legs beneath a seat or a top of half sizes (2,), x and z; each a part."""
    kind = kind or pick(rng, ("square", "round", "splayed", "turned", "taper"))
    thick, out = span(rng, 0.03, 0.07), span(rng, 0.05, 0.2)
    for sx in (1, -1):
        for sz in (1, -1):
            built.part(METAL if kind == "round" else WOOD)
            at = vec(sx * (half[0] - thick), 0, sz * (half[1] - thick))
            if kind == "square":
                built.box(at + [0, 0.5 * high, 0], [thick, 0.5 * high, thick], 0.01)
            elif kind == "turned":
                outline = [[0.6, 0], [0.6, 0.05], [1, 0.1], [0.6, 0.2], [1.1, 0.55], [0.8, 0.8], [1.2, 1]]
                built.lathe(at, profile(np.array(outline) * [thick, high], 1))
            else:
                spread = vec(sx, 0, sz) * (out if kind == "splayed" else 0)
                foot = 0.6 * thick if kind != "round" else 0.7 * thick
                top = thick if kind != "round" else foot
                built.limb(at + [0, high, 0], at + spread + [0, foot, 0], top, foot)
    if chance(rng, 0.3):
        built.part(WOOD)
        for sx in (1, -1):
            y = span(rng, 0.15, 0.4) * high
            x = sx * (half[0] - thick)
            built.limb([x, y, -half[1] + thick], [x, y, half[1] - thick], 0.6 * thick, 0.6 * thick)
        built.limb([-half[0], y, 0], [half[0], y, 0], 0.6 * thick, 0.6 * thick)


def _seat(rng: Rng, built: Builder, half: F64, high: float) -> None:
    thick = span(rng, 0.03, 0.08)
    built.part(pick(rng, (WOOD, SOFT)))
    if chance(rng, 0.6):
        built.box([0, high, 0], [half[0], thick, half[1]], 0.6 * thick)
    else:
        outline = rounded(half[0], half[1], span(rng, 0.1, 0.9) * min(half), 5)
        built.prism([0, high, 0], outline, thick, 0.02, turned(0, np.pi / 2))
    if chance(rng, 0.3):
        built.part(SOFT)
        built.superquadric([0, high + thick + 0.03, 0], [0.92 * half[0], 0.09, 0.92 * half[1]], 0.8, 0.4)


def _back(rng: Rng, built: Builder, half: F64, low: float, high: float) -> None:
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
        line = curve([corners[0], tops[0] - [0, 0.1, 0], 0.5 * (tops[0] + tops[1]) + [0, 0.1, 0],
                      tops[1] - [0, 0.1, 0], corners[1]], 9)  # fmt: skip
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


def _chair(rng: Rng, built: Builder) -> None:
    half = vec(span(rng, 0.38, 0.55), span(rng, 0.36, 0.52))
    high, top = span(rng, 0.65, 0.95), span(rng, 0.7, 1.2)
    _seat(rng, built, half, high)
    _legs(rng, built, half, high)
    _back(rng, built, half, high, high + top)
    if chance(rng, 0.35):
        for sign in (1, -1):
            built.part(WOOD)
            x, y = sign * half[0], high + span(rng, 0.3, 0.4)
            tube(built, np.array([[x, high, 0.8 * half[1]], [x, y, 0.7 * half[1]], [x, y, -half[1]]]), 0.035)


def _stool(rng: Rng, built: Builder) -> None:
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
        built.limb(0.7 * wide * way + [0, high, 0], wide * way * span(rng, 0.9, 1.3) + [0, 0.03, 0], 0.05, 0.035)
    if high > 0.8 or chance(rng, 0.3):
        built.part(METAL)
        built.ring([0, 0.35 * high, 0], wide * (0.95 if legs > 1 else 0.6), 0.025)


def _table(rng: Rng, built: Builder) -> None:
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
            built.limb([0, 0.15, 0], 0.6 * half[0] * vec(np.cos(way), 0, np.sin(way)) + [0, 0.03, 0], 0.06, 0.035)
    elif chance(rng, 0.2):
        for sign in (1, -1):
            built.part(WOOD)
            for z in (1, -1):
                built.limb([0.7 * sign * half[0], high, 0], [0.7 * sign * half[0], 0.04, 0.8 * z * half[1]],
                           0.04, 0.04)  # fmt: skip
    else:
        _legs(rng, built, half * (0.7 if is_round else 0.95), high)
        if chance(rng, 0.4):
            built.part(WOOD)
            built.box([0, high - 0.09, 0], [0.85 * half[0] * (0.7 if is_round else 1), 0.07, 0.6 * half[1]])
    for _ in range(rng.integers(0, 4)):
        built.part(MORE)
        at = vec(span(rng, -0.6, 0.6) * half[0], high + thick, span(rng, -0.6, 0.6) * half[1])
        if chance(rng, 0.5):
            built.cylinder(at + [0, 0.1, 0], span(rng, 0.05, 0.15), 0.1, 0.02)
        else:
            built.box(at + [0, 0.05, 0], [0.17, 0.05, 0.12], 0.01, turned(span(rng, 0, 3)))


def _sofa(rng: Rng, built: Builder) -> None:
    """Armchairs and sofas with cushions."""
    seats = pick(rng, (1, 1, 2, 3))
    wide, deep, high = 0.45 * seats * span(rng, 0.9, 1.1), span(rng, 0.4, 0.55), span(rng, 0.3, 0.45)
    arm, back, foot = span(rng, 0.08, 0.18), span(rng, 0.4, 0.8), span(rng, 0.0, 0.15)
    round_ = span(rng, 0.02, 0.1)
    built.part(SOFT)
    built.box([0, foot + 0.5 * high, 0], [wide + arm, 0.5 * high, deep], round_)
    built.part(SOFT)
    lean = turned(0, -span(rng, 0, 0.25))
    built.box([0, foot + high + 0.4 * back, -deep], [wide + arm, 0.6 * back, span(rng, 0.1, 0.18)], round_, lean)
    for sign in (1, -1):
        built.part(SOFT)
        up = span(rng, 0.2, 0.35)
        if chance(rng, 0.5):
            built.box([sign * (wide + arm), foot + 0.5 * (high + up), 0], [arm, 0.5 * (high + up), deep], round_)
        else:
            built.box([sign * (wide + arm), foot + 0.5 * high, 0], [0.8 * arm, 0.5 * high + 0.1, deep], 0.02)
            at = vec(sign * (wide + arm), foot + high + 0.12, 0)
            built.cylinder(at, 1.2 * arm, 1.02 * deep, 0.04, turned(0, np.pi / 2), soft=0.05)
    for k in range(seats):
        built.part(pick(rng, (SOFT, MORE)))
        x = (2 * k + 1 - seats) * wide / seats
        built.superquadric([x, foot + high + 0.06, 0.06], [0.98 * wide / seats, 0.14, 0.95 * deep], 0.5, 0.25)
        if chance(rng, 0.5):
            built.part(MORE)
            turn = turned(0, -0.35, rng.normal(0, 0.2))
            built.superquadric([x, foot + high + 0.35, -0.5 * deep], [0.28, 0.26, 0.12], 0.7, 0.7, turn)
    if foot > 0.04:
        _legs(rng, built, vec(0.9 * wide, 0.9 * deep), foot + 0.05, "taper")


def _shelf(rng: Rng, built: Builder) -> None:
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


def _bed(rng: Rng, built: Builder) -> None:
    half, high = vec(span(rng, 0.4, 0.8), 1.0), span(rng, 0.2, 0.4)
    built.part(WOOD)
    built.box([0, high, 0], [half[0], 0.08, half[1]], 0.02)
    for sign, tall in ((-1, span(rng, 0.3, 0.8)), (1, span(rng, 0, 0.4))):
        built.part(WOOD)
        built.box([0, high + 0.3 * tall, sign * half[1]], [half[0] + 0.03, 0.5 * tall + 0.08, 0.04], 0.02)
    _legs(rng, built, half, high)
    built.part(SOFT)
    built.box([0, high + 0.17, 0], [0.97 * half[0], 0.11, 0.96 * half[1]], 0.07)
    built.part(MORE)
    built.superquadric([0, high + 0.24, 0.3], [1.02 * half[0], 0.1, 0.68], 0.5, 0.3)
    for x in (0.0,) if half[0] < 0.55 else (-0.45, 0.45):
        built.part(SOFT)
        built.superquadric([x * half[0], high + 0.34, -0.72], [0.3, 0.1, 0.2], 0.8, 0.5, turned(0, -0.2))


def _bench(rng: Rng, built: Builder) -> None:
    half, high = vec(span(rng, 0.7, 1.2), span(rng, 0.22, 0.35)), span(rng, 0.4, 0.6)
    slats = int(rng.integers(2, 5))
    for k in range(slats):
        built.part(WOOD)
        z = half[1] * ((2 * k + 1) / slats - 1)
        built.box([0, high, z], [half[0], 0.035, 0.85 * half[1] / slats], 0.015)
    for k in range(rng.integers(0, 4)):
        built.part(WOOD)
        built.box([0, high + 0.15 + 0.17 * k, -half[1] - 0.04 - 0.03 * k], [half[0], 0.06, 0.025], 0.01)
    for sign in (1, -1):
        built.part(METAL)
        x = 0.75 * sign * half[0]
        for z in (half[1], -half[1]):
            built.limb([x, high, 0.7 * z], [x, 0.03, z], 0.045, 0.035)
        built.limb([x, high - 0.05, half[1]], [x, high - 0.05, -half[1]], 0.035, 0.035)
        built.limb([x, high, -half[1]], [x, high + 0.62, -half[1] - 0.13], 0.035, 0.03)


def _lamp(rng: Rng, built: Builder) -> None:
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
    inside = [[wide, -0.05], [wide - 0.04, 0], [0.95 * wide - 0.04, 0.4 * tall], [0.05, 0.85 * tall]]
    built.lathe(low, profile(inside, 1), turn, cavity=True)


def _swivel(rng: Rng, built: Builder) -> None:
    """An office chair on castors."""
    high, half = span(rng, 0.55, 0.75), vec(span(rng, 0.36, 0.48), span(rng, 0.36, 0.45))
    built.part(SOFT)
    built.superquadric([0, high, 0], [half[0], 0.1, half[1]], 0.6, 0.5)
    built.part(SOFT)
    turn = turned(0, -span(rng, 0, 0.3))
    tall = span(rng, 0.3, 0.6)
    built.superquadric([0, high + 0.25 + tall, -half[1] - 0.03], [0.9 * half[0], tall, 0.09], 0.5, 0.6, turn)
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
            tube(built, np.array([[0.7 * x, high, 0], [x, high + 0.1, 0], [x, high + 0.3, 0]]), 0.035)
            built.box([x, high + 0.32, 0.05], [0.06, 0.03, 0.25], 0.02)


def _dresser(rng: Rng, built: Builder) -> None:
    """Drawers, of which some are open."""
    half, foot = vec(span(rng, 0.5, 0.9), span(rng, 0.35, 0.7), span(rng, 0.25, 0.4)), span(rng, 0.05, 0.25)
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
                built.box([x, y + 0.1, half[2] + 0.5 * out - 0.03], size - [0.04, 0.03, 0.02], cavity=True)
            built.part(METAL)
            built.ellipsoid([x, y, half[2] + out + 0.04], [0.06, 0.03, 0.035])
    _legs(rng, built, half[[0, 2]], foot + 0.03, "taper")
