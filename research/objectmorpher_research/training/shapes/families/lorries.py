"""Lorries, buses and trains."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, pick, rounded, smooth, span, vec
from .wheels import lights, wheels

BODY, GLASS, TYRE, METAL, MORE, SEAT = range(6)


def truck(rng: Rng, built: PrimitiveBuilder) -> None:
    """A cab, and behind it a box, a bed, a tank or a mixer's drum; fire engines with ladders."""
    wheel, wide, long = span(rng, 0.14, 0.2), span(rng, 0.32, 0.42), span(rng, 1.0, 1.4)
    deck, cab = 1.5 * wheel, span(rng, 0.5, 0.8)
    built.part(METAL)
    built.box([0, deck - 0.04, 0], [long, 0.06, 0.8 * wide])
    x, half = long - 0.3, span(rng, 0.22, 0.3)
    built.part(BODY)
    slope = span(rng, 0, 0.15)
    outline = np.array(
        [[-half, 0], [half, 0], [half, 0.45 * cab], [half - slope, cab], [-half, cab]]
    )
    built.prism([x, deck, 0], smooth(outline, 1), wide, 0.04)
    if chance(rng, 0.4):  # a bonnet
        built.box(
            [x + half + 0.15, deck + 0.2 * cab, 0],
            [0.2, 0.2 * cab + 0.02, 0.8 * wide],
            0.05,
            soft=0.03,
        )
    built.part(GLASS)
    built.box(
        [x + half - 0.5 * slope, deck + 0.72 * cab, 0],
        [0.045, 0.17 * cab, 0.85 * wide],
        0.01,
        turned(0, 0, np.arctan2(slope, 0.55 * cab)),
    )
    built.box([x - 0.02, deck + 0.7 * cab, 0], [0.6 * half, 0.16 * cab, wide + 0.01], 0.01)
    rear, high = long - 0.35 - half, span(rng, 0.5, 0.95)
    middle = vec(x - half - rear + 0.02, deck, 0)
    _load(rng, built, middle, vec(rear, high, wide))
    lights(rng, built, long, deck + 0.1, wide)
    xs = (x + 0.1, -0.35 * long, -0.7 * long) if chance(rng, 0.5) else (x + 0.1, -0.6 * long)
    wheels(rng, built, xs, wheel, wide)


def _load(rng: Rng, built: PrimitiveBuilder, middle: F64, size: F64) -> None:
    """What stands on the deck at `middle`; `size`: half its length, height, half its width."""
    rear, high, wide = size
    load = pick(rng, ("box", "bed", "tank", "mixer", "ladder", "logs"))
    built.part(MORE)
    if load in ("box", "ladder"):
        tall = high if load == "box" else 0.4
        built.box(middle + [0, 0.5 * tall, 0], [rear, 0.5 * tall, 1.02 * wide], 0.02)
    elif load == "bed":
        built.box(middle + [0, 0.18, 0], [rear, 0.2, wide], 0.01)
        built.box(middle + [0, 0.3, 0], [rear - 0.04, 0.25, wide - 0.04], cut=True)
        if chance(rng, 0.6):
            built.part(SEAT)
            built.ellipsoid(middle + [0, 0.15, 0], [0.85 * rear, span(rng, 0.15, 0.4), 0.85 * wide])
    elif load == "tank":
        built.cylinder(middle + [0, 0.95 * wide, 0], wide, rear, 0.1, turned(0, 0, np.pi / 2))
    elif load == "mixer":
        built.limb(middle + [0.5 * rear, 0.35, 0], middle + [-0.7 * rear, 0.6, 0], 0.36, 0.2)
    else:
        for k in range(5):
            at = middle + [0, 0.1 + 0.19 * (k // 3), (k % 3 - 1 + 0.5 * (k // 3)) * 0.2]
            built.cylinder(at, 0.1, 0.95 * rear, 0.01, turned(0, 0, np.pi / 2))
    if load == "ladder":
        built.part(METAL)
        built.limb(middle + [-0.6 * rear, 0.3, 0], middle + [-0.6 * rear, 0.52, 0], 0.1, 0.1)
        for sign in (1, -1):
            built.limb(
                middle + [-rear, 0.5, 0.12 * sign],
                middle + [rear + 0.3, 0.75, 0.12 * sign],
                0.03,
                0.03,
            )


def bus(rng: Rng, built: PrimitiveBuilder) -> None:
    """Make a bus with one or two storeys."""
    wheel, wide, long = span(rng, 0.13, 0.18), span(rng, 0.28, 0.36), span(rng, 0.8, 1.4)
    storeys = pick(rng, (1, 1, 1, 2))
    high = 0.6 * span(rng, 0.9, 1.2) * (1 + 0.7 * (storeys - 1))
    sill = 0.7 * wheel
    built.part(BODY)
    built.prism(
        [0, sill + 0.5 * high, 0],
        rounded(long, 0.5 * high, span(rng, 0.04, 0.2), 5),
        wide,
        span(rng, 0.03, 0.1),
    )
    built.part(GLASS)
    for storey in range(storeys):
        y = sill + high * ((storey + 0.68) / storeys if storeys == 1 else (storey + 0.6) / storeys)
        tall = 0.17 * high / storeys
        panes = int(rng.integers(3, 7))
        for k in range(panes):
            x = long * ((2 * k + 1) / panes - 1)
            built.box([0.95 * x, y, 0], [0.8 * long / panes, tall, wide + 0.012], 0.01)
        built.box([long - 0.02, y, 0], [0.04, 1.15 * tall, 0.8 * wide], 0.01)
    lights(rng, built, long, sill + 0.12, wide)
    wheels(rng, built, (-0.6 * long, 0.62 * long), wheel, wide)


def train(rng: Rng, built: PrimitiveBuilder) -> None:
    """A steam engine, or an electric one, with or without a wagon."""
    wide, wheel = span(rng, 0.28, 0.36), span(rng, 0.13, 0.2)
    deck = 1.6 * wheel
    built.part(METAL)
    built.box([0, deck, 0], [1.0, 0.06, wide])
    if chance(rng, 0.65):
        built.part(BODY)
        boiler = span(rng, 0.2, 0.28)
        built.cylinder([0.3, deck + boiler, 0], boiler, 0.68, 0.04, turned(0, 0, np.pi / 2))
        built.part(MORE)
        built.box([-0.65, deck + 0.4, 0], [0.3, 0.4, wide], 0.02)
        built.box([-0.65, deck + 0.55, 0], [0.18, 0.13, 2], cut=True)
        built.box([-0.65, deck + 0.83, 0], [0.38, 0.03, 1.15 * wide], 0.02)
        built.part(METAL)
        for x, r, high in ((0.8, 0.08, 0.4), (0.4, 0.11, 0.15), (0.05, 0.09, 0.18)):
            built.limb(
                [x, deck + 1.7 * boiler, 0],
                [x, deck + 2 * boiler + high, 0],
                r,
                r * span(rng, 0.8, 1.5),
            )
    else:
        built.part(BODY)
        high, nose = span(rng, 0.55, 0.7), span(rng, 0.05, 0.4)
        outline = [[-1, 0], [1, 0], [1, 0.35 * high], [1 - nose, high], [-1, high]]
        built.prism([0, deck, 0], smooth(outline, 1), wide, 0.06)
        built.part(GLASS)
        for k in range(5):
            built.box(
                [-0.8 + 0.33 * k, deck + 0.65 * high, 0], [0.12, 0.13 * high, wide + 0.01], 0.01
            )
    wheels(rng, built, (-0.75, -0.4, 0.1, 0.5, 0.8)[: pick(rng, (4, 5))], wheel, 0.9 * wide)
