"""Cars, trucks, buses, motorcycles, bicycles, aeroplanes, rockets, boats, trains and tractors."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .flying import aeroplane, balloon, helicopter, rocket
from .lorries import bus, train, truck
from .making import Rng, chance, pick, smooth, span, vec
from .wheels import LYING, lights, wheel, wheels

BODY, GLASS, TYRE, METAL, MORE, SEAT = range(6)


def vehicles(rng: Rng) -> PrimitiveBuilder:
    """Make a vehicle that drives along +x, or flies or swims."""
    kinds = (
        _car,
        _car,
        _car,
        truck,
        truck,
        bus,
        _motorcycle,
        _bicycle,
        _boat,
        _boat,
        train,
        _tractor,
        _pram,
        aeroplane,
        aeroplane,
        rocket,
        helicopter,
        balloon,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _car(rng: Rng, built: PrimitiveBuilder) -> None:
    """Saloons, hatchbacks, pick-ups, vans, racers and old round ones."""
    wheel, wide = span(rng, 0.17, 0.25), span(rng, 0.36, 0.46)
    long, sill = span(rng, 0.85, 1.1), span(rng, 0.1, 0.2)
    belt, roof = sill + span(rng, 0.28, 0.4), span(rng, 0.25, 0.42)
    kind = pick(rng, ("saloon", "hatch", "van", "pickup", "open", "round"))
    nose = span(rng, 0.75, 0.95)
    low = [
        [-long, sill],
        [long, sill],
        [long, sill + 0.2],
        [nose * long, belt * 0.9],
        [0.4 * long, belt],
        [-0.9 * long, belt],
        [-long, belt - 0.1],
    ]
    built.part(BODY)
    built.prism([0, 0, 0], smooth(low, 2), wide, span(rng, 0.04, 0.12))
    xs = (-span(rng, 0.5, 0.62) * long, span(rng, 0.5, 0.65) * long)
    for x in xs:
        built.cylinder([x, wheel, 0], 1.18 * wheel, 2 * wide, 0, LYING, cut=True)
    front, back = {
        "saloon": (0.4, -0.6),
        "hatch": (0.4, -0.95),
        "van": (0.65, -0.97),
        "pickup": (0.4, -0.15),
        "open": (0.3, 0.2),
        "round": (0.45, -0.75),
    }[kind]
    rake, fall = span(rng, 0.15, 0.35), 0.05 if kind in ("van", "pickup") else span(rng, 0.05, 0.35)
    cabin = np.array(
        [
            [back * long, belt - 0.05],
            [front * long, belt - 0.05],
            [(front - rake) * long, belt + roof],
            [(back + fall) * long, belt + roof],
        ]
    )
    if kind == "open":
        _windscreen(built, front * long, belt, wide)
    else:
        _cabin(rng, built, cabin, wide, 2 if kind == "round" else 1)
    lights(rng, built, long, sill + 0.22, wide)
    wheels(rng, built, xs, wheel, wide)


def _windscreen(built: PrimitiveBuilder, x: float, belt: float, wide: float) -> None:
    """All that an open car has, but for its seats."""
    built.part(GLASS)
    built.box([x, belt + 0.08, 0], [0.015, 0.12, 0.85 * wide], 0.01, turned(0, 0, 0.5))
    for behind in (0.25, 0.6):
        built.part(SEAT)
        built.box([x - behind, belt, 0], [0.06, 0.2, 0.6 * wide], 0.05)


def _cabin(rng: Rng, built: PrimitiveBuilder, cabin: F64, wide: float, times: int) -> None:
    """Glass beneath a roof on posts; `cabin` (4, 2): below behind, below before, above."""
    built.part(GLASS)
    built.prism([0, 0, 0], smooth(cabin, times), 0.88 * wide, 0.05)
    built.part(BODY)
    inset = np.array([[0.02, -0.05], [-0.02, -0.05], [-0.06, 0.015], [0.06, 0.015]])
    built.prism([0, 0, 0], cabin[[3, 2, 2, 3]] + inset, 0.9 * wide, 0.03)
    for t in (0.0, span(rng, 0.4, 0.6), 1.0):
        a, b = (cabin[0] * (1 - t) + cabin[1] * t, cabin[3] * (1 - t) + cabin[2] * t)
        for sign in (1, -1):
            built.limb([*a, sign * 0.86 * wide], [*b, sign * 0.86 * wide], 0.03, 0.025)


def _motorcycle(rng: Rng, built: PrimitiveBuilder) -> None:
    """Motorcycles and scooters; often leaning."""
    wheel, base = span(rng, 0.26, 0.36), span(rng, 0.6, 0.75)
    for x in (base, -base):
        built.part(TYRE)
        built.ring([x, wheel, 0], 0.82 * wheel, 0.18 * wheel, turn=LYING)
        built.part(METAL)
        built.cylinder(
            [x, wheel, 0], 0.65 * wheel if chance(rng, 0.4) else 0.25 * wheel, 0.05, 0.02, LYING
        )
    head = vec(0.45 * base, 0.85, 0)
    built.part(METAL)
    for z in (0.09, -0.09):
        built.limb([base, wheel, z], [*head[:2], z], 0.035, 0.035)
        built.limb([-base, wheel, z], [-0.1, 0.35, z], 0.035, 0.035)
    built.limb([*head[:2], -0.3], [*head[:2], 0.3], 0.03, 0.03)
    built.part(BODY)
    built.ellipsoid([0.12, 0.7, 0], [0.32, span(rng, 0.12, 0.2), 0.15], turned(0, 0, 0.15))
    built.part(SEAT)
    built.superquadric(
        [-0.4, 0.66, 0], [span(rng, 0.25, 0.4), 0.08, 0.14], 0.6, 0.5, turned(0, 0, -0.1)
    )
    built.part(METAL)
    built.box([0, 0.38, 0], [0.24, 0.16, 0.13], 0.05)
    built.limb([-0.1, 0.25, 0.15], [-1.0 * base, 0.28, 0.18], 0.04, 0.06)
    built.part(MORE)
    built.ellipsoid([0.58 * base, 0.78, 0], [0.1, 0.11, 0.11])
    for x in (base, -base):
        built.ring(
            [x, wheel, 0],
            1.12 * wheel,
            0.05,
            span(rng, 0.7, 1.3),
            turned(0, -np.pi / 2) @ turned(np.pi) @ turned(0, np.pi),
        )
    if chance(rng, 0.4):  # a shield before the knees
        built.part(BODY)
        built.box([0.5 * base, 0.6, 0], [0.03, 0.3, 0.22], 0.02, turned(0, 0, 0.3))


def _bicycle(rng: Rng, built: PrimitiveBuilder) -> None:
    """Wheels with spokes, a frame of tubes, now and then a basket."""
    wheel, base = span(rng, 0.33, 0.4), span(rng, 0.5, 0.6)
    thick = span(rng, 0.02, 0.03)
    crank, saddle = vec(-0.08, 0.3, 0), vec(-0.28, 0.85, 0)
    head, low = vec(0.36, 0.9, 0), vec(0.4, 0.72, 0)
    for x in (base, -base):
        built.part(TYRE)
        built.ring([x, wheel, 0], wheel - 0.03, 0.03, turn=LYING)
        built.part(METAL)
        built.cylinder([x, wheel, 0], 0.04, 0.06, 0.01, LYING)
        for k in range(4):
            way = wheel * 0.92 * vec(np.cos(0.785 * k + 0.3), np.sin(0.785 * k + 0.3), 0)
            built.limb(vec(x, wheel, 0) - way, vec(x, wheel, 0) + way, 0.01, 0.01)
    built.part(BODY)
    top = vec(-0.24, 0.75, 0) if chance(rng, 0.7) else crank + [-0.05, 0.2, 0]
    for a, b in ((crank, saddle), (crank, low), (top, low + [0, 0.06, 0]), (low, head)):
        built.limb(a, b, thick, thick)
    for z in (0.05, -0.05):
        built.limb(low, [base, wheel, z], thick, 0.8 * thick)
        built.limb(crank, [-base, wheel, z], 0.8 * thick, 0.8 * thick)
        built.limb(vec(-0.24, 0.75, 0), [-base, wheel, z], 0.8 * thick, 0.8 * thick)
    built.part(SEAT)
    built.ellipsoid(saddle + [0, 0.03, 0], [0.14, 0.04, 0.08])
    built.part(METAL)
    built.limb(head + [0, 0, -0.25], head + [0, 0, 0.25], 0.02, 0.02)
    built.cylinder(crank, 0.1, 0.02, 0.005, LYING)
    swing = span(rng, 0, 6.28)
    for sign in (1, -1):
        foot = crank + sign * 0.17 * vec(np.cos(swing), np.sin(swing), 0) + [0, 0, sign * 0.08]
        built.limb(crank + [0, 0, sign * 0.07], foot, 0.016, 0.016)
        built.box(foot + [0, 0, sign * 0.06], [0.06, 0.015, 0.05], 0.01)
    if chance(rng, 0.3):
        built.part(MORE)
        built.box([base + 0.02, 0.9, 0], [0.13, 0.11, 0.16], 0.03)
        built.box([base + 0.02, 1.0, 0], [0.115, 0.15, 0.145], 0.02, cavity=True)


def _boat(rng: Rng, built: PrimitiveBuilder) -> None:
    """Rowing boats, yachts and steamers: a hull cut open above."""
    long, wide, deep = 1.0, span(rng, 0.22, 0.4), span(rng, 0.25, 0.4)
    kind = pick(rng, ("open", "sail", "steam", "tug"))
    built.part(BODY)
    built.ellipsoid([0, deep, 0], [long, deep * 1.02, wide])
    built.ellipsoid([0.2, deep, 0], [1.05 * long, 0.5 * deep, 0.7 * wide], soft=0.1)
    built.box([0, 2 * deep, 0], [3, deep, 3], cut=True)
    built.ellipsoid(
        [0, 1.08 * deep, 0],
        [0.92 * long, 0.7 * deep if kind == "open" else 0.2 * deep, 0.88 * wide],
        cavity=True,
    )
    if kind == "open":
        for x in (-0.4, 0.1, 0.5):
            built.part(SEAT)
            built.box([x, 0.8 * deep, 0], [0.07, 0.025, 0.8 * wide])
        return
    if kind == "sail":
        built.part(METAL)
        high, x = span(rng, 1.0, 1.6), span(rng, 0, 0.2)
        built.limb([x, 0.7 * deep, 0], [x, deep + high, 0], 0.025, 0.018)
        bulge = span(rng, -0.25, 0.25)
        for near, far in ((x - 0.03, -0.75), (x + 0.05, 0.85))[: pick(rng, (1, 2))]:
            built.part(MORE)
            sail = np.array([[near, deep + 0.12], [far, deep + 0.12], [near, deep + 0.92 * high]])
            built.prism([0, 0, 0], sail, 0.018, 0.0, turned(0, 0.3 * bulge))
        return
    y = 0.85 * deep
    for k in range(rng.integers(1, 4)):
        built.part(MORE)
        half = vec(0.55 - 0.13 * k, 0.1, 0.55 * wide * (1 - 0.15 * k))
        built.box([-0.1, y + 0.1, 0], half, 0.02)
        built.part(GLASS)
        built.box([-0.1, y + 0.13, 0], half * [0.9, 0.3, 0] + [0, 0, half[2] + 0.01])
        y += 0.2
    for k in range(rng.integers(1, 4)):
        built.part(METAL)
        built.limb(
            [-0.3 + 0.25 * k, y - 0.1, 0],
            [-0.34 + 0.25 * k, y + span(rng, 0.15, 0.4), 0],
            0.075,
            0.07,
        )


def _tractor(rng: Rng, built: PrimitiveBuilder) -> None:
    """Large wheels behind, small ones before; some have a shovel."""
    large, small = span(rng, 0.38, 0.5), span(rng, 0.2, 0.28)
    built.part(BODY)
    built.box([0.4, 0.55, 0], [0.5, 0.18, 0.18], 0.06)
    built.box([-0.3, 0.5, 0], [0.35, 0.12, 0.2], 0.04)
    half, style = 0.11, int(rng.integers(3))
    for sign in (1, -1):
        wheel(rng, built, vec(-0.5, large, sign * 0.4), large, 1.2 * half, style)
        wheel(rng, built, vec(0.7, small, sign * 0.3), small, 0.8 * half, style)
        built.part(BODY)
        built.ring([-0.5, large, sign * 0.38], 1.1 * large, 0.06, 1.0, turned(0, -np.pi / 2))
    if chance(rng, 0.6):
        built.part(MORE)
        built.box([-0.4, 1.2, 0], [0.34, 0.03, 0.3], 0.02)
        for x in (-0.7, -0.1):
            for z in (0.26, -0.26):
                built.limb([x, 0.55, z], [x, 1.2, z], 0.03, 0.03)
    built.part(SEAT)
    built.box([-0.5, 0.68, 0], [0.14, 0.06, 0.14], 0.03)
    built.box([-0.64, 0.82, 0], [0.04, 0.15, 0.14], 0.03)
    built.part(METAL)
    built.ring([-0.12, 0.86, 0], 0.12, 0.02, turn=turned(0, 0, -0.7))
    built.limb([0.0, 0.6, 0], [-0.12, 0.86, 0], 0.02, 0.02)
    built.limb([0.6, 0.7, 0.08], [0.6, 1.1, 0.08], 0.035, 0.03)
    if chance(rng, 0.35):
        built.part(METAL)
        lift = span(rng, 0.1, 0.7)
        for z in (0.24, -0.24):
            built.limb([0.1, 0.6, z], [1.1, lift, z], 0.04, 0.04)
        built.box([1.25, lift, 0], [0.17, 0.14, 0.42], 0.02)
        built.box([1.33, lift + 0.08, 0], [0.17, 0.14, 0.38], 0, cut=True)


def _pram(rng: Rng, built: PrimitiveBuilder) -> None:
    """A wheelbarrow, a cart or a pram."""
    wheel = span(rng, 0.18, 0.3)
    half = vec(span(rng, 0.4, 0.6), span(rng, 0.15, 0.25), span(rng, 0.25, 0.35))
    y = 1.3 * wheel + half[1]
    built.part(BODY)
    built.box([0, y, 0], half, span(rng, 0.01, 0.12))
    built.box([0, y + 0.06, 0], half - [0.04, 0, 0.04], 0.01, cavity=True)
    if chance(rng, 0.5):
        built.part(MORE)
        built.ellipsoid([0.3 * half[0], y + half[1], 0], [0.75 * half[0], half[0], 1.03 * half[2]])
        built.box([-half[0], y + half[1], 0], [half[0], 2, 2], cut=True)
        built.box([0, y - 0.5, 0], [2, 0.5 + half[1], 2], cut=True)
    built.part(METAL)
    for sign in (1, -1):
        built.limb(
            [-half[0], y, sign * 0.8 * half[2]],
            [-half[0] - 0.4, y + 0.35, sign * 0.8 * half[2]],
            0.03,
            0.03,
        )
    built.limb(
        [-half[0] - 0.4, y + 0.35, -half[2]], [-half[0] - 0.4, y + 0.35, half[2]], 0.03, 0.03
    )
    for x in (-0.6, 0.6):
        built.limb([x * half[0], wheel, -half[2]], [x * half[0], wheel, half[2]], 0.025, 0.025)
        built.limb([x * half[0], wheel, 0], [x * half[0], y - half[1], 0], 0.04, 0.04)
    wheels(rng, built, (-0.6 * half[0], 0.6 * half[0]), wheel, half[2] + 0.06)
