"""Cars, trucks, buses, motorcycles, bicycles, aeroplanes, rockets, boats, trains and tractors."""

from __future__ import annotations

import numpy as np

from ....arrays import F64
from ..solid import Builder, turned
from .flying import aeroplane, balloon, helicopter, rocket
from .making import Rng, chance, pick, rounded, smooth, span, vec

BODY, GLASS, TYRE, METAL, MORE, SEAT = range(6)
LYING = turned(0, np.pi / 2)  # an axle along z


def vehicles(rng: Rng) -> Builder:
    """One that drives along +x, or flies or swims."""
    kinds = (_car, _car, _car, _truck, _truck, _bus, _motorcycle, _bicycle, _boat, _boat, _train,
             _tractor, _pram, aeroplane, aeroplane, rocket, helicopter, balloon)  # fmt: skip
    built = Builder()
    pick(rng, kinds)(rng, built)
    return built


def _wheel(rng: Rng, built: Builder, at: F64, radius: float, half: float, style: int) -> None:
    """About z; the hub is a part of its own."""
    built.part(TYRE)
    built.cylinder(at, radius, half, 0.4 * half, LYING)
    built.part(METAL)
    if style == 0:
        built.cylinder(at, 0.6 * radius, 1.08 * half, 0.02, LYING)
    elif style == 1:
        built.ellipsoid(at, [0.5 * radius, 0.5 * radius, 1.5 * half])
    else:
        built.cylinder(at, 0.65 * radius, 1.04 * half, 0, LYING)
        for k in range(5):
            way = 1.2566 * k
            spot = at + 0.4 * radius * vec(np.cos(way), np.sin(way), 0)
            built.cylinder(spot, 0.13 * radius, 3 * half, 0, LYING, cut=True)


def _wheels(rng: Rng, built: Builder, xs: tuple[float, ...], radius: float, track: float) -> None:
    half, style = span(rng, 0.06, 0.1), int(rng.integers(3))
    for x in xs:
        for sign in (1, -1):
            _wheel(rng, built, vec(x, radius, sign * (track - 0.5 * half)), radius, half, style)


def _car(rng: Rng, built: Builder) -> None:
    """Saloons, hatchbacks, pick-ups, vans, racers and old round ones."""
    wheel, wide = span(rng, 0.17, 0.25), span(rng, 0.36, 0.46)
    long, sill = span(rng, 0.85, 1.1), span(rng, 0.1, 0.2)
    belt, roof = sill + span(rng, 0.28, 0.4), span(rng, 0.25, 0.42)
    kind = pick(rng, ("saloon", "hatch", "van", "pickup", "open", "round"))
    nose = span(rng, 0.75, 0.95)
    low = [[-long, sill], [long, sill], [long, sill + 0.2], [nose * long, belt * 0.9], [0.4 * long, belt],
           [-0.9 * long, belt], [-long, belt - 0.1]]  # fmt: skip
    built.part(BODY)
    built.prism([0, 0, 0], smooth(low, 2), wide, span(rng, 0.04, 0.12))
    xs = (-span(rng, 0.5, 0.62) * long, span(rng, 0.5, 0.65) * long)
    for x in xs:
        built.cylinder([x, wheel, 0], 1.18 * wheel, 2 * wide, 0, LYING, cut=True)
    front, back = {"saloon": (0.4, -0.6), "hatch": (0.4, -0.95), "van": (0.65, -0.97), "pickup": (0.4, -0.15),
                   "open": (0.3, 0.2), "round": (0.45, -0.75)}[kind]  # fmt: skip
    rake, fall = span(rng, 0.15, 0.35), 0.05 if kind in ("van", "pickup") else span(rng, 0.05, 0.35)
    cabin = np.array([[back * long, belt - 0.05], [front * long, belt - 0.05],
                      [(front - rake) * long, belt + roof], [(back + fall) * long, belt + roof]])  # fmt: skip
    if kind == "open":
        built.part(GLASS)
        built.box([front * long, belt + 0.08, 0], [0.015, 0.12, 0.85 * wide], 0.01, turned(0, 0, 0.5))
        for x in (0.05, -0.3):
            built.part(SEAT)
            built.box([x * long, belt, 0], [0.06, 0.2, 0.6 * wide], 0.05)
    else:
        built.part(GLASS)
        built.prism([0, 0, 0], smooth(cabin, 1 if kind != "round" else 2), 0.88 * wide, 0.05)
        built.part(BODY)
        top = np.array([cabin[3] + [0.02, -0.05], cabin[2] + [-0.02, -0.05], cabin[2] + [-0.06, 0.015],
                        cabin[3] + [0.06, 0.015]])  # fmt: skip
        built.prism([0, 0, 0], top, 0.9 * wide, 0.03)
        for t in (0.0, span(rng, 0.4, 0.6), 1.0):
            a, b = (cabin[0] * (1 - t) + cabin[1] * t, cabin[3] * (1 - t) + cabin[2] * t)
            for sign in (1, -1):
                built.limb([*a, sign * 0.86 * wide], [*b, sign * 0.86 * wide], 0.03, 0.025)
    _lights(rng, built, long, sill + 0.22, wide)
    _wheels(rng, built, xs, wheel, wide)


def _lights(rng: Rng, built: Builder, long: float, y: float, wide: float) -> None:
    built.part(METAL)
    size = span(rng, 0.04, 0.08)
    for sign in (1, -1):
        built.ellipsoid([0.97 * long, y, sign * 0.7 * wide], [0.6 * size, size, 1.2 * size])
        built.box([-0.98 * long, y, sign * 0.7 * wide], [0.03, size, size], 0.01)
    if chance(rng, 0.6):
        for x in (long, -long):
            built.box([x, y - 0.14, 0], [0.04, 0.04, 0.95 * wide], 0.02)


def _truck(rng: Rng, built: Builder) -> None:
    """A cab, and behind it a box, a bed, a tank or a mixer's drum; fire engines with ladders."""
    wheel, wide, long = span(rng, 0.14, 0.2), span(rng, 0.32, 0.42), span(rng, 1.0, 1.4)
    deck, cab = 1.5 * wheel, span(rng, 0.5, 0.8)
    built.part(METAL)
    built.box([0, deck - 0.04, 0], [long, 0.06, 0.8 * wide])
    x, half = long - 0.3, span(rng, 0.22, 0.3)
    built.part(BODY)
    slope = span(rng, 0, 0.15)
    outline = np.array([[-half, 0], [half, 0], [half, 0.45 * cab], [half - slope, cab], [-half, cab]])
    built.prism([x, deck, 0], smooth(outline, 1), wide, 0.04)
    if chance(rng, 0.4):  # a bonnet
        built.box([x + half + 0.15, deck + 0.2 * cab, 0], [0.2, 0.2 * cab + 0.02, 0.8 * wide], 0.05, soft=0.03)
    built.part(GLASS)
    built.box([x + half - 0.5 * slope, deck + 0.72 * cab, 0], [0.045, 0.17 * cab, 0.85 * wide], 0.01,
              turned(0, 0, np.arctan2(slope, 0.55 * cab)))  # fmt: skip
    built.box([x - 0.02, deck + 0.7 * cab, 0], [0.6 * half, 0.16 * cab, wide + 0.01], 0.01)
    rear, high = long - 0.35 - half, span(rng, 0.5, 0.95)
    middle = vec(x - half - rear + 0.02, deck, 0)
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
        for sign in (1, -1):
            built.limb(middle + [-rear, 0.5, 0.12 * sign], middle + [rear + 0.3, 0.75, 0.12 * sign], 0.03, 0.03)
    _lights(rng, built, long, deck + 0.1, wide)
    xs = (x + 0.1, -0.35 * long, -0.7 * long) if chance(rng, 0.5) else (x + 0.1, -0.6 * long)
    _wheels(rng, built, xs, wheel, wide)


def _bus(rng: Rng, built: Builder) -> None:
    wheel, wide, long = span(rng, 0.13, 0.18), span(rng, 0.28, 0.36), span(rng, 0.8, 1.4)
    storeys = pick(rng, (1, 1, 1, 2))
    high = 0.6 * span(rng, 0.9, 1.2) * (1 + 0.7 * (storeys - 1))
    sill = 0.7 * wheel
    built.part(BODY)
    built.prism([0, sill + 0.5 * high, 0], rounded(long, 0.5 * high, span(rng, 0.04, 0.2), 5), wide,
                span(rng, 0.03, 0.1))  # fmt: skip
    built.part(GLASS)
    for storey in range(storeys):
        y = sill + high * ((storey + 0.68) / storeys if storeys == 1 else (storey + 0.6) / storeys)
        tall = 0.17 * high / storeys
        panes = int(rng.integers(3, 7))
        for k in range(panes):
            x = long * ((2 * k + 1) / panes - 1)
            built.box([0.95 * x, y, 0], [0.8 * long / panes, tall, wide + 0.012], 0.01)
        built.box([long - 0.02, y, 0], [0.04, 1.15 * tall, 0.8 * wide], 0.01)
    _lights(rng, built, long, sill + 0.12, wide)
    _wheels(rng, built, (-0.6 * long, 0.62 * long), wheel, wide)


def _motorcycle(rng: Rng, built: Builder) -> None:
    """Motorcycles and scooters; often leaning."""
    wheel, base = span(rng, 0.26, 0.36), span(rng, 0.6, 0.75)
    for x in (base, -base):
        built.part(TYRE)
        built.ring([x, wheel, 0], 0.82 * wheel, 0.18 * wheel, turn=LYING)
        built.part(METAL)
        built.cylinder([x, wheel, 0], 0.65 * wheel if chance(rng, 0.4) else 0.25 * wheel, 0.05, 0.02, LYING)
    head = vec(0.45 * base, 0.85, 0)
    built.part(METAL)
    for z in (0.09, -0.09):
        built.limb([base, wheel, z], [*head[:2], z], 0.035, 0.035)
        built.limb([-base, wheel, z], [-0.1, 0.35, z], 0.035, 0.035)
    built.limb([*head[:2], -0.3], [*head[:2], 0.3], 0.03, 0.03)
    built.part(BODY)
    built.ellipsoid([0.12, 0.7, 0], [0.32, span(rng, 0.12, 0.2), 0.15], turned(0, 0, 0.15))
    built.part(SEAT)
    built.superquadric([-0.4, 0.66, 0], [span(rng, 0.25, 0.4), 0.08, 0.14], 0.6, 0.5, turned(0, 0, -0.1))
    built.part(METAL)
    built.box([0, 0.38, 0], [0.24, 0.16, 0.13], 0.05)
    built.limb([-0.1, 0.25, 0.15], [-1.0 * base, 0.28, 0.18], 0.04, 0.06)
    built.part(MORE)
    built.ellipsoid([0.58 * base, 0.78, 0], [0.1, 0.11, 0.11])
    for x in (base, -base):
        built.ring([x, wheel, 0], 1.12 * wheel, 0.05, span(rng, 0.7, 1.3),
                   turned(0, -np.pi / 2) @ turned(np.pi) @ turned(0, np.pi))  # fmt: skip
    if chance(rng, 0.4):  # a shield before the knees
        built.part(BODY)
        built.box([0.5 * base, 0.6, 0], [0.03, 0.3, 0.22], 0.02, turned(0, 0, 0.3))


def _bicycle(rng: Rng, built: Builder) -> None:
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


def _boat(rng: Rng, built: Builder) -> None:
    """Rowing boats, yachts and steamers: a hull cut open above."""
    long, wide, deep = 1.0, span(rng, 0.22, 0.4), span(rng, 0.25, 0.4)
    kind = pick(rng, ("open", "sail", "steam", "tug"))
    built.part(BODY)
    built.ellipsoid([0, deep, 0], [long, deep * 1.02, wide])
    built.ellipsoid([0.2, deep, 0], [1.05 * long, 0.5 * deep, 0.7 * wide], soft=0.1)
    built.box([0, 2 * deep, 0], [3, deep, 3], cut=True)
    built.ellipsoid([0, 1.08 * deep, 0], [0.92 * long, 0.7 * deep if kind == "open" else 0.2 * deep, 0.88 * wide],
                    cavity=True)  # fmt: skip
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
        built.limb([-0.3 + 0.25 * k, y - 0.1, 0], [-0.34 + 0.25 * k, y + span(rng, 0.15, 0.4), 0], 0.075, 0.07)


def _train(rng: Rng, built: Builder) -> None:
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
            built.limb([x, deck + 1.7 * boiler, 0], [x, deck + 2 * boiler + high, 0], r, r * span(rng, 0.8, 1.5))
    else:
        built.part(BODY)
        high, nose = span(rng, 0.55, 0.7), span(rng, 0.05, 0.4)
        outline = [[-1, 0], [1, 0], [1, 0.35 * high], [1 - nose, high], [-1, high]]
        built.prism([0, deck, 0], smooth(outline, 1), wide, 0.06)
        built.part(GLASS)
        for k in range(5):
            built.box([-0.8 + 0.33 * k, deck + 0.65 * high, 0], [0.12, 0.13 * high, wide + 0.01], 0.01)
    _wheels(rng, built, (-0.75, -0.4, 0.1, 0.5, 0.8)[: pick(rng, (4, 5))], wheel, 0.9 * wide)


def _tractor(rng: Rng, built: Builder) -> None:
    """Large wheels behind, small ones before; some have a shovel."""
    large, small = span(rng, 0.38, 0.5), span(rng, 0.2, 0.28)
    built.part(BODY)
    built.box([0.4, 0.55, 0], [0.5, 0.18, 0.18], 0.06)
    built.box([-0.3, 0.5, 0], [0.35, 0.12, 0.2], 0.04)
    half, style = 0.11, int(rng.integers(3))
    for sign in (1, -1):
        _wheel(rng, built, vec(-0.5, large, sign * 0.4), large, 1.2 * half, style)
        _wheel(rng, built, vec(0.7, small, sign * 0.3), small, 0.8 * half, style)
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


def _pram(rng: Rng, built: Builder) -> None:
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
        built.limb([-half[0], y, sign * 0.8 * half[2]], [-half[0] - 0.4, y + 0.35, sign * 0.8 * half[2]], 0.03, 0.03)
    built.limb([-half[0] - 0.4, y + 0.35, -half[2]], [-half[0] - 0.4, y + 0.35, half[2]], 0.03, 0.03)
    for x in (-0.6, 0.6):
        built.limb([x * half[0], wheel, -half[2]], [x * half[0], wheel, half[2]], 0.025, 0.025)
        built.limb([x * half[0], wheel, 0], [x * half[0], y - half[1], 0], 0.04, 0.04)
    _wheels(rng, built, (-0.6 * half[0], 0.6 * half[0]), wheel, half[2] + 0.06)
