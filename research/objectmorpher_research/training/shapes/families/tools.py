"""Tools and cutlery, rackets and guitars: what has a handle."""

from __future__ import annotations

import itertools

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, ngon, pick, profile, rounded, smooth, span, vec

STEEL, GRIP, MORE = range(3)


def tool(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Make a tool in the plane of x and y of `turn`, its handle below."""
    kinds = (
        _hammer,
        _spanner,
        _key,
        _scissors,
        _screwdriver,
        _saw,
        _knife,
        _fork,
        _spoon,
        _brush,
        _racket,
        _guitar,
        _torch,
        _pen,
        _magnifier,
        _pliers,
        _axe,
        _plug,
    )
    pick(rng, kinds)(rng, built, turn)


def _grip(
    rng: Rng, built: PrimitiveBuilder, turn: F64, low: float, high: float, thick: float
) -> None:
    """A handle along y: round, swollen or flat."""
    built.part(GRIP)
    kind = pick(rng, ("round", "turned", "flat"))
    if kind == "round":
        built.limb(turn @ vec(0, low, 0), turn @ vec(0, high, 0), thick, 0.85 * thick)
    elif kind == "flat":
        built.box(
            turn @ vec(0, 0.5 * (low + high), 0),
            [thick, 0.5 * (high - low), 0.6 * thick],
            0.3 * thick,
            turn,
        )
    else:
        swell = np.array([[0.8, 0], [1.15, 0.1], [0.9, 0.4], [1.2, 0.75], [0.7, 1]])
        built.lathe([0, 0, 0], profile(swell * [thick, high - low] + [0, low], 2), turn)


def _hammer(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """With a claw, a mallet, or square."""
    _grip(rng, built, turn, -1.2, 0.6, span(rng, 0.07, 0.12))
    built.part(STEEL)
    half, size = span(rng, 0.2, 0.5), span(rng, 0.11, 0.2)
    lying = turn @ turned(0, 0, np.pi / 2)
    kind = pick(rng, ("claw", "mallet", "square"))
    if kind == "mallet":
        built.cylinder(turn @ vec(0, 0.65, 0), 1.5 * size, half, 0.05, lying)
        return
    built.box(turn @ vec(0, 0.65, 0), [half, size, size], 0.03, turn)
    if kind == "claw":
        built.cylinder(turn @ vec(half + 0.08, 0.65, 0), 1.1 * size, 0.1, 0.03, lying)
        for z in (0.07, -0.07):
            a, b = vec(-half, 0.68, z), vec(-half - 0.35, 0.5, 1.6 * z)
            built.limb(turn @ a, turn @ b, 0.09, 0.03, soft=0.03)


def _spanner(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Jaws at one end, a ring or jaws at the other."""
    half, wide = span(rng, 0.05, 0.1), span(rng, 0.1, 0.16)
    axle = turn @ turned(0, np.pi / 2)
    built.part(STEEL)
    built.box([0, 0, 0], [wide, 1.0, 0.8 * half], 0.03, turn)
    for sign in (1, -1):
        at = turn @ vec(0, 1.15 * sign, 0)
        built.cylinder(at, 0.32, half, 0.02, axle)
    for sign in (1, -1):
        at = turn @ vec(0, 1.2 * sign, 0)
        if sign > 0 or chance(rng, 0.5):
            spin = turn @ turned(0, 0, sign * 0.26)
            built.box(at + spin @ vec(0, 0.2 * sign, 0), [0.15, 0.28, 1], 0, spin, cut=True)
        else:
            built.prism(turn @ vec(0, -1.15, 0), ngon(6, 0.2), 1, 0, turn, cut=True)


def _key(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """With a ring, a plate or a clover leaf, and teeth."""
    half = span(rng, 0.05, 0.09)
    axle = turn @ turned(0, np.pi / 2)
    built.part(STEEL)
    kind = pick(rng, ("ring", "plate", "clover"))
    if kind == "ring":
        built.ring(turn @ vec(0, 0.9, 0), 0.3, 0.08, turn=axle)
    elif kind == "plate":
        built.prism(turn @ vec(0, 0.9, 0), ngon(pick(rng, (6, 24)), 0.38), half, 0.03, turn)
        built.cylinder(turn @ vec(0, 1.05, 0), 0.1, 1, 0, axle, cut=True)
    else:
        for x, y in ((0.25, 0.8), (-0.25, 0.8), (0, 1.15)):
            built.ring(turn @ vec(x, y, 0), 0.19, 0.06, turn=axle)
    built.limb(turn @ vec(0, 0.6, 0), turn @ vec(0, -1.0, 0), 0.09, 0.09)
    for y in (-0.95, -0.75, -0.55)[: pick(rng, (2, 3))]:
        long = span(rng, 0.08, 0.2)
        built.box(turn @ vec(0.08 + long, y, 0), [long, 0.07, half], 0.01, turn)


def _scissors(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """More or less open."""
    opened = span(rng, 0.05, 0.5)
    for sign in (1, -1):
        spin = turn @ turned(0, 0, sign * opened)
        lift = turn @ vec(0, 0, 0.035 * sign)
        built.part(STEEL)
        blade = np.array([[-0.1, -0.3], [0.1, -0.3], [0.12, 0.2], [0.0, 1.3], [-0.1, 0.2]]) * [
            sign,
            1,
        ]
        built.prism(lift, blade, 0.035, 0.01, spin)
        built.part(GRIP)
        built.limb(
            lift + spin @ vec(0, -0.2, 0), lift + spin @ vec(-0.12 * sign, -0.6, 0), 0.07, 0.08
        )
        at = lift + spin @ vec(-0.22 * sign, -0.85, 0)
        built.ring(at, span(rng, 0.2, 0.28), 0.07, turn=spin @ turned(0, np.pi / 2))
    built.part(MORE)
    built.cylinder([0, 0, 0], 0.07, 0.1, 0.02, turn @ turned(0, np.pi / 2))


def _screwdriver(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A blade in a handle."""
    _grip(rng, built, turn, -1.0, -0.1, span(rng, 0.14, 0.22))
    built.part(STEEL)
    built.limb(turn @ vec(0, -0.2, 0), turn @ vec(0, 0.9, 0), 0.06, 0.05)
    built.box(turn @ vec(0, 0.95, 0), [0.09, 0.1, 0.03], 0.01, turn)


def _saw(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A blade with teeth and a handle with a hole."""
    teeth, high = int(rng.integers(8, 14)), span(rng, 0.25, 0.4)
    x = np.linspace(0, 1.8, 2 * teeth)
    low = np.stack([x, np.where(np.arange(2 * teeth) % 2, -0.08, 0)], 1)
    blade = np.concatenate([low, [[1.8, 0.5 * high], [0, high]]])
    built.part(STEEL)
    built.prism(turn @ vec(-0.5, 0, 0), blade, 0.022, 0, turn)
    built.part(GRIP)
    built.prism(turn @ vec(-0.75, 0.12, 0), rounded(0.3, 0.32, 0.15), 0.08, 0.05, turn)
    built.prism(turn @ vec(-0.75, 0.12, 0), rounded(0.13, 0.16, 0.1), 0.5, 0, turn, cut=True)


def _knife(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A knife or a sword with its guard."""
    long, wide = span(rng, 0.8, 1.8), span(rng, 0.08, 0.18)
    _grip(rng, built, turn, -0.7, 0.0, span(rng, 0.07, 0.11))
    built.part(STEEL)
    tip = pick(rng, (-wide, 0.0))
    blade = np.array([[-wide, 0], [wide, 0], [wide, 0.75 * long], [tip, long], [-wide, 0.8 * long]])
    built.prism([0, 0, 0], blade, span(rng, 0.02, 0.035), 0.01, turn)
    if chance(rng, 0.5):
        built.part(MORE)
        built.box([0, 0, 0], [span(rng, 0.18, 0.4), 0.05, 0.09], 0.03, turn)
        built.ellipsoid(turn @ vec(0, -0.75, 0), np.full(3, 0.12))


def _fork(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A fork, or a garden's."""
    teeth, thick = pick(rng, (2, 3, 4)), span(rng, 0.03, 0.05)
    built.part(STEEL)
    built.limb(turn @ vec(0, -1.4, -0.05), turn @ vec(0, -0.2, 0.05), 0.07, 0.05)
    built.ellipsoid(turn @ vec(0, 0, 0.05), [0.25, 0.22, 0.05], turn, soft=0.05)
    for k in range(teeth):
        x = 0.42 * (k / (teeth - 1) - 0.5)
        a, b = vec(0.9 * x, 0.05, 0.06), vec(x, 0.75, span(rng, 0.08, 0.12))
        built.limb(turn @ a, turn @ b, thick, 0.7 * thick, soft=0.02)


def _spoon(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A spoon, a ladle or a shovel."""
    long, wide = span(rng, 1.2, 2.0), span(rng, 0.25, 0.5)
    built.part(STEEL)
    deep = span(rng, 0.1, 0.35)
    built.ellipsoid(turn @ vec(0, 0.35, 0), [wide, 0.45, deep], turn)
    built.box(turn @ vec(0, 0.35, 1.0), [2, 2, 1.0], 0, turn, cut=True)
    built.ellipsoid(turn @ vec(0, 0.35, 0.04), [wide - 0.05, 0.4, deep - 0.03], turn, cavity=True)
    built.part(pick(rng, (STEEL, GRIP)))
    built.limb(
        turn @ vec(0, 0, -0.05),
        turn @ vec(0, -long, span(rng, 0, 0.3)),
        0.06,
        span(rng, 0.06, 0.12),
    )


def _brush(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A paint brush, a broom, a toothbrush."""
    kind = pick(rng, ("paint", "broom", "tooth"))
    _grip(rng, built, turn, -1.6 if kind == "broom" else -1.0, 0.0, 0.07)
    built.part(MORE)
    if kind == "paint":
        wide = span(rng, 0.12, 0.4)
        built.box(turn @ vec(0, 0.12, 0), [wide, 0.16, 0.1], 0.03, turn)
        built.part(STEEL)
        built.superquadric(turn @ vec(0, 0.45, 0), [0.95 * wide, 0.35, 0.09], 0.6, 0.6, turn)
    elif kind == "broom":
        built.box(turn @ vec(0, 0.05, 0), [0.5, 0.09, 0.1], 0.03, turn)
        for k in range(9):
            x = 0.11 * (k - 4)
            built.limb(
                turn @ vec(x, 0.1, 0), turn @ vec(1.3 * x, span(rng, 0.5, 0.6), 0), 0.055, 0.05
            )
    else:
        built.box(turn @ vec(0, 0.3, 0), [0.1, 0.35, 0.05], 0.03, turn)
        built.part(STEEL)
        built.box(turn @ vec(0, 0.4, 0.14), [0.085, 0.22, 0.12], 0.02, turn)


def _racket(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """For tennis (strings) or table tennis (a blade)."""
    _grip(rng, built, turn, -1.2, -0.4, 0.09)
    if chance(rng, 0.5):
        built.part(STEEL)
        built.cylinder(turn @ vec(0, 0.2, 0), 0.6, 0.06, 0.03, turn @ turned(0, np.pi / 2))
        built.part(MORE)
        built.cylinder(turn @ vec(0, 0.25, 0.03), 0.55, 0.05, 0.02, turn @ turned(0, np.pi / 2))
        return
    built.part(STEEL)
    built.ring(turn @ vec(0, 0.4, 0), 0.6, 0.055, turn=turn @ turned(0, np.pi / 2))
    for x in (-0.25, 0.25):
        built.limb(turn @ vec(x, -0.15, 0), turn @ vec(0, -0.6, 0), 0.05, 0.06)
    built.part(MORE)
    for k in range(-2, 3):
        s = 0.58 * np.sqrt(max(1 - (0.37 * k) ** 2, 0))
        built.limb(turn @ vec(0.22 * k, 0.4 - s, 0), turn @ vec(0.22 * k, 0.4 + s, 0), 0.014, 0.014)
        built.limb(
            turn @ vec(-s, 0.4 + 0.22 * k, 0), turn @ vec(s, 0.4 + 0.22 * k, 0), 0.014, 0.014
        )


def _guitar(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A body with a waist, a hole, a neck and pegs."""
    deep, wide = span(rng, 0.06, 0.2), span(rng, 0.48, 0.62)
    side = [
        [0.02, -0.75],
        [wide, -0.7],
        [1.05 * wide, -0.25],
        [0.55 * wide, 0.05],
        [0.75 * wide, 0.45],
        [0.4 * wide, 0.7],
    ]
    outline = np.array(side + [[-x, y] for x, y in side[::-1]])
    built.part(GRIP)
    built.prism([0, 0, 0], smooth(outline, 2), deep, 0.03, turn)
    axle = turn @ turned(0, np.pi / 2)
    if chance(rng, 0.7):
        built.cylinder(turn @ vec(0, 0.1, deep), 0.17, 0.12, 0, axle, cavity=True)
    built.part(MORE)
    built.box(turn @ vec(0, 0.95, deep), [0.08, 0.75, 0.05], 0.02, turn)
    built.box(turn @ vec(0, 1.8, deep - 0.02), [0.12, 0.18, 0.04], 0.02, turn)
    built.box(turn @ vec(0, -0.4, deep), [0.22, 0.05, 0.04], 0.01, turn)
    for k in range(6):
        built.part(STEEL)
        x = 0.17 * (-1) ** k
        built.ellipsoid(turn @ vec(x, 1.68 + 0.06 * k, deep - 0.02), [0.06, 0.03, 0.03], turn)


def _torch(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A torch, a microphone, a hair dryer."""
    kind = pick(rng, ("torch", "microphone", "dryer"))
    _grip(rng, built, turn, -1.0, 0.3, span(rng, 0.13, 0.2))
    built.part(STEEL)
    if kind == "torch":
        built.lathe([0, 0, 0], profile([[0.16, 0.2], [0.3, 0.5], [0.32, 0.8]], 0), turn)
        built.cylinder(turn @ vec(0, 0.8, 0), 0.27, 0.08, 0, turn, cavity=True)
    elif kind == "microphone":
        built.ellipsoid(turn @ vec(0, 0.5, 0), [0.27, 0.3, 0.27], turn)
        built.ring(turn @ vec(0, 0.45, 0), 0.27, 0.04, turn=turn)
    else:
        lying = turn @ turned(0, 0, np.pi / 2)
        built.cylinder(turn @ vec(-0.1, 0.45, 0), 0.3, 0.45, 0.15, lying)
        built.cylinder(turn @ vec(-0.65, 0.45, 0), 0.2, 0.3, 0.02, lying)
        built.cylinder(turn @ vec(-0.95, 0.45, 0), 0.16, 0.15, 0, lying, cavity=True)


def _pen(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A pencil with six sides, a pen with a clip."""
    long, thick = span(rng, 0.7, 1.3), span(rng, 0.09, 0.14)
    along_y = turn @ turned(0, np.pi / 2)
    built.part(GRIP)
    if chance(rng, 0.5):
        built.prism([0, 0, 0], ngon(6, thick), long, 0, along_y)
        built.part(MORE)
        tip = [[0.93 * thick, long - 0.01], [0.02, long + 4 * thick]]
        built.lathe([0, 0, 0], profile(tip, 0), turn)
        built.cylinder(turn @ vec(0, -long - 0.06, 0), thick, 0.09, 0.03, turn)
    else:
        built.limb(turn @ vec(0, -long, 0), turn @ vec(0, long, 0), thick, thick)
        built.part(STEEL)
        built.limb(turn @ vec(0, long, 0), turn @ vec(0, long + 3 * thick, 0), 0.8 * thick, 0.03)
        built.box(turn @ vec(0, -0.65 * long, thick + 0.03), [0.03, 0.3 * long, 0.02], 0.01, turn)


def _magnifier(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A magnifying glass, a hand mirror, a pan seen from above."""
    size, axle = span(rng, 0.4, 0.6), turn @ turned(0, np.pi / 2)
    _grip(rng, built, turn, -1.0 - size, -size, span(rng, 0.07, 0.11))
    built.part(STEEL)
    built.ring([0, 0, 0], size, 0.07, turn=axle)
    if chance(rng, 0.7):
        built.part(MORE)
        built.ellipsoid([0, 0, 0], [size, size, span(rng, 0.03, 0.1)], turn)


def _pliers(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """Pliers, tongs, pegs, tweezers."""
    opened = span(rng, 0.08, 0.35)
    for sign in (1, -1):
        spin = turn @ turned(0, 0, sign * opened)
        built.part(STEEL)
        built.limb(spin @ vec(0, 0, 0), spin @ vec(-0.08 * sign, 0.6, 0), 0.16, 0.06)
        built.part(GRIP)
        a, b, c = vec(0, 0, 0), vec(0.15 * sign, -0.4, 0), vec(0.05 * sign, -1.2, 0)
        built.limb(spin @ a, spin @ b, 0.1, 0.1)
        built.limb(spin @ b, spin @ c, 0.1, 0.08)
    built.part(MORE)
    built.cylinder([0, 0, 0], 0.14, 0.15, 0.03, turn @ turned(0, np.pi / 2))


def _axe(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """An axe, a pick, a hoe."""
    _grip(rng, built, turn, -1.5, 0.6, 0.08)
    built.part(STEEL)
    if chance(rng, 0.6):
        wide = span(rng, 0.2, 0.45)
        head = np.array(
            [
                [-0.15, -0.13],
                [0.15, -0.12],
                [0.6, -wide],
                [0.66, 0],
                [0.6, wide],
                [0.15, 0.12],
                [-0.15, 0.13],
            ]
        )
        built.prism(turn @ vec(0, 0.5, 0), smooth(head, 1), 0.08, 0.05, turn)
    else:
        for sign in (1, -1):
            built.limb(turn @ vec(0, 0.55, 0), turn @ vec(0.6 * sign, 0.4, 0), 0.1, 0.03)


def _plug(rng: Rng, built: PrimitiveBuilder, turn: F64) -> None:
    """A plug with a wire, a light bulb, a tap."""
    if chance(rng, 0.5):
        outline = np.array([[0.14, -0.6], [0.2, -0.3], [0.48, 0.15], [0.4, 0.5], [0.03, 0.68]])
        built.part(MORE)
        built.lathe([0, 0, 0], profile(outline, 2), turn)
        built.part(STEEL)
        built.cylinder(turn @ vec(0, -0.6, 0), 0.2, 0.22, 0.03, turn)
        for y in (-0.7, -0.58, -0.46):
            built.ring(turn @ vec(0, y, 0), 0.2, 0.03, turn=turn)
        return
    built.part(GRIP)
    built.box([0, 0, 0], [0.3, 0.35, 0.16], 0.08, turn)
    built.part(STEEL)
    for x in (0.14, -0.14):
        built.limb(turn @ vec(x, 0.3, 0), turn @ vec(x, 0.7, 0), 0.045, 0.04)
    built.part(MORE)
    line = [
        vec(0, -0.3, 0),
        vec(0, -0.7, 0.05),
        vec(span(rng, -0.4, 0.4), -1.1, 0.1),
        vec(0.1, -1.5, 0.3),
    ]
    for a, b in itertools.pairwise(line):
        built.limb(turn @ a, turn @ b, 0.05, 0.05)
