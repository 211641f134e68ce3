"""Things turned about an axis: cups, bottles, bowls, lamps, pots, plates, candles, chessmen."""

from __future__ import annotations

import numpy as np

from ..solid import PrimitiveBuilder, along, turned
from .hollow import handle, hollow, saucer
from .kitchen import cheese, plate, pot, teapot
from .making import Rng, chance, curve, pick, profile, span, tube, vec

BODY, LID, INSIDE, MORE = range(4)


def lathe(rng: Rng) -> PrimitiveBuilder:
    """Make a vessel or turned thing."""
    kinds = (
        _cup,
        _cup,
        _bottle,
        _bottle,
        _vase,
        _bowl,
        _can,
        _jar,
        _lamp,
        _glass,
        pot,
        teapot,
        plate,
        cheese,
        _candle,
        _chessman,
        _anything,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _cup(rng: Rng, built: PrimitiveBuilder) -> None:
    """Mugs, cups with a saucer, beakers, buckets."""
    low, high, top = span(rng, 0.3, 0.75), span(rng, 0.7, 1.6), span(rng, 0.5, 0.9)
    belly = span(rng, 0.9, 1.2) * 0.5 * (low + top)
    outside = np.array([[low, 0], [low, 0], [belly, 0.5 * high], [top, high], [top, high]])
    built.part(BODY)
    hollow(built, outside, span(rng, 0.05, 0.1), 0.1)
    if chance(rng, 0.75):
        built.part(pick(rng, (BODY, BODY, MORE)))
        a, b = span(rng, 0.15, 0.3) * high, span(rng, 0.7, 0.9) * high
        at = belly if chance(rng, 0.5) else 0.5 * (low + top)
        handle(rng, built, at, a, b, span(rng, 0.25, 0.5), span(rng, 0.05, 0.1))
    if chance(rng, 0.4):  # what is in it
        built.part(INSIDE)
        level = span(rng, 0.6, 0.88)
        built.cylinder(
            [0, 0.5 * level * high + 0.03, 0],
            0.9 * min(low, top, belly) - 0.02,
            0.5 * level * high - 0.04,
        )
    if chance(rng, 0.25):
        built.part(LID)
        saucer(rng, built, 1.5 * low + 0.25)


def _bottle(rng: Rng, built: PrimitiveBuilder) -> None:
    """From flasks to wine bottles; some have square bodies, labels and sprayers."""
    wide, body, neck = span(rng, 0.3, 0.55), span(rng, 0.6, 1.5), span(rng, 0.08, 0.16)
    slope, long = span(rng, 0.1, 0.5), span(rng, 0.1, 0.6)
    waist = span(rng, 0.75, 1.1) if chance(rng, 0.4) else 1.0
    top = body + slope + long
    outline = [
        [wide, 0],
        [wide, 0],
        [waist * wide, 0.5 * body],
        [wide, body],
        [neck, body + slope],
        [neck, body + slope],
        [neck, top],
        [neck, top],
    ]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, 3))
    if chance(rng, 0.25):
        built.box([0, 0.5 * top, 0], [0.82 * wide, top, 0.82 * wide], 0.1, keep=True, soft=0.05)
    if chance(rng, 0.3):
        built.part(MORE)
        built.cylinder([0, 0.5 * body, 0], 1.02 * wide, span(rng, 0.15, 0.35) * body, 0.01)
    built.part(LID)
    cap = span(rng, 0.08, 0.2)
    built.cylinder([0, top + 0.5 * cap - 0.04, 0], neck * span(rng, 1.02, 1.4), 0.5 * cap, 0.02)
    if chance(rng, 0.2):  # a sprayer, a pump
        built.limb([0, top + cap, 0], [0, top + cap + 0.2, 0], 0.05, 0.05)
        built.box([0.12, top + cap + 0.22, 0], [0.25, 0.06, 0.08], 0.03)
    if chance(rng, 0.2):
        built.part(BODY)
        handle(rng, built, 0.8 * wide, 0.5 * body, body + 0.6 * slope, 0.3, 0.06)


def _vase(rng: Rng, built: PrimitiveBuilder) -> None:
    """Hollow or not; some have two ears."""
    count = int(rng.integers(3, 6))
    y = np.sort(rng.uniform(0, 1, count)) * span(rng, 1, 1.8)
    outside = np.stack([rng.uniform(0.18, 0.65, count), y - y[0]], 1)
    outside = np.concatenate([outside[:1], outside, outside[-1:]])
    built.part(BODY)
    if chance(rng, 0.6):
        hollow(built, outside, 0.06, 0.1)
    else:
        built.lathe([0, 0, 0], profile(outside, 3))
    if chance(rng, 0.3):
        for sign in (1, -1):
            built.part(BODY)
            low, high = 0.55 * y[-1], 0.85 * y[-1]
            knots = np.array([[0.2, low, 0], [0.75, low, 0], [0.7, high, 0], [0.15, high, 0]])
            tube(built, curve(knots * [sign, 1, 1], 7), 0.05)


def _bowl(rng: Rng, built: PrimitiveBuilder) -> None:
    """A bowl, sometimes with fruit or eggs in it."""
    wide, high, foot = span(rng, 0.7, 1.1), span(rng, 0.3, 0.8), span(rng, 0.25, 0.6)
    outside = np.array(
        [[foot, 0], [foot, 0], [0.9 * wide, 0.35 * high], [wide, high], [wide, high]]
    )
    built.part(BODY)
    hollow(built, outside, span(rng, 0.05, 0.09), 0.08)
    if chance(rng, 0.45):
        for k in range(rng.integers(3, 8)):
            built.part(INSIDE + int(chance(rng, 0.4)))
            size = span(rng, 0.15, 0.3)
            way, far = 2.4 * k, 0.5 * wide * (k > 0)
            at = vec(far * np.cos(way), 0.5 * high + size * (0.9 if k else 1.4), far * np.sin(way))
            built.ellipsoid(at, size * np.exp(rng.normal(0, 0.1, 3)))


def _can(rng: Rng, built: PrimitiveBuilder) -> None:
    """A tin with rims, a drum, a pillbox."""
    wide, high = span(rng, 0.3, 0.7), span(rng, 0.25, 1.0)
    built.part(BODY)
    built.cylinder([0, high, 0], wide, high, span(rng, 0, 0.08))
    built.part(LID)
    for y in (0.02, 2 * high - 0.02):
        built.ring([0, y, 0], 0.98 * wide, span(rng, 0.02, 0.04))
    if chance(rng, 0.4):
        built.part(MORE)
        built.box([0.3 * wide, 2 * high + 0.02, 0], [0.3 * wide, 0.02, 0.12 * wide], 0.02)


def _jar(rng: Rng, built: PrimitiveBuilder) -> None:
    """With a lid and often a knob."""
    wide, high, neck = span(rng, 0.4, 0.6), span(rng, 0.6, 1.2), span(rng, 0.6, 0.9)
    outline = [
        [0.9 * wide, 0],
        [0.9 * wide, 0],
        [wide, 0.1],
        [wide, 0.8 * high],
        [neck * wide, 0.95 * high],
        [neck * wide, high],
    ]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, 1))
    built.part(LID)
    built.cylinder([0, high + 0.06, 0], 1.08 * neck * wide, 0.11, 0.03)
    if chance(rng, 0.4):
        built.part(MORE)
        built.ellipsoid([0, high + 0.24, 0], np.full(3, span(rng, 0.08, 0.14)))


def _lamp(rng: Rng, built: PrimitiveBuilder) -> None:
    """A table lamp with a shade open above and below."""
    high, foot = span(rng, 0.6, 1.6), span(rng, 0.25, 0.5)
    built.part(BODY)
    if chance(rng, 0.5):
        built.cylinder([0, 0.05, 0], foot, 0.05, 0.03)
        built.limb([0, 0.05, 0], [0, high + 0.3, 0], 0.05, 0.05, soft=0.08)
    else:
        outline = [
            [foot, 0],
            [foot, 0],
            [span(rng, 0.1, 0.5), 0.4 * high],
            [0.08, 0.8 * high],
            [0.05, high + 0.3],
        ]
        built.lathe([0, 0, 0], profile(outline, 3))
    low, top, tall = span(rng, 0.5, 0.9), span(rng, 0.2, 0.6), span(rng, 0.4, 0.8)
    built.part(LID)
    built.lathe([0, high, 0], profile([[low, 0], [top, tall]], 0))
    inner = profile(
        [[low - 0.01, -0.1], [low - 0.05, 0], [top - 0.05, tall], [top - 0.05, tall + 0.1]], 0
    )
    built.lathe([0, high, 0], inner, cavity=True)
    built.part(INSIDE)
    built.ellipsoid([0, high + 0.3, 0], [0.12, 0.15, 0.12])


def _glass(rng: Rng, built: PrimitiveBuilder) -> None:
    """A wine glass or a goblet."""
    wide, foot, stem = span(rng, 0.3, 0.5), span(rng, 0.25, 0.4), span(rng, 0.3, 0.7)
    cup, top = span(rng, 0.4, 0.8), span(rng, 0.7, 1.1)
    outline = [
        [foot, 0],
        [foot, 0.04],
        [0.06, 0.1],
        [0.05, stem],
        [0.15, stem + 0.05],
        [wide, stem + 0.4 * cup],
        [top * wide, stem + cup],
        [top * wide, stem + cup],
    ]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, 3))
    inside = [
        [0.08, stem + 0.12],
        [wide - 0.05, stem + 0.4 * cup],
        [top * wide - 0.05, stem + cup],
        [top * wide - 0.05, stem + cup + 0.1],
    ]
    built.lathe([0, 0, 0], profile(inside, 1), cavity=True)


def _candle(rng: Rng, built: PrimitiveBuilder) -> None:
    """A candle on a stick."""
    foot, stick, wax = span(rng, 0.25, 0.5), span(rng, 0.1, 1.0), span(rng, 0.3, 0.9)
    thick = span(rng, 0.07, 0.2)
    outline = [
        [foot, 0],
        [foot, 0.05],
        [0.08, 0.12],
        [span(rng, 0.06, 0.2), 0.5 * stick + 0.1],
        [0.08, stick],
        [thick + 0.08, stick + 0.12],
        [thick + 0.08, stick + 0.16],
    ]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, 3))
    built.part(LID)
    built.cylinder([0, stick + 0.15 + 0.5 * wax, 0], thick, 0.5 * wax, 0.03)
    built.part(MORE)
    built.limb([0, stick + wax, 0], [0.02, stick + wax + 0.25, 0], 0.02, 0.016)


def _chessman(rng: Rng, built: PrimitiveBuilder) -> None:
    """A pawn, a rook, a bishop, a king or a queen."""
    high = span(rng, 0.7, 1.5)
    base, waist, collar = span(rng, 0.35, 0.5), span(rng, 0.12, 0.2), span(rng, 0.2, 0.3)
    outline = [
        [base, 0],
        [base, 0.1],
        [0.8 * base, 0.16],
        [0.75 * base, 0.24],
        [waist, 0.4 * high],
        [waist, 0.8 * high],
        [collar, 0.86 * high],
        [collar, 0.9 * high],
        [0.1, high],
    ]
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, 1))
    kind = pick(rng, ("pawn", "rook", "bishop", "king", "queen"))
    if kind == "rook":
        built.cylinder([0, high + 0.08, 0], 0.27, 0.16, 0.01)
        built.cylinder([0, high + 0.25, 0], 0.19, 0.1, cut=True)
        for k in range(3):
            built.box([0, high + 0.22, 0], [0.5, 0.07, 0.05], 0, turned(k * np.pi / 3), cut=True)
        return
    size = span(rng, 0.2, 0.28)
    tall = 1.3 if kind == "bishop" else 1.0
    built.ellipsoid([0, high + size * tall, 0], [size, tall * size, size], soft=0.04)
    if kind == "bishop":
        built.box([0.15, high + 0.4, 0], [0.3, 0.03, 0.5], 0, turned(0, 0, 0.7), cut=True)
    if kind == "king":
        built.box([0, high + 2.3 * size, 0], [0.05, 0.2, 0.05], 0.02)
        built.box([0, high + 2.4 * size, 0], [0.14, 0.05, 0.05], 0.02)
    if kind == "queen":
        for k in range(6):
            way = k * np.pi / 3
            built.ellipsoid(
                [0.7 * size * np.cos(way), high + 1.9 * size, 0.7 * size * np.sin(way)],
                np.full(3, 0.07),
                soft=0.03,
            )


def _anything(rng: Rng, built: PrimitiveBuilder) -> None:
    """A turned thing without a name, leaning or lying."""
    count = int(rng.integers(4, 9))
    y = np.cumsum(rng.uniform(0.05, 0.4, count))
    outline = np.stack([rng.uniform(0.06, 0.6, count), y], 1)
    turn = along(rng.normal(size=3)) if chance(rng, 0.5) else np.eye(3)
    built.part(BODY)
    built.lathe([0, 0, 0], profile(outline, pick(rng, (0, 1, 3))), turn)
