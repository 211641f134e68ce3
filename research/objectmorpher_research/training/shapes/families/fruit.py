"""Fruit and vegetables, whole, cut open, and in bunches."""

from __future__ import annotations

import numpy as np

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, curve, pick, profile, span, tube, vec

GREEN, SKIN, MIDDLE, MORE = range(4)


def fruit(rng: Rng, built: PrimitiveBuilder) -> None:
    """Make a fruit, or a bunch."""
    kinds = (_apple, _pear, _banana, _pumpkin, _grapes, _cherries, _pineapple, _slice, _strawberry)
    pick(rng, kinds)(rng, built)


def vegetable(rng: Rng, built: PrimitiveBuilder) -> None:
    """Make a vegetable."""
    kinds = (_carrot, _aubergine, _pepper, _tomatoes, _cabbage, _onion, _pod, _maize)
    pick(rng, kinds)(rng, built)


def _tilt(rng: Rng) -> np.ndarray:
    """Upright more often than not."""
    return turned(span(rng, 0, 6), *(rng.normal(0, 0.6, 2) * (rng.random() < 0.5)))


def _stem(
    rng: Rng, built: PrimitiveBuilder, turn: np.ndarray, y: float, long: float, thick: float
) -> None:
    """On top, at the height y; sometimes with a leaf."""
    built.part(MIDDLE)
    bow = vec(span(rng, -0.4, 0.4) * long, 0.5 * long, 0)
    line = np.array([[0, y, 0], vec(0, y, 0) + bow * 0.6, vec(0, y, 0) + bow + [0, 0.5 * long, 0]])
    tube(built, curve(line, 4) @ turn.T, thick, 1.2 * thick)
    if chance(rng, 0.4):
        built.part(GREEN)
        leaf = turn @ turned(span(rng, 0, 6), span(rng, -0.8, 0.3))
        built.ellipsoid(turn @ line[1] + leaf @ vec(0, 0, 0.28), [0.13, 0.02, 0.28], leaf)


def _apple(rng: Rng, built: PrimitiveBuilder) -> None:
    """Apples, peaches, oranges, plums: a dent above, sometimes a seam, sometimes a bite."""
    turn, high = _tilt(rng), span(rng, 0.75, 1.1)
    built.part(SKIN)
    outline = [
        [0.02, -0.75 * high],
        [0.3, -0.85 * high],
        [0.75, -0.6 * high],
        [1.05, 0.15 * high],
        [0.75, 0.8 * high],
        [0.3, 0.85 * high],
        [0.05, 0.5 * high],
        [0.0, 0.5 * high],
    ]
    built.lathe([0, 0, 0], profile(outline, 3), turn)
    if chance(rng, 0.25):
        built.ring(
            turn @ vec(0, 0, 0.05),
            1.0,
            0.1,
            1.3,
            turn @ turned(0, 0, np.pi / 2),
            cut=True,
            soft=0.15,
        )
    if chance(rng, 0.2):
        way = rng.normal(0, 1, 3)
        for shift in (-0.2, 0.2):
            at = 1.15 * way / np.linalg.norm(way) + [0, shift, 0]
            built.ellipsoid(turn @ at, np.full(3, 0.45), cut=True)
    _stem(rng, built, turn, 0.45 * high, 0.6, 0.05)


def _pear(rng: Rng, built: PrimitiveBuilder) -> None:
    """A belly and a neck."""
    turn, long = _tilt(rng), span(rng, 0.9, 1.5)
    built.part(SKIN)
    built.ellipsoid([0, 0, 0], [0.75, span(rng, 0.65, 0.8), 0.75], turn)
    top = turn @ vec(rng.normal(0, 0.12), long, 0)
    built.limb([0, 0, 0], top, 0.5, span(rng, 0.2, 0.38), soft=0.35)
    _stem(rng, built, turn, long + 0.2, 0.45, 0.05)


def _banana(rng: Rng, built: PrimitiveBuilder) -> None:
    """One, or several that hang together."""
    count, bow = pick(rng, (1, 1, 2, 3, 4)), span(rng, 0.2, 0.5)
    turn = _tilt(rng)
    for k in range(count):
        spin = turn @ turned(0.0, 0.28 * (k - 0.5 * count)) @ turned(rng.normal(0, 0.1))
        line = curve(
            [
                [-1, 0.1, 0.1 * k],
                [-0.5, -0.6 * bow, 0.18 * k],
                [0.4, -bow, 0.18 * k],
                [1.0, 0.3 * bow, 0.15 * k],
            ],
            7,
        )
        built.part(SKIN)
        for j, (near, far) in enumerate(
            ((0.07, 0.15), (0.15, 0.19), (0.19, 0.2), (0.2, 0.18), (0.18, 0.14), (0.14, 0.05))
        ):
            built.limb(spin @ line[j], spin @ line[j + 1], near, far, soft=0.03)
        built.part(MIDDLE)
        built.limb(spin @ line[0], spin @ vec(-1.2, 0.2, 0), 0.07, 0.06)


def _pumpkin(rng: Rng, built: PrimitiveBuilder) -> None:
    """Ribs around the middle; now and then with a face."""
    ribs, flat, wide = int(rng.integers(7, 12)), span(rng, 0.55, 1.1), span(rng, 0.55, 0.75)
    built.part(SKIN)
    built.ellipsoid([0, 0, 0], [0.9 * wide, 0.7 * flat, 0.9 * wide])
    for k in range(ribs):
        way = 2 * np.pi * k / ribs
        at = wide * vec(np.cos(way), 0, np.sin(way))
        turn = turned(-way)
        half = vec(0.55, flat * 0.8, 3.2 * wide / ribs + 0.06)
        built.ellipsoid(0.75 * at, half, turn, soft=0.06)
    if chance(rng, 0.3):
        for x, y, size in ((0.3, 0.2, 0.15), (-0.3, 0.2, 0.15), (0, -0.2, 0.25)):
            built.prism(
                [x, y, 1.0], np.array([[-size, -0.1], [size, -0.1], [0, 0.12]]), 0.7, 0, cut=True
            )
    _stem(rng, built, np.eye(3), 0.6 * flat, 0.5, 0.12)


def _grapes(rng: Rng, built: PrimitiveBuilder) -> None:
    """Balls around a stalk, fewer towards the end."""
    count, size = int(rng.integers(10, 22)), span(rng, 0.18, 0.24)
    turn = turned(0, span(rng, 0, 1.4))
    for k in range(count):
        built.part(SKIN)
        t = k / count
        out = 0.5 * (1 - t) * np.sqrt(rng.random())
        at = vec(out * np.cos(2.4 * k), -1.3 * t, out * np.sin(2.4 * k)) + rng.normal(0, 0.03, 3)
        built.ellipsoid(turn @ at, size * np.exp(rng.normal(0, 0.06, 3)))
    _stem(rng, built, turn, 0.1, 0.5, 0.04)


def _cherries(rng: Rng, built: PrimitiveBuilder) -> None:
    """One to three on their stalks."""
    top = vec(0, 1.2, 0)
    for k in range(pick(rng, (1, 2, 2, 3))):
        at = vec(0.45 * (k - 0.5), 0.3 * rng.random(), rng.normal(0, 0.2))
        built.part(SKIN)
        built.ellipsoid(at, 0.34 * np.exp(rng.normal(0, 0.06, 3)))
        built.part(GREEN)
        tube(built, curve([at + [0, 0.3, 0], 0.5 * (at + top) + [0.1, 0.1, 0], top], 5), 0.025)
    built.part(GREEN)
    built.ellipsoid(top + [0.25, 0, 0], [0.28, 0.03, 0.14], turned(0, 0, 0.3))


def _pineapple(rng: Rng, built: PrimitiveBuilder) -> None:
    """A barrel under a tuft."""
    built.part(SKIN)
    high = span(rng, 0.65, 0.9)
    built.superquadric([0, 0, 0], [0.5, high, 0.5], 0.75, 1.0)
    for k in range(9):
        built.part(GREEN)
        spin = turned(2.4 * k) @ turned(0, 0.25 + 0.09 * k)
        long = span(rng, 0.3, 0.5)
        built.ellipsoid(vec(0, high, 0) + spin @ vec(0, long, 0), [0.08, long, 0.03], spin)


def _slice(rng: Rng, built: PrimitiveBuilder) -> None:
    """Of a melon, an orange, a cake, a pizza."""
    half, turn = span(rng, 0.25, 0.8), _tilt(rng)
    wedge = 3 * np.array([[0, 0], [np.cos(half), -np.sin(half)], [np.cos(half), np.sin(half)]])
    flat = turn @ turned(0, np.pi / 2)
    kind = pick(rng, ("melon", "cake", "pizza"))
    high = 0.05 if kind == "pizza" else 0.35
    for part, size in ((SKIN, 1.0), (MIDDLE, 0.88)):
        built.part(part)
        if kind == "melon":
            built.ellipsoid([0, 0, 0], np.full(3, size) + 0.002 * part, turn)
            lean = wedge - [0.0 if part == SKIN else 0.012, 0]
            built.prism([0, 0, 0], lean, 2, 0, flat, keep=True)
        else:
            if part == SKIN:
                built.cylinder([0, 0, 0], 1.0, high, 0.02, turn)
            elif kind == "cake":
                built.cylinder(turn @ vec(0, high, 0), 1.02, 0.07, 0.03, turn)
            else:
                built.ring([0, 0, 0], 0.98, 0.09, turn=turn)
            built.prism([0, 0, 0], wedge, 2, 0, flat, keep=True)
    if kind != "melon":
        for k in range(rng.integers(1, 5)):
            built.part(MORE)
            far = span(rng, 0.4, 0.85)
            way = span(rng, -0.6, 0.6) * half
            at = vec(far * np.cos(way), high + 0.04, -far * np.sin(way))
            built.ellipsoid(
                turn @ at, np.full(3, span(rng, 0.06, 0.13)) * [1, 0.6 if k else 1, 1], turn
            )


def _strawberry(rng: Rng, built: PrimitiveBuilder) -> None:
    """A cone with a collar of leaves."""
    turn = _tilt(rng)
    built.part(SKIN)
    built.limb([0, 0, 0], turn @ vec(0, -span(rng, 0.6, 1.0), 0), 0.55, 0.18)
    for k in range(7):
        built.part(GREEN)
        spin = turn @ turned(0.9 * k) @ turned(0, span(rng, -0.2, 0.5))
        built.ellipsoid(turn @ vec(0, 0.5, 0) + spin @ vec(0, 0, 0.28), [0.1, 0.03, 0.28], spin)
    _stem(rng, built, turn, 0.5, 0.35, 0.04)


def _carrot(rng: Rng, built: PrimitiveBuilder) -> None:
    """Carrots, radishes, beets, with their greens."""
    turn, long = _tilt(rng) @ turned(0, pick(rng, (0.0, 1.4))), pick(rng, (0.3, 1.2, 1.8))
    built.part(SKIN)
    wide = span(rng, 0.25, 0.4)
    built.limb([0, 0, 0], turn @ vec(rng.normal(0, 0.1), -long, 0), wide, 0.05)
    built.limb(
        turn @ vec(0, -0.9 * long, 0), turn @ vec(0.05, -long - 0.3, 0), 0.05, 0.02, soft=0.04
    )
    for k in range(rng.integers(0, 6)):
        built.part(GREEN)
        spin = turn @ turned(2.4 * k) @ turned(0, span(rng, 0.05, 0.6))
        high = span(rng, 0.5, 1.0)
        built.limb(turn @ vec(0, 0.7 * wide, 0), spin @ vec(0, high, 0), 0.03, 0.025)
        built.ellipsoid(spin @ vec(0, high, 0), [0.13, 0.28, 0.03], spin)


def _aubergine(rng: Rng, built: PrimitiveBuilder) -> None:
    """Aubergines, cucumbers, courgettes."""
    turn = _tilt(rng) @ turned(0, 0, 1.5)
    near, far, long = span(rng, 0.25, 0.5), span(rng, 0.15, 0.3), span(rng, 0.9, 2.0)
    line = curve([[0, 0, 0], [0.15, 0.5 * long, 0], [0, long, 0]], 6) @ turn.T
    built.part(SKIN)
    tube(built, line, near, far)
    built.part(GREEN)
    built.ellipsoid(line[-1] + 0.5 * far * turn[:, 1], far * vec(1.02, 0.75, 1.02), turn)
    _stem(rng, built, turn, long + far, 0.3, 0.06)


def _pepper(rng: Rng, built: PrimitiveBuilder) -> None:
    """Three or four lobes."""
    lobes, turn, high = pick(rng, (3, 4)), _tilt(rng), span(rng, 0.5, 0.8)
    built.part(SKIN)
    for k in range(lobes):
        spin = turned(k * 2 * np.pi / lobes)
        at = spin @ vec(0, 0, 0.32)
        built.limb(
            turn @ (at + [0, 0.3, 0]), turn @ (0.6 * at - [0, high, 0]), 0.38, 0.24, soft=0.1
        )
    _stem(rng, built, turn, 0.5, 0.5, 0.09)


def _tomatoes(rng: Rng, built: PrimitiveBuilder) -> None:
    """One or several, with a star of leaves on each."""
    for k in range(pick(rng, (1, 1, 3, 4))):
        at = vec(0.9 * np.cos(2 * k), 0, 0.9 * np.sin(2 * k)) * (k > 0)
        size = span(rng, 0.4, 0.55)
        built.part(SKIN)
        built.ellipsoid(at + [0, 0.85 * size, 0], size * vec(1, span(rng, 0.75, 1.1), 1))
        built.part(GREEN)
        for j in range(5):
            spin = turned(1.2566 * j) @ turned(0, 0.15)
            built.ellipsoid(
                at + [0, 1.7 * size, 0] + spin @ vec(0, 0, 0.2), [0.05, 0.025, 0.2], spin
            )
        built.limb(at + [0, 1.65 * size, 0], at + [0.03, 1.65 * size + 0.2, 0], 0.035, 0.035)


def _cabbage(rng: Rng, built: PrimitiveBuilder) -> None:
    """A head with leaves around it."""
    built.part(SKIN)
    built.ellipsoid([0, 0.6, 0], [0.65, 0.6, 0.65])
    for k in range(rng.integers(5, 10)):
        built.part(GREEN)
        spin = turned(2.4 * k) @ turned(0, span(rng, -0.4, 0.1))
        size = span(rng, 0.4, 0.55)
        waves = (0.04, 5.0, 6.0, span(rng, 0, 6))
        built.sheet(
            spin @ vec(0, 0.55, 0.68), [size, size * 1.1], 0.018, waves, -span(rng, 0.6, 1.4), spin
        )


def _onion(rng: Rng, built: PrimitiveBuilder) -> None:
    """Onions, garlic, figs."""
    turn, neck = _tilt(rng), span(rng, 0.3, 0.8)
    outline = [[0.05, -0.6], [0.4, -0.6], [0.85, -0.1], [0.6, 0.4], [0.12, 0.6], [0.06, 0.6 + neck]]
    built.part(SKIN)
    built.lathe([0, 0, 0], profile(outline, 3), turn)
    built.part(MIDDLE)
    for k in range(6):
        root = turn @ vec(0.1 * np.cos(k), -0.55, 0.1 * np.sin(k))
        built.limb(root, root + turn @ vec(0.12 * np.cos(k), -0.2, 0.12 * np.sin(k)), 0.025, 0.018)


def _pod(rng: Rng, built: PrimitiveBuilder) -> None:
    """A pod with peas in it."""
    turn, long = _tilt(rng), span(rng, 0.9, 1.3)
    built.part(GREEN)
    built.ellipsoid([0, 0, 0], [long, 0.26, 0.24], turn)
    built.ellipsoid(turn @ vec(0, 0.1, 0), [0.93 * long, 0.26, 0.18], turn, cavity=True)
    count = int(rng.integers(3, 8))
    for k in range(count):
        built.part(SKIN)
        x = 0.75 * long * ((2 * k + 1) / count - 1)
        built.ellipsoid(turn @ vec(x, 0.02, 0), np.full(3, min(0.18, 0.8 * long / count)))


def _maize(rng: Rng, built: PrimitiveBuilder) -> None:
    """A cob in its leaves."""
    turn = _tilt(rng) @ turned(0, 0, span(rng, 0, 1.5))
    built.part(SKIN)
    built.limb([0, 0, 0], turn @ vec(0, 1.4, 0), 0.3, 0.14)
    for y in np.arange(0.1, 1.4, 0.13):
        built.ring(turn @ vec(0, y, 0), 0.28 - 0.1 * y, 0.045, turn=turn, soft=0.02)
    for k in range(rng.integers(2, 5)):
        built.part(GREEN)
        spin = turn @ turned(1.8 * k) @ turned(0, span(rng, 0.1, 0.6))
        built.sheet(
            spin @ vec(0, 0.45, 0.3), [0.28, 0.75], 0.016, (0.02, 3, 3, 0), -span(rng, 1, 2.5), spin
        )
