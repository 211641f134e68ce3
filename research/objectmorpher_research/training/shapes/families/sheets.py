"""Thin or sewn things: cloth, flags, paper, open books, umbrellas, pillows, hats, shoes, bags."""

from __future__ import annotations

import numpy as np

from ..solid import PrimitiveBuilder, turned
from .clothes import cap, glove, handbag, hat, rucksack, shirt, shoe, trousers
from .making import Rng, chance, curve, pick, profile, rounded, span, tube, vec

CLOTH, MORE, METAL, THIRD = range(4)


def sheets(rng: Rng) -> PrimitiveBuilder:
    """Make a sheet."""
    kinds = (
        _cloth,
        _cloth,
        _flag,
        _paper,
        _open_book,
        _umbrella,
        _pillow,
        hat,
        cap,
        shoe,
        shoe,
        handbag,
        rucksack,
        shirt,
        _tent,
        _fan,
        trousers,
        glove,
        _scroll,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _waves(rng: Rng, high: float) -> tuple[float, float, float, float]:
    """Of a sheet, up to that high."""
    return span(rng, 0.2, 1.0) * high, span(rng, 0, 6), span(rng, 0, 6), span(rng, 0, 6.3)


def _cloth(rng: Rng, built: PrimitiveBuilder) -> None:
    """A cloth that hangs, lies or flies; one or two of them."""
    turn = turned(span(rng, 0, 6), span(rng, -1.5, 0.3), rng.normal(0, 0.4))
    built.part(CLOTH)
    half = vec(span(rng, 0.4, 1.0), span(rng, 0.5, 1.0))
    bend = rng.normal(0, 0.7)
    built.sheet([0, 0, 0], half, span(rng, 0.01, 0.03), _waves(rng, 0.15), bend, turn)
    if chance(rng, 0.3):
        built.part(MORE)
        spin = turn @ turned(0, 0, span(rng, 0.3, 1.2))
        built.sheet(turn @ vec(0, 0, 0.12), 0.8 * half, 0.02, _waves(rng, 0.08), bend, spin)


def _flag(rng: Rng, built: PrimitiveBuilder) -> None:
    """On a pole, with one to three stripes or a cross."""
    half = vec(span(rng, 0.5, 0.9), span(rng, 0.3, 0.5))
    top = span(rng, 1.2, 2.0)
    built.part(METAL)
    built.limb([0, 0, 0], [0, top, 0], 0.035, 0.03)
    built.ellipsoid([0, top + 0.03, 0], np.full(3, 0.06))
    if chance(rng, 0.4):
        built.cylinder([0, 0.02, 0], 0.25, 0.04, 0.02)
    kind = pick(rng, ("plain", "plain", "pennant"))
    waves, bend = _waves(rng, 0.12), rng.normal(0, 0.5)
    built.part(CLOTH)
    at = vec(half[0], top - half[1] - 0.05, 0)
    built.sheet(at, half, 0.014, waves, bend)
    if kind == "pennant":
        outline = np.array([[-half[0], half[1]], [-half[0], -half[1]], [1.2 * half[0], 0]])
        built.prism(at, outline, 2.0, keep=True)


def _paper(rng: Rng, built: PrimitiveBuilder) -> None:
    """Sheets of paper, a letter, a curled page, a folded card, a paper plane."""
    kind = pick(rng, ("pile", "curl", "card", "plane"))
    turn = turned(span(rng, 0, 6))
    if kind == "plane":
        lift = span(rng, 0.15, 0.5)
        for sign in (1, -1):
            built.part(CLOTH)
            wing = np.array([[0, 1.2], [0, -0.8], [0.7, -0.8]]) * [sign, 1]
            flat = turn @ turned(0, 0, sign * lift) @ turned(0, np.pi / 2)
            built.prism([0, 0, 0], wing, 0.016, 0, flat)
            keel = np.array([[1.2, 0], [-0.8, 0], [-0.8, -0.35]])
            built.prism(turn @ vec(0.012 * sign, 0, 0), keel, 0.014, 0, turn @ turned(np.pi / 2))
        return
    if kind == "card":
        for sign in (1, -1):
            built.part(CLOTH if sign > 0 else MORE)
            spin = turn @ turned(0, -sign * span(rng, 0.2, 0.5))
            built.box(spin @ vec(0, -0.7, 0), [span(rng, 0.5, 0.55), 0.7, 0.014], 0, spin)
        return
    for k in range(1 if kind == "curl" else rng.integers(1, 4)):
        built.part(CLOTH + k)
        spin = turn @ turned(rng.normal(0, 0.4), -np.pi / 2 + rng.normal(0, 0.03))
        bend = rng.normal(0, 1.2) if kind == "curl" else span(rng, 0, 0.4)
        waves = (0.02, 2.0, 2.0, span(rng, 0, 6))
        built.sheet([0, 0.06 * k, 0], [0.7, 1.0], 0.014, waves, bend, spin)


def _open_book(rng: Rng, built: PrimitiveBuilder) -> None:
    """Two bowed halves and a cover."""
    half, lift = vec(span(rng, 0.45, 0.6), span(rng, 0.6, 0.8)), span(rng, 0.05, 0.5)
    tilt = turned(span(rng, 0, 6)) @ turned(0, -span(rng, 0, 1.0))
    for sign in (1, -1):
        spin = tilt @ turned(0, 0, sign * lift) @ turned(0, -np.pi / 2)
        at = spin @ vec(sign * half[0], 0, 0)
        built.part(MORE)
        built.box(at - spin @ vec(0, 0, 0.06), [1.03 * half[0], 1.04 * half[1], 0.02], 0.01, spin)
        built.part(CLOTH)
        thick = span(rng, 0.03, 0.09)
        built.sheet(
            at + spin @ vec(0, 0, thick - 0.02),
            half,
            thick,
            (0.04, 3.0 / half[0] * 0.5, 0, sign * 1.57),
            -span(rng, 0.1, 0.5),
            spin,
        )
        if chance(rng, 0.4):
            spin = tilt @ turned(0, 0, sign * lift + span(rng, 0.3, 1.2)) @ turned(0, -np.pi / 2)
            built.part(CLOTH)
            built.sheet(
                spin @ vec(sign * half[0], 0, 0.05),
                half,
                0.012,
                (0.03, 2, 1, 0),
                span(rng, 0, 0.8),
                spin,
            )


def _umbrella(rng: Rng, built: PrimitiveBuilder) -> None:
    """Open, with panes that sag between its ribs, or closed; a parasol stands."""
    tilt = turned(0, *rng.normal(0, 0.5, 2)) if chance(rng, 0.7) else np.eye(3)
    ribs, wide, high = int(rng.integers(6, 10)), span(rng, 0.8, 1.1), span(rng, 0.3, 0.6)
    low = -span(rng, 0.8, 1.4)
    built.part(METAL)
    built.limb(tilt @ vec(0, low, 0), tilt @ vec(0, high + 0.15, 0), 0.03, 0.03)
    if chance(rng, 0.6):
        hook = curve([[0, low, 0], [0.05, low - 0.15, 0], [0.18, low - 0.15, 0], [0.22, low, 0]], 6)
        built.part(MORE)
        tube(built, hook @ tilt.T, 0.045)
    if chance(rng, 0.2):  # closed
        built.part(CLOTH)
        built.lathe(
            [0, 0, 0],
            profile([[0.05, low + 0.3], [0.16, 0.1 * low], [0.1, high], [0.02, high + 0.05]], 2),
            tilt,
        )
        return
    built.part(CLOTH)
    built.ellipsoid([0, 0, 0], [wide, high, wide], tilt)
    built.ellipsoid(tilt @ vec(0, -0.045, 0), [wide - 0.02, high, wide - 0.02], tilt, cut=True)
    for k in range(ribs):
        spin = tilt @ turned(2 * np.pi * k / ribs)
        built.cylinder(
            spin @ vec(0, -0.05, 1.15 * wide),
            0.5 * wide / ribs * 4,
            0.15 * high + 0.1,
            0,
            spin @ turned(0, np.pi / 2, 0),
            cut=True,
        )
    built.box(tilt @ vec(0, -1.0, 0), [2, 1.0, 2], 0, tilt, cut=True)


def _pillow(rng: Rng, built: PrimitiveBuilder) -> None:
    """One or a heap of them, with buttons or a rim."""
    y = 0.0
    for k in range(rng.integers(1, 4)):
        half = vec(span(rng, 0.5, 0.9), span(rng, 0.14, 0.28), span(rng, 0.45, 0.65))
        turn = turned(rng.normal(0, 0.4), rng.normal(0, 0.08), rng.normal(0, 0.08))
        built.part(CLOTH + k)
        at = vec(rng.normal(0, 0.05), y + half[1], rng.normal(0, 0.05))
        built.superquadric(at, half, span(rng, 0.9, 1.25), span(rng, 0.25, 0.5), turn)
        if chance(rng, 0.3):
            built.ellipsoid(
                at + turn @ vec(0, half[1] + 0.08, 0), np.full(3, 0.18), cut=True, soft=0.1
            )
        y += 1.7 * half[1]


def _tent(rng: Rng, built: PrimitiveBuilder) -> None:
    """A tent with two sides, an open front and a pole, or a dome."""
    long, high, wide = span(rng, 0.7, 1.2), span(rng, 0.6, 1.0), span(rng, 0.5, 0.9)
    built.part(CLOTH)
    if chance(rng, 0.6):
        outline = np.array([[-wide, 0], [wide, 0], [0, high]])
        built.prism([0, 0, 0], outline, long, 0.01)
        built.prism([0, 0, 0.1], 0.92 * outline, long, cavity=True)
        built.part(METAL)
        built.limb([0, 0, 0.95 * long], [0, high + 0.05, 0.95 * long], 0.03, 0.03)
        if chance(rng, 0.5):
            built.part(MORE)
            turn = turned(0.6) @ turned(0, 0.05)
            built.prism([0, 0, long + 0.02], outline * [0.5, 0.9] + [0.5 * wide, 0], 0.02, 0, turn)
    else:
        built.ellipsoid([0, 0, 0], [wide, high, long])
        built.box([0, -1, 0], [2, 1, 2], cut=True)
        built.ellipsoid([0, 0, long], [0.4 * wide, 0.6 * high, 0.5], cut=True)
        built.part(MORE)
        built.ring([0, 0, 0], 1.0, 0.03, np.pi / 2, turned(0, -np.pi / 2))


def _fan(rng: Rng, built: PrimitiveBuilder) -> None:
    """Folded paper: a fan, a lampshade, a screen."""
    if chance(rng, 0.5):
        count, half = int(rng.integers(5, 9)), span(rng, 0.6, 1.3)
        lean = turned(span(rng, 0, 6), rng.normal(0, 0.3))
        for k in range(count):
            built.part(CLOTH + k % 2)
            way = half * (2 * (k + 0.5) / count - 1)
            spin = lean @ turned(0, 0, way) @ turned(0.35 * (-1) ** k)
            blade = np.array(
                [
                    [0.03, 0.1],
                    [-0.03, 0.1],
                    [-1.02 * np.tan(half / count), 1.0],
                    [1.02 * np.tan(half / count), 1.0],
                ]
            )
            built.prism([0, 0, 0], blade, 0.014, 0, spin)
        built.part(METAL)
        built.ellipsoid([0, 0.1, 0], np.full(3, 0.06))
        return
    x, z, high = 0.0, 0.0, span(rng, 0.7, 1.1)
    for k in range(rng.integers(2, 5)):
        way, long = span(rng, 0.3, 1.0) * (-1) ** k, 0.4
        a, b = vec(x, 0, z), vec(x + 2 * long * np.cos(way), 0, z + 2 * long * np.sin(way))
        built.part(CLOTH + k % 2)
        built.box(0.5 * (a + b) + [0, high, 0], [long, high, 0.025], 0.01, turned(-way))
        x, z = float(b[0]), float(b[2])


def _scroll(rng: Rng, built: PrimitiveBuilder) -> None:
    """Paper, a carpet or a mat that is rolled up at one end or at both."""
    long, wide, thick = span(rng, 0.5, 1.2), span(rng, 0.35, 0.7), span(rng, 0.014, 0.04)
    built.part(CLOTH)
    built.box([0, thick, 0], [long, thick, wide])
    for sign in (1, -1)[: pick(rng, (1, 2))]:
        built.part(pick(rng, (CLOTH, MORE)))
        r = span(rng, 0.1, 0.25)
        lying = turned(0, np.pi / 2)
        built.cylinder([sign * long, r, 0], r, wide * 1.01, 0, lying)
        built.cylinder([sign * long, r, 0], 0.45 * r, 2 * wide, 0, lying, cut=True)
    if chance(rng, 0.3):
        built.part(THIRD)
        built.prism(
            [0, 2 * thick, 0], rounded(0.4 * long, 0.6 * wide, 0.1), 0.012, 0, turned(0, np.pi / 2)
        )
