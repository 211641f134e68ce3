"""Hats, shoes, bags, shirts, trousers, gloves."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, curve, pick, profile, smooth, span, tube, vec

CLOTH, MORE, METAL, THIRD = range(4)


def hat(rng: Rng, built: PrimitiveBuilder) -> None:
    """Brimmed, with a band, a dent, and now and then a feather; hollow below."""
    tilt = turned(span(rng, 0, 6), *rng.normal(0, 0.4, 2))
    wide, brim, high = span(rng, 0.4, 0.5), span(rng, 0.2, 0.6), span(rng, 0.3, 0.9)
    top = span(rng, 0.2, 1.05) * wide
    built.part(CLOTH)
    rise = span(rng, -0.05, 0.2)
    outline = [
        [wide + brim, rise],
        [wide + brim, rise + 0.05],
        [wide, 0.06],
        [0.95 * wide, 0.5 * high],
        [top, high],
    ]
    built.lathe([0, 0, 0], profile(outline, 2), tilt)
    inside = [
        [wide + brim - 0.03, rise - 0.3],
        [wide + brim - 0.03, rise - 0.01],
        [wide - 0.05, -0.02],
        [0.9 * wide - 0.05, 0.5 * high],
        [max(top - 0.05, 0.05), high - 0.05],
    ]
    built.lathe([0, 0, 0], profile(inside, 2), tilt, cavity=True)
    if chance(rng, 0.4):
        built.ellipsoid(
            tilt @ vec(0, high + 0.1, 0), [0.8 * wide, 0.2, 0.2], tilt, cut=True, soft=0.08
        )
    built.part(MORE)
    built.ring(tilt @ vec(0, 0.12, 0), 0.98 * wide, 0.04, turn=tilt)
    if chance(rng, 0.3):
        built.part(THIRD)
        built.ellipsoid(tilt @ vec(wide, 0.35, 0), [0.03, 0.35, 0.1], tilt @ turned(0, 0.5))


def cap(rng: Rng, built: PrimitiveBuilder) -> None:
    """A cap with a peak, or a woollen one with a bobble."""
    wide, high = 0.5, span(rng, 0.35, 0.6)
    built.part(CLOTH)
    built.ellipsoid([0, 0, 0], [wide, high, span(rng, 0.5, 0.6)])
    built.box([0, -1, 0], [2, 1, 2], cut=True)
    built.ellipsoid([0, -0.02, 0], [wide - 0.04, high - 0.05, 0.47], cavity=True)
    built.part(MORE)
    if chance(rng, 0.6):
        flat = turned(0, -np.pi / 2 + span(rng, 0, 0.25))
        built.sheet([0, 0.03, 0.72], [0.42, 0.36], 0.02, (0, 0, 0, 0), -span(rng, 0.4, 1.2), flat)
        built.ellipsoid([0, high, 0], np.full(3, 0.05))
    else:
        built.ring([0, 0.04, 0], 0.53, 0.075)
        built.ellipsoid([0, high + 0.1, 0], np.full(3, span(rng, 0.12, 0.2)))


def shoe(rng: Rng, built: PrimitiveBuilder) -> None:
    """Shoes, boots, slippers, pumps, single or in a pair; they point along +x."""
    heel, shaft = pick(rng, (0.05, 0.08, 0.35)), pick(rng, (0.15, 0.3, 0.8))
    toe = span(rng, 0.22, 0.34)
    for k in range(pick(rng, (1, 2))):
        turn = turned(rng.normal(0, 0.3) * k)
        _one_shoe(rng, built, vec(0.1 * k, 0, 0.75 * k), turn, (heel, shaft, toe))


def _one_shoe(
    rng: Rng, built: PrimitiveBuilder, at: F64, turn: F64, size: tuple[float, float, float]
) -> None:
    """A hollow shoe; `size`: the heel's height, the shaft's, half the width at the toes."""
    heel, shaft, toe = size
    built.part(CLOTH)
    built.limb(
        at + turn @ vec(-0.45, heel + 0.3, 0), at + turn @ vec(0.5, 0.24, 0), 0.26, toe - 0.06
    )
    built.ellipsoid(at + turn @ vec(0.45, 0.18, 0), [0.45, 0.19, toe], turn, soft=0.15)
    high = heel + 0.4 + shaft
    built.limb(
        at + turn @ vec(-0.45, heel + 0.3, 0),
        at + turn @ vec(-0.42, high, 0),
        0.25,
        0.26,
        soft=0.15,
    )
    built.box(at + [0, -1 + 0.04, 0], [3, 1.0, 3], 0, turn, cut=True)
    built.box(at + turn @ vec(-0.4, high + 0.6, 0), [1, 0.6, 1], 0, turn, cut=True)
    built.limb(
        at + turn @ vec(-0.45, heel + 0.35, 0),
        at + turn @ vec(-0.42, high + 0.3, 0),
        0.19,
        0.21,
        cavity=True,
    )
    built.part(MORE)
    corners = [[-0.72, 0.2], [-0.72, -0.2], [0.1, -0.2], [0.5, -toe], [0.95, 0], [0.5, toe]]
    sole = smooth([*corners, [0.1, 0.2]], 2)
    if heel < 0.2:
        built.prism(
            at + [0, 0.5 * heel, 0], sole, 0.5 * heel + 0.03, 0.02, turn @ turned(0, np.pi / 2)
        )
    else:
        built.limb(at + turn @ vec(-0.6, 0.35, 0), at + turn @ vec(-0.62, 0.04, 0), 0.13, 0.07)
    for j in range(rng.integers(0, 4)):
        built.part(THIRD)
        p = vec(0.05 + 0.13 * j, 0.47 - 0.045 * j + 0.25 * heel, 0)
        built.limb(at + turn @ (p + [0, 0, -0.12]), at + turn @ (p + [0, 0, 0.12]), 0.025, 0.025)


def handbag(rng: Rng, built: PrimitiveBuilder) -> None:
    """A bag with a bow or a strap, soft or stiff, with a flap."""
    half, deep = vec(span(rng, 0.45, 0.7), span(rng, 0.3, 0.5)), span(rng, 0.12, 0.25)
    built.part(CLOTH)
    if chance(rng, 0.5):
        outline = np.array(
            [
                [-half[0], 0],
                [half[0], 0],
                [0.75 * half[0], 2 * half[1]],
                [-0.75 * half[0], 2 * half[1]],
            ]
        )
        built.prism([0, 0, 0], smooth(outline, 2), deep, 0.6 * deep)
    else:
        built.superquadric(
            [0, half[1], 0], [half[0], half[1], deep], span(rng, 0.3, 0.7), span(rng, 0.5, 0.9)
        )
    if chance(rng, 0.5):
        built.part(CLOTH)
        built.box([0, 1.45 * half[1], deep - 0.02], [0.72 * half[0], 0.5 * half[1], 0.05], 0.04)
    built.part(METAL)
    built.ellipsoid([0, half[1], deep + 0.03], [0.07, 0.05, 0.04])
    built.part(MORE)
    lift = span(rng, 0.4, 1.2)
    for z in (0.0,) if chance(rng, 0.5) else (0.6 * deep, -0.6 * deep):
        x = 0.5 * half[0]
        line = [
            [-x, 1.85 * half[1], z],
            [-0.9 * x, 2 * half[1] + 0.8 * lift, z],
            [0.9 * x, 2 * half[1] + 0.8 * lift, z],
            [x, 1.85 * half[1], z],
        ]
        tube(built, curve(line, 10), 0.035)


def rucksack(rng: Rng, built: PrimitiveBuilder) -> None:
    """A bag for the back with a pocket, straps and a lid."""
    half = vec(span(rng, 0.35, 0.5), span(rng, 0.5, 0.7), span(rng, 0.2, 0.3))
    built.part(CLOTH)
    built.superquadric([0, half[1], 0], half, span(rng, 0.4, 0.7), 0.5)
    built.part(pick(rng, (CLOTH, MORE)))
    built.superquadric(
        [0, 0.62 * half[1], half[2]], [0.75 * half[0], 0.5 * half[1], 0.14], 0.4, 0.5
    )
    if chance(rng, 0.5):
        built.part(MORE)
        built.superquadric(
            [0, 1.8 * half[1], 0.05], [1.02 * half[0], 0.3 * half[1], 1.15 * half[2]], 0.6, 0.5
        )
    for sign in (1, -1):
        built.part(MORE)
        x = 0.5 * sign * half[0]
        line = [
            [x, 1.8 * half[1], -0.8 * half[2]],
            [1.2 * x, 1.4 * half[1], -half[2] - 0.25],
            [1.5 * x, 0.7 * half[1], -half[2] - 0.15],
            [1.4 * x, 0.2 * half[1], -0.8 * half[2]],
        ]
        tube(built, curve(line, 7), 0.05)
    built.ring([0, 1.95 * half[1], -0.5 * half[2]], 0.12, 0.03, turn=turned(0, np.pi / 2))


def shirt(rng: Rng, built: PrimitiveBuilder) -> None:
    """A shirt or a coat, flat as if it hung, with sleeves."""
    wide, long, thick = span(rng, 0.42, 0.55), span(rng, 0.55, 0.9), span(rng, 0.05, 0.16)
    built.part(CLOTH)
    built.superquadric([0, 0, 0], [wide, long, thick], 0.35, 0.6)
    built.ellipsoid([0, long, 0.3 * thick], [0.17, 0.16, 1.0], cut=True)
    drop, reach = span(rng, 0.1, 1.2), span(rng, 0.4, 1.1)
    for sign in (1, -1):
        built.part(pick(rng, (CLOTH, CLOTH, MORE)))
        root = vec(0.8 * wide * sign, 0.82 * long, 0)
        way = vec(sign * np.cos(drop), -np.sin(drop), 0)
        built.superquadric(
            root + 0.5 * reach * way,
            [0.17, 0.6 * reach, 0.9 * thick],
            0.5,
            0.7,
            np.column_stack([np.cross(way, vec(0, 0, 1)), way, vec(0, 0, 1)]),
        )
    for k in range(rng.integers(0, 5)):
        built.part(METAL)
        built.ellipsoid([0, 0.6 * long - 0.25 * k, thick], [0.035, 0.035, 0.025])


def trousers(rng: Rng, built: PrimitiveBuilder) -> None:
    """Two legs and a belt."""
    wide, long = span(rng, 0.35, 0.45), span(rng, 0.4, 1.3)
    built.part(CLOTH)
    built.superquadric([0, 0.1, 0], [wide, 0.3, 0.16], 0.4, 0.8)
    for sign in (1, -1):
        foot = vec(sign * span(rng, 0.2, 0.4), -long, rng.normal(0, 0.1))
        built.limb([0.5 * wide * sign, 0.0, 0], foot, 0.19, span(rng, 0.12, 0.2), soft=0.08)
    built.box([0, -long - 0.9, 0], [2, 0.9, 2], cut=True)
    built.part(MORE)
    built.box([0, 0.36, 0], [0.93 * wide, 0.05, 0.12], 0.04)


def glove(rng: Rng, built: PrimitiveBuilder) -> None:
    """A mitten or a sock."""
    built.part(CLOTH)
    turn = turned(span(rng, 0, 6), rng.normal(0, 0.4), rng.normal(0, 0.4))
    if chance(rng, 0.5):
        built.ellipsoid(turn @ vec(0, 0.3, 0), [0.38, 0.6, 0.17], turn)
        built.limb(turn @ vec(-0.1, 0, 0.03), turn @ vec(-0.5, 0.35, 0.12), 0.15, 0.12, soft=0.12)
        built.part(MORE)
        built.superquadric(turn @ vec(0, -0.35, 0), [0.3, 0.22, 0.18], 0.4, 1.0, turn)
    else:
        line = curve([[0, 0.9, 0], [0, 0.1, 0], [0.1, -0.2, 0], [0.7, -0.35, 0]], 6)
        tube(built, line @ turn.T, 0.24, 0.19)
        built.part(MORE)
        built.cylinder(turn @ vec(0, 0.9, 0), 0.27, 0.14, 0.06, turn)
