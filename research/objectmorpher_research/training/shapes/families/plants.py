"""Plants: flowers, potted plants, leaves, mushrooms, cacti, trees."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, along, turned
from .fruit import fruit, vegetable
from .making import Rng, chance, curve, pick, profile, smooth, span, tube, vec

GREEN, PETAL, MIDDLE, POT, MORE = range(5)


def plants(rng: Rng) -> PrimitiveBuilder:
    """Make a plant."""
    kinds = (
        _flower,
        _flower,
        _bouquet,
        _potted,
        _potted,
        _leaf,
        _leaf,
        _mushroom,
        _cactus,
        _tree,
        _tree,
        _fir,
        _palm,
        fruit,
        fruit,
        fruit,
        vegetable,
        vegetable,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _bloom(rng: Rng, built: PrimitiveBuilder, at: F64, face: F64, size: float) -> None:
    """A flower's head that looks along `face`: a disc with petals, a tulip's cup, or a ball."""
    axes = along(face) @ turned(span(rng, 0, 6))
    kind = pick(rng, ("daisy", "daisy", "sheets", "cup", "rose", "ball"))
    if kind == "ball":
        built.part(PETAL)
        built.ellipsoid(at, size * vec(0.6, 0.55, 0.6), axes)
        return
    if kind == "cup":
        built.part(PETAL)
        outline = np.array([[0.1, -0.3], [0.5, -0.1], [0.6, 0.4], [0.42, 0.9], [0.42, 0.9]]) * size
        built.lathe(at, profile(outline, 3), axes)
        inside = outline[1:] - vec(0.09 * size, 0)
        top = inside[-1:] + vec(0, 0.5 * size)
        built.lathe(at, profile(np.concatenate([inside, top]), 1), axes, cavity=True)
        for k in range(3):
            spin = axes @ turned(2.094 * k)
            built.ellipsoid(
                at + spin @ vec(0, 0.9 * size, 0.66 * size),
                size * vec(0.22, 0.25, 0.3),
                spin,
                cut=True,
            )
        return
    rows = 2 if kind == "rose" or chance(rng, 0.3) else 1
    for row in range(rows):
        count = int(rng.integers(4, 8))
        lift = span(rng, -0.1, 0.6) + 0.5 * row
        long = size * span(rng, 0.45, 0.6) * (1 - 0.25 * row)
        wide = long * min(span(rng, 0.35, 0.8), 2.6 / count + 0.15)
        for k in range(count):
            built.part(PETAL)
            spin = axes @ turned((k + 0.5 * row) * 2 * np.pi / count) @ turned(0, -lift)
            middle = at + spin @ vec(0, 0, long + 0.15 * size)
            if kind == "sheets":
                flat = spin @ turned(0, np.pi / 2)
                waves = (0.08 * size * rng.random(), 2 / size, 4 / size, span(rng, 0, 6))
                built.sheet(
                    middle, [wide, long], 0.02 * size, waves, rng.normal(0, 0.8) / size, flat
                )
            else:
                built.ellipsoid(middle, [wide, 0.07 * size, long], spin)
    built.part(MIDDLE)
    built.ellipsoid(at + 0.05 * size * face, size * vec(0.32, 0.16, 0.32), axes)


def _stalk(
    rng: Rng, built: PrimitiveBuilder, foot: F64, top: F64, thick: float, leaves: int
) -> F64:
    """From the foot to the top, with leaves; returns the direction of its end."""
    bow = rng.normal(0, 0.12, 3) * [1, 0, 1]
    line = curve([foot, 0.5 * (foot + top) + bow, top], 6)
    built.part(GREEN)
    tube(built, line, thick, 0.7 * thick)
    for _ in range(leaves):
        _blade(rng, built, line[int(rng.integers(1, 4))], span(rng, 0, 6.3), span(rng, 0.2, 0.45))
    end = line[-1] - line[-2]
    return end / np.linalg.norm(end)


def _blade(rng: Rng, built: PrimitiveBuilder, root: F64, yaw: float, long: float) -> None:
    """A leaf that leaves the stalk upwards and hangs over."""
    built.part(GREEN)
    spin = turned(yaw) @ turned(0, -span(rng, 0.1, 1.1))
    wide = long * span(rng, 0.2, 0.5)
    if chance(rng, 0.5):
        built.ellipsoid(root + spin @ vec(0, 0, 0.95 * long), [wide, 0.02, long], spin)
    else:
        flat = spin @ turned(0, np.pi / 2)
        waves = (span(rng, 0, 0.05), 0.0, 3 / long, span(rng, 0, 6))
        built.sheet(
            root + spin @ vec(0, 0, 0.95 * long),
            [wide, long],
            0.012,
            waves,
            rng.normal(0, 1.0),
            flat,
        )


def _flower(rng: Rng, built: PrimitiveBuilder) -> None:
    """One flower on its stalk."""
    high = span(rng, 0.5, 2.0)
    top = vec(rng.normal(0, 0.15), high, rng.normal(0, 0.15))
    way = _stalk(rng, built, vec(0, 0, 0), top, span(rng, 0.03, 0.06), int(rng.integers(0, 5)))
    face = way + rng.normal(0, 0.4, 3)
    _bloom(rng, built, top, face / np.linalg.norm(face), span(rng, 0.4, 0.7))


def _bouquet(rng: Rng, built: PrimitiveBuilder) -> None:
    """Some flowers, in a vase or without."""
    in_vase = chance(rng, 0.6)
    count = int(rng.integers(2, 5))
    for k in range(count):
        way = 2.4 * k + rng.normal(0, 0.2)
        out = span(rng, 0.2, 0.5) if k else 0.0
        top = vec(out * np.cos(way), span(rng, 1.1, 1.5), out * np.sin(way))
        face = top - vec(0, 0.7, 0)
        built.part(GREEN)
        tube(built, np.array([[0, 0.1, 0], top]), 0.03)
        _bloom(rng, built, top, face / np.linalg.norm(face), span(rng, 0.28, 0.4))
    if in_vase:
        built.part(POT)
        wide = span(rng, 0.2, 0.35)
        outline = [
            [0.7 * wide, 0],
            [0.7 * wide, 0],
            [wide, 0.3],
            [0.55 * wide, 0.65],
            [0.7 * wide, 0.8],
        ]
        built.lathe([0, 0, 0], profile(outline, 3))


def _potted(rng: Rng, built: PrimitiveBuilder) -> None:
    """A pot with earth and a bush, blades, a flower, a cactus or a little tree."""
    wide, high = span(rng, 0.3, 0.5), span(rng, 0.35, 0.7)
    built.part(POT)
    if chance(rng, 0.75):
        foot = wide * span(rng, 0.55, 0.95)
        built.lathe([0, 0, 0], profile([[foot, 0], [wide, high]], 0))
        built.cylinder([0, high, 0], 0.87 * wide, 0.12, cavity=True)
        if chance(rng, 0.6):
            built.ring([0, high, 0], wide, 0.05)
    else:
        built.box([0, 0.5 * high, 0], [wide, 0.5 * high, wide], 0.02)
        built.box([0, high, 0], [0.87 * wide, 0.12, 0.87 * wide], cavity=True)
    built.part(MORE)
    built.cylinder([0, high - 0.15, 0], 0.86 * wide, 0.08)
    kind = pick(rng, ("bush", "blades", "blades", "flower", "cactus", "tree"))
    if kind == "bush":
        for _ in range(rng.integers(4, 10)):
            built.part(GREEN)
            at = vec(*rng.normal(0, 0.6 * wide, 3)) * [1, 0.8, 1] + [0, high + 0.35, 0]
            built.ellipsoid(at, span(rng, 0.18, 0.36) * np.exp(rng.normal(0, 0.15, 3)))
    elif kind == "blades":
        for k in range(rng.integers(5, 12)):
            _blade(rng, built, vec(0, high - 0.05, 0), 2.4 * k, span(rng, 0.3, 0.7))
    elif kind == "cactus":
        _arms(rng, built, vec(0, high - 0.1, 0), span(rng, 0.5, 1.1))
    elif kind == "flower":
        top = vec(rng.normal(0, 0.1), high + span(rng, 0.4, 1.0), rng.normal(0, 0.1))
        way = _stalk(rng, built, vec(0, high - 0.1, 0), top, 0.03, int(rng.integers(1, 5)))
        face = way + rng.normal(0, 0.4, 3)
        _bloom(rng, built, top, face / np.linalg.norm(face), span(rng, 0.3, 0.5))
    else:
        built.part(MIDDLE)
        top = high + span(rng, 0.3, 0.8)
        built.limb([0, high - 0.1, 0], [0, top, 0], 0.05, 0.04)
        built.part(GREEN)
        built.ellipsoid([0, top + 0.25, 0], np.full(3, span(rng, 0.3, 0.45)))


def _leaf(rng: Rng, built: PrimitiveBuilder) -> None:
    """One leaf: oval, pointed, lobed; bent and waved."""
    turn = turned(span(rng, 0, 6), span(rng, -1.5, 0.2), rng.normal(0, 0.4))
    kind = pick(rng, ("oval", "point", "lobed"))
    built.part(GREEN)
    wide = span(rng, 0.35, 0.75)
    waves = (span(rng, 0, 0.07), span(rng, 0, 5), span(rng, 2, 6), span(rng, 0, 6))
    built.sheet([0, 0, 0], [wide, 1.0], span(rng, 0.012, 0.03), waves, rng.normal(0, 0.6), turn)
    if kind != "oval":
        t = np.linspace(0, 1, 12)
        half = wide * np.sin(np.pi * t ** span(rng, 0.6, 1.0)) * 0.95
        if kind == "lobed":
            half *= 1 - span(rng, 0.2, 0.4) * (np.arange(12) % 3 == 2)
        side = np.stack([half, 1.9 * t - 0.95], 1)
        outline = smooth(np.concatenate([side, side[::-1][1:-1] * [-1, 1]]), 1)
        built.prism([0, 0, 0], outline, 1.0, 0, turn, keep=True)
    built.part(MIDDLE)
    tube(
        built, curve([[0, -0.9, 0], [0, -1.15, 0.03], [0.05, -1.5, -0.1]], 5) @ turn.T, 0.03, 0.025
    )


def _mushroom(rng: Rng, built: PrimitiveBuilder) -> None:
    """One to three of them."""
    for k in range(pick(rng, (1, 1, 2, 3))):
        size = span(rng, 0.5, 1.0) if k else 1.0
        foot = vec(0.8 * k, 0, rng.normal(0, 0.25)) * (1 if k < 2 else -0.9)
        lean = turned(0, *rng.normal(0, 0.12, 2))
        stalk, high = size * span(rng, 0.12, 0.28), size * span(rng, 0.4, 1.0)
        built.part(MIDDLE)
        top = foot + lean @ vec(0, high, 0)
        built.limb(foot + [0, 0.8 * stalk, 0], top, stalk * span(rng, 1, 1.5), 0.8 * stalk)
        cap, dome = size * span(rng, 0.4, 0.75), size * span(rng, 0.25, 0.6)
        built.part(PETAL)
        outline = [
            [0.15, -0.1 * dome],
            [cap, -0.15 * dome],
            [cap, 0.1 * dome],
            [0.7 * cap, 0.75 * dome],
            [0.03, dome],
        ]
        built.lathe(top, profile(outline, 3), lean)
        if chance(rng, 0.5):
            for j in range(7):
                built.part(MORE)
                way, up = 2.4 * j, span(rng, 0.1, 0.75)
                r = 0.93 * cap * np.sqrt(1 - up**2)
                at = top + lean @ vec(r * np.cos(way), 0.8 * up * dome, r * np.sin(way))
                built.ellipsoid(at, np.full(3, size * span(rng, 0.04, 0.09)))


def _arms(rng: Rng, built: PrimitiveBuilder, foot: F64, high: float) -> None:
    """A cactus: a column with arms, a barrel, or pads on pads."""
    kind = pick(rng, ("column", "column", "barrel", "pads"))
    thick = high * span(rng, 0.13, 0.2)
    built.part(GREEN)
    if kind == "barrel":
        ribs = int(rng.integers(7, 13))
        for k in range(ribs):
            spin = turned(2 * np.pi * k / ribs)
            half = high * vec(0.95 / ribs + 0.02, 0.4, 0.25)
            built.ellipsoid(
                foot + [0, 0.36 * high, 0] + spin @ (high * vec(0, 0, 0.18)),
                half,
                spin,
                soft=0.04 * high,
            )
    elif kind == "pads":
        at, size = foot + [0, 0.3 * high, 0], 0.3 * high
        built.ellipsoid(at, size * vec(0.75, 1, 0.25))
        for k in range(3):
            way = span(rng, -0.9, 0.9)
            tip = at + 1.7 * size * vec(np.sin(way), np.cos(way), 0.1 * (k - 1))
            built.part(GREEN)
            built.ellipsoid(
                tip, 0.8 * size * vec(0.75, 1, 0.25), turned(span(rng, -0.5, 0.5), 0, -way)
            )
    else:
        built.limb(foot, foot + [0, high, 0], thick, 0.85 * thick)
        for _ in range(rng.integers(0, 4)):
            spin = turned(span(rng, 0, 6.3))
            low, out, up = (
                span(rng, 0.3, 0.6) * high,
                span(rng, 2, 3) * thick,
                span(rng, 0.2, 0.5) * high,
            )
            knots = [[0, low, 0], [0, low, out], [0, low + up, out]]
            built.part(GREEN)
            tube(built, foot + curve(knots, 6) @ spin.T, 0.75 * thick, 0.65 * thick)
    if chance(rng, 0.3):
        built.part(PETAL)
        top = foot + [0, (0.78 if kind == "barrel" else 1.1) * high, 0]
        built.ellipsoid(top, high * vec(0.1, 0.1, 0.1))


def _cactus(rng: Rng, built: PrimitiveBuilder) -> None:
    """Without a pot."""
    _arms(rng, built, vec(0, 0, 0), 1.0)


def _tree(rng: Rng, built: PrimitiveBuilder) -> None:
    """A trunk with boughs and a crown of balls."""
    high, thick = span(rng, 0.4, 1.0), span(rng, 0.06, 0.14)
    built.part(MIDDLE)
    top = vec(rng.normal(0, 0.08), high, rng.normal(0, 0.08))
    built.limb([0, 0, 0], top, 1.2 * thick, thick)
    count = int(rng.integers(1, 9))
    soft, wide = span(rng, 0, 0.15), span(rng, 0.25, 0.5)
    for k in range(count):
        way, out = 2.4 * k, span(rng, 0.3, 0.6) * (count > 1)
        at = top + vec(out * np.cos(way), span(rng, 0.1, 0.7), out * np.sin(way))
        if k < 4:
            built.part(MIDDLE)
            built.limb(top - [0, 0.05, 0], at, 0.7 * thick, 0.3 * thick)
        if k == 0 or soft < 0.05:
            built.part(GREEN)
        crown = wide * np.exp(rng.normal(0, 0.2, 3)) * (1.0 if count > 1 else 1.5)
        built.part(GREEN)
        built.ellipsoid(at, crown, soft=soft)
    if chance(rng, 0.3):
        for _ in range(5):
            built.part(PETAL)
            built.ellipsoid(top + [0, 0.4, 0] + rng.normal(0, 0.35, 3), np.full(3, 0.07))


def _fir(rng: Rng, built: PrimitiveBuilder) -> None:
    """Cones on a trunk; sometimes with balls on them."""
    storeys = int(rng.integers(1, 5))
    built.part(MIDDLE)
    built.limb([0, 0.05, 0], [0, 0.5, 0], 0.1, 0.09)
    y, wide = 0.3, span(rng, 0.45, 0.8)
    for _ in range(storeys):
        high = span(rng, 0.4, 0.7) * (2.0 if storeys == 1 else 1.0)
        built.part(GREEN)
        built.lathe(
            [0, y, 0],
            profile([[0.9 * wide, 0], [wide, 0.03], [0.5 * wide, 0.5 * high], [0.04, high]], 1),
        )
        y += 0.6 * high
        wide *= 0.72
    if chance(rng, 0.4):
        for k in range(8):
            built.part(PETAL + k % 2)
            t = span(rng, 0.05, 0.8)
            r = 0.75 * (1 - t) * 0.75
            built.ellipsoid(
                [r * np.cos(2.4 * k), 0.35 + t * (y - 0.2), r * np.sin(2.4 * k)], np.full(3, 0.07)
            )


def _palm(rng: Rng, built: PrimitiveBuilder) -> None:
    """A bent trunk with fronds."""
    high = span(rng, 0.8, 1.5)
    top = vec(span(rng, -0.4, 0.4), high, span(rng, -0.2, 0.2))
    built.part(MIDDLE)
    tube(built, curve([vec(0, 0, 0), 0.5 * top + [0.12, 0, 0], top], 6), 0.1, 0.07)
    for k in range(rng.integers(5, 9)):
        built.part(GREEN)
        spin, hang = turned(2.4 * k), span(rng, 0.1, 0.5)
        line = [[0, 0, 0], [0, 0.2, 0.3], [0, 0.2 - 0.3 * hang, 0.65], [0, -hang, 0.9]]
        path = top + curve(line, 5) @ spin.T
        for a, b, wide in zip(path[:-1], path[1:], (0.08, 0.13, 0.13, 0.07), strict=True):
            long = float(np.linalg.norm(b - a))
            way = np.asarray((b - a) / long, np.float64)
            axes = np.column_stack([spin[:, 0], np.cross(way, spin[:, 0]), way]).astype(np.float64)
            built.ellipsoid(0.5 * (a + b), [wide, 0.03, 0.62 * long], axes, soft=0.03)
    for k in range(rng.integers(0, 4)):
        built.part(POT)
        built.ellipsoid(top + 0.1 * vec(np.cos(2 * k), -1, np.sin(2 * k)), np.full(3, 0.09))
