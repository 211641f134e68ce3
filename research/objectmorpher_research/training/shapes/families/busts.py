"""Heads with shoulders, heads alone, masks, hands."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, curve, pick, profile, span, tube, vec

SKIN, HAIR, CLOTH, EYE, MORE = range(5)


def busts(rng: Rng) -> PrimitiveBuilder:
    """Make a bust, head or hand that looks along +z."""
    built = PrimitiveBuilder()
    kind = rng.random()
    if kind < 0.25:
        _hand(rng, built)
        return built
    tilt = turned(rng.normal(0, 0.35), rng.normal(0, 0.2), rng.normal(0, 0.12))
    _head(rng, built, tilt)
    if kind < 0.85:
        _shoulders(rng, built)
    return built


def _head(rng: Rng, built: PrimitiveBuilder, tilt: F64) -> None:
    """About the origin; the skull's radius is about 0.8."""
    wide, deep = span(rng, 0.66, 0.82), span(rng, 0.78, 0.92)
    built.part(SKIN)
    built.ellipsoid(tilt @ vec(0, 0.15, -0.08), [wide, 0.82, deep], tilt)
    jaw = span(rng, 0.4, 0.62)
    built.ellipsoid(tilt @ vec(0, -0.45, 0.18), [jaw, 0.52, 0.58], tilt, soft=0.35)
    chin = span(rng, 0.12, 0.24)
    built.ellipsoid(tilt @ vec(0, -0.86, 0.5), np.full(3, chin), tilt, soft=0.2)
    for sign in (1, -1):  # cheeks and brows
        built.ellipsoid(tilt @ vec(0.36 * sign, -0.25, 0.52), [0.2, 0.18, 0.18], tilt, soft=0.15)
        built.ellipsoid(tilt @ vec(0.28 * sign, 0.22, 0.68), [0.24, 0.07, 0.1], tilt, soft=0.1)
    _face(rng, built, tilt)
    for sign in (1, -1):
        built.part(SKIN)
        size = span(rng, 0.18, 0.28)
        turn = tilt @ turned(-sign * 0.5)
        at = tilt @ vec(sign * wide * 0.98, -0.08, -0.1)
        built.ellipsoid(at, [0.07, 1.3 * size, size], turn)
        built.ellipsoid(
            at + turn @ vec(0.06 * sign, 0.03, 0.05),
            [0.05, 0.8 * size, 0.6 * size],
            turn,
            cut=True,
            soft=0.04,
        )
    _hair(rng, built, tilt, wide)


def _face(rng: Rng, built: PrimitiveBuilder, tilt: F64) -> None:
    """Nose and sockets (the same skin), eyes, mouth; spectacles for some."""
    long, out, nose = span(rng, 0.25, 0.45), span(rng, 0.95, 1.15), span(rng, 0.1, 0.18)
    tip = vec(0, 0.1 - long, out)
    built.limb(tilt @ vec(0, 0.15, 0.72), tilt @ tip, 0.07, nose, soft=0.08)
    for sign in (1, -1):
        built.ellipsoid(
            tilt @ (tip + [0.1 * sign, -0.02, -0.1]), np.full(3, 0.65 * nose), soft=0.05
        )
    apart, deep = span(rng, 0.25, 0.33), span(rng, 0.0, 0.08)
    for sign in (1, -1):
        built.ellipsoid(
            tilt @ vec(apart * sign, 0.05, 0.86), [0.17, 0.1, 0.12], tilt, cut=True, soft=0.1
        )
    kind = pick(rng, ("lips", "lips", "open", "none"))
    mouth = vec(0, -0.55, 0.76)
    if kind == "open":
        built.ellipsoid(
            tilt @ (mouth + [0, 0, 0.04]),
            [0.22, span(rng, 0.05, 0.15), 0.2],
            tilt,
            cut=True,
            soft=0.04,
        )
    for sign in (1, -1):
        built.part(EYE)
        built.ellipsoid(tilt @ vec(apart * sign, 0.05, 0.66 - deep), np.full(3, 0.145))
        if chance(rng, 0.5):
            built.part(SKIN)  # a lid
            built.ellipsoid(tilt @ vec(apart * sign, 0.1, 0.66 - deep), [0.16, 0.12, 0.155], tilt)
    if kind == "lips":
        built.part(pick(rng, (SKIN, MORE)))
        half = span(rng, 0.16, 0.26)
        for y in (0.04, -0.05):
            built.ellipsoid(tilt @ (mouth + [0, y, 0]), [half, 0.055, 0.09], tilt, soft=0.02)
    if chance(rng, 0.2):
        for sign in (1, -1):
            built.part(MORE)
            built.ring(
                tilt @ vec(apart * sign, 0.05, 0.92), 0.24, 0.03, turn=tilt @ turned(0, np.pi / 2)
            )
            built.limb(
                tilt @ vec(0.5 * sign, 0.07, 0.9), tilt @ vec(0.8 * sign, 0.05, 0), 0.03, 0.03
            )
        built.limb(tilt @ vec(-0.08, 0.07, 0.95), tilt @ vec(0.08, 0.07, 0.95), 0.03, 0.03)


def _hair(rng: Rng, built: PrimitiveBuilder, tilt: F64, wide: float) -> None:
    """Short, long, curly, a knot, a hat, a beard, or none."""
    kind = pick(rng, ("cap", "cap", "long", "curls", "none", "hat", "crown", "helmet"))
    if kind in ("cap", "long", "helmet"):
        _cap(rng, built, tilt, wide, kind)
    elif kind == "curls":
        count = 16
        for k in range(count):
            built.part(HAIR)
            up = 1 - 1.2 * (k + 0.5) / count
            r, way = np.sqrt(max(1 - up**2, 0)), 2.4 * k
            at = vec(r * np.cos(way) * wide, 0.2 + 0.85 * up, r * np.sin(way) * 0.85 - 0.15)
            if at[2] > 0.25 and at[1] < 0.65:
                continue
            built.ellipsoid(tilt @ at, np.full(3, span(rng, 0.22, 0.32)))
    elif kind == "hat":
        built.part(HAIR)
        built.cylinder(tilt @ vec(0, 0.5, -0.08), span(rng, 1.1, 1.6), 0.05, 0.04, tilt)
        high = span(rng, 0.25, 0.6)
        outline = np.array([[wide + 0.13, 0], [wide + 0.1, high], [wide - 0.1, 2 * high]])
        built.lathe(tilt @ vec(0, 0.45, -0.08), profile(outline, 1), tilt, soft=0.05)
    elif kind == "crown":
        built.part(MORE)
        built.cylinder(tilt @ vec(0, 0.75, -0.08), wide + 0.06, 0.25, 0.01, tilt)
        built.cylinder(tilt @ vec(0, 0.95, -0.08), wide - 0.01, 0.4, 0, tilt, cut=True)
        for k in range(4):
            built.box(
                tilt @ vec(0, 1.0, -0.08),
                [2, 0.12, 0.12],
                0,
                tilt @ turned(k * np.pi / 4),
                cut=True,
            )
    if chance(rng, 0.15):
        built.part(HAIR)
        built.ellipsoid(tilt @ vec(0, -0.85, 0.4), [0.5, span(rng, 0.3, 0.7), 0.4], tilt)


def _cap(rng: Rng, built: PrimitiveBuilder, tilt: F64, wide: float, kind: str) -> None:
    """Hair or a helmet around the skull, open before the face."""
    built.part(HAIR)
    over = span(rng, 0.06, 0.16)
    built.ellipsoid(tilt @ vec(0, 0.26, -0.16), vec(wide, 0.82, 0.88) + over, tilt)
    if kind == "long":
        for sign in (1, -1):
            line = [
                [0.6 * sign, 0.4, -0.3],
                [0.8 * sign, -0.4, -0.3],
                [0.7 * sign, -span(rng, 0.9, 1.6), -0.1],
            ]
            tube(built, curve(line, 5) @ tilt.T, 0.3, 0.2, soft=0.2)
        built.ellipsoid(tilt @ vec(0, -0.5, -0.5), [0.7, 0.85, 0.35], tilt, soft=0.2)
    low = span(rng, -0.3, 0.1)
    built.box(tilt @ vec(0, low - 0.55, 0.75), [0.62, 0.95, 0.8], 0.25, tilt, cut=True, soft=0.06)
    if kind == "helmet":
        built.box(tilt @ vec(0, -1.6, 0), [2, 1.3, 2], 0, tilt, cut=True)
        built.part(MORE)
        built.ring(tilt @ vec(0, -0.2, -0.1), wide + over, 0.06, turn=tilt)
    elif chance(rng, 0.25):
        built.part(HAIR)
        built.ellipsoid(tilt @ vec(0, span(rng, 0.2, 1.1), -0.95), np.full(3, 0.33))


def _shoulders(rng: Rng, built: PrimitiveBuilder) -> None:
    """The neck, and a chest that ends in a plinth, a cut, or a shirt with a collar."""
    neck = span(rng, 0.28, 0.42)
    broad = span(rng, 0.85, 1.35)
    built.part(SKIN)
    built.limb([0, -0.5, -0.15], [0, -1.5, -0.15], neck, 1.15 * neck)
    if chance(rng, 0.6):
        built.part(CLOTH)
    built.ellipsoid(
        [0, -2.05, -0.15], [broad, span(rng, 0.55, 0.7), span(rng, 0.5, 0.65)], soft=0.3
    )
    for sign in (1, -1):
        built.limb([0.3 * sign, -1.55, -0.15], [sign * broad, -1.85, -0.2], 0.22, 0.34, soft=0.25)
        if chance(rng, 0.4):
            built.limb(
                [sign * broad, -1.85, -0.2],
                [sign * (broad + 0.1), -2.5, -0.1],
                0.32,
                0.28,
                soft=0.1,
            )
    low = span(rng, -2.6, -2.1)
    built.box([0, low - 2, 0], [4, 2, 4], cut=True)
    if chance(rng, 0.35):
        built.part(MORE)
        outline = np.array([[0.6, -0.7], [0.6, -0.55], [0.35, -0.4], [0.35, -0.1], [0.5, 0.1]])
        built.lathe([0, low, -0.15], profile(outline, 1))
    if chance(rng, 0.3):
        built.part(MORE)
        built.ring([0, -1.42, -0.12], neck + 0.12, 0.09, turn=turned(0, 0.25))
    if chance(rng, 0.2):
        for sign in (1, -1):
            built.part(CLOTH)
            built.box(
                [0.2 * sign, -1.6, 0.35], [0.22, 0.2, 0.05], 0.03, turned(0, -0.5, 0.5 * sign)
            )


def _hand(rng: Rng, built: PrimitiveBuilder) -> None:
    """Open, a fist, pointing, counting, holding a ball; the palm looks along +z."""
    turn = turned(span(rng, 0, 6), rng.normal(0, 0.6), rng.normal(0, 0.5))
    wide, thick = span(rng, 0.4, 0.52), span(rng, 0.13, 0.2)
    pose = pick(rng, ("open", "open", "fist", "point", "two", "relaxed", "ball"))
    bent = {
        "open": (0.05,) * 4,
        "fist": (1.6,) * 4,
        "point": (0.0, 1.6, 1.6, 1.6),
        "two": (0, 0, 1.6, 1.6),
        "relaxed": (0.4, 0.5, 0.6, 0.7),
        "ball": (0.75,) * 4,
    }[pose]
    built.part(SKIN)
    built.box([0, 0, 0], [wide, 0.48, thick], 0.9 * thick, turn)
    built.ellipsoid(turn @ vec(-0.25, -0.15, 0.08), [0.26, 0.36, thick], turn, soft=0.1)
    built.limb(
        turn @ vec(0, -0.3, 0), turn @ vec(0, -span(rng, 0.7, 1.5), 0), 0.26, 0.26, soft=0.12
    )
    spread = span(rng, 0.0, 0.22)
    radius = 0.24 * wide
    for k in range(4):
        at = vec(wide * (-0.75 + 0.5 * k), 0.42, 0)
        long = (0.72, 0.82, 0.76, 0.58)[k] * span(rng, 0.9, 1.1)
        aside, curl = spread * (k - 1.5), bent[k] + rng.normal(0, 0.06)
        built.part(SKIN)
        angle = 0.35 * curl
        for j, share in enumerate((0.45, 0.32, 0.25)):
            way = vec(np.sin(aside) * np.cos(angle), np.cos(aside) * np.cos(angle), np.sin(angle))
            end = at + share * long * way
            built.limb(turn @ at, turn @ end, radius * (1 - 0.08 * j), radius * (0.92 - 0.08 * j))
            at, angle = end, angle + curl
    fold = {"open": 0.1, "two": 0.9, "fist": 1.0, "point": 0.8, "relaxed": 0.4, "ball": 0.6}[pose]
    a = vec(-0.8 * wide, -0.2, 0.08)
    b = a + vec(-0.3 + 0.35 * fold, 0.3, 0.12 + 0.2 * fold)
    c = b + vec(-0.08 + 0.5 * fold, 0.28, 0.05 + 0.1 * fold)
    built.part(SKIN)
    tube(built, np.stack([a, b, c]) @ turn.T, 1.25 * radius, 0.9 * radius)
    if pose == "ball":
        built.part(MORE)
        size = span(rng, 0.3, 0.45)
        built.ellipsoid(turn @ vec(0, 0.5, thick + size), np.full(3, size))
    if chance(rng, 0.35):
        built.part(CLOTH)
        built.limb(turn @ vec(0, -0.75, 0), turn @ vec(0, -1.6, 0), 0.33, 0.36)
