"""Things with corners: cartons, books, devices, cases, houses and towers."""

from __future__ import annotations

import itertools

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .buildings import buildings, house, tower
from .making import Rng, chance, ngon, pick, rounded, span, vec

BODY, FRONT, KNOB, MORE, GLASS = range(5)


def boxes(rng: Rng) -> PrimitiveBuilder:
    """Make a box with its details."""
    kinds = (
        _carton,
        _books,
        _radio,
        _television,
        _camera,
        _suitcase,
        house,
        house,
        _toaster,
        _phone,
        _brick,
        _parcel,
        tower,
        buildings,
        _dice,
        _washer,
        _stack,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _size(rng: Rng, x: float, y: float, z: float) -> F64:
    """(3,) half sizes, varied."""
    return vec(x, y, z) * np.exp(rng.normal(0, 0.2, 3))


def _dials(rng: Rng, built: PrimitiveBuilder, half: F64, count: int, size: float) -> None:
    """Knobs on the front (+z) of a box that stands on the ground."""
    for _ in range(count):
        built.part(pick(rng, (KNOB, KNOB, MORE)))
        at = vec(*(half[:2] * rng.uniform(-0.8, 0.8, 2)), half[2]) + [0, half[1], 0]
        own = size * span(rng, 0.6, 1.3)
        if chance(rng, 0.7):
            built.cylinder(at, own, 0.5 * own, 0.1 * own, turned(0, np.pi / 2))
        else:
            built.box(at, [1.4 * own, 0.6 * own, 0.4 * own], 0.1 * own)


def _carton(rng: Rng, built: PrimitiveBuilder) -> None:
    """A box, shut or open with its flaps out."""
    half = _size(rng, 0.7, 0.5, 0.5)
    built.part(BODY)
    built.box([0, half[1], 0], half, span(rng, 0, 0.03))
    if chance(rng, 0.5):
        wall = 0.035
        built.box([0, 2 * half[1], 0], half * [1, 1.9, 1] - wall, 0, cavity=True)
        for sign in (1, -1):
            for axis, wide, long in ((0, half[2], half[0]), (2, half[0], half[2])):
                if chance(rng, 0.2):
                    continue
                built.part(pick(rng, (BODY, BODY, FRONT)))
                out, flap = span(rng, -0.4, 1.3), 0.48 * long
                way = vec(0, 0, 0)
                way[axis] = sign * np.cos(out)
                way[1] = np.sin(out)
                at = vec(0, 2 * half[1], 0)
                at[axis] = sign * long
                turn = turned(0, 0, sign * out) if axis == 0 else turned(0, -sign * out)
                own = vec(flap, 0.02, wide) if axis == 0 else vec(wide, 0.02, flap)
                built.box(at + flap * way, own, 0.005, turn)
    elif chance(rng, 0.6):
        built.part(FRONT)  # tape
        built.box([0, half[1], 0], half * [1, 1, 0.12] + [0.008, 0.008, 0])


def _books(rng: Rng, built: PrimitiveBuilder) -> None:
    """A pile of books, or one that stands."""
    y, is_standing = 0.0, chance(rng, 0.25)
    for k in range(1 if is_standing else rng.integers(1, 6)):
        half = _size(rng, 0.5, 0.1, 0.7)
        turn = turned(rng.normal(0, 0.25))
        if is_standing:
            turn = turned(span(rng, 0, 6)) @ turned(0, 0, np.pi / 2 + span(rng, -0.1, 0.1))
        lift = vec(0, half[0] if is_standing else y + half[1], 0)
        cover = span(rng, 0.012, 0.03)
        built.part(10 + k)
        built.box(lift, half, 0.01, turn)
        built.box(lift + turn @ vec(0.07, 0, 0), half - [0, cover, -0.1], 0, turn, cut=True)
        built.part(MORE)
        built.box(lift, half - [0.03, cover, 0.03], 0, turn)
        y += 2 * half[1]


def _radio(rng: Rng, built: PrimitiveBuilder) -> None:
    """With loudspeakers, a dial, knobs, an aerial, a bow."""
    half = _size(rng, 0.8, 0.45, 0.25)
    built.part(BODY)
    if chance(rng, 0.3):  # an arched top
        arch = np.concatenate(
            [[[-half[0], 0]], [[half[0], 0]], vec(0, half[1]) + half[:2] * ngon(16)[:9]]
        )
        built.prism([0, 0, 0], arch, half[2], 0.03)
    else:
        built.box([0, half[1], 0], half, span(rng, 0.02, 0.2))
    built.part(FRONT)
    for sign in (1, -1)[: pick(rng, (1, 2))]:
        at = vec(sign * 0.55 * half[0], half[1], half[2])
        built.cylinder(at, 0.6 * min(half[1], 0.6 * half[0]), 0.03, 0.02, turned(0, np.pi / 2))
    built.part(GLASS)
    built.box([0, 1.4 * half[1], half[2]], [0.3 * half[0], 0.18 * half[1], 0.03], 0.01)
    _dials(rng, built, half, int(rng.integers(1, 5)), 0.07)
    if chance(rng, 0.6):
        built.part(KNOB)
        start = vec(span(rng, -0.8, 0.8) * half[0], 1.9 * half[1], -0.5 * half[2])
        built.limb(start, start + vec(span(rng, -0.6, 0.6), span(rng, 0.5, 1), 0), 0.02, 0.014)
    if chance(rng, 0.4):
        built.part(KNOB)
        built.ring([0, 2 * half[1], 0], 0.5 * half[0], 0.035, 1.57, turned(0, -np.pi / 2))


def _television(rng: Rng, built: PrimitiveBuilder) -> None:
    """Flat, or deep like the old ones; with feet or a stand."""
    is_flat = chance(rng, 0.5)
    half = _size(rng, 1.0, 0.6, 0.05 if is_flat else 0.45)
    lift, rim = span(rng, 0.08, 0.35), span(rng, 0.04, 0.15)
    middle = vec(0, lift + half[1], 0)
    built.part(BODY)
    built.box(middle, half, min(0.04, 0.4 * half[2]) if is_flat else span(rng, 0.03, 0.15))
    if not is_flat and chance(rng, 0.6):
        built.box(middle - [0, 0, 1.2 * half[2]], half * [0.7, 0.7, 0.7], 0.08, soft=0.1)
    screen = half - [rim, rim, 0]
    screen[0] -= 0 if is_flat else span(rng, 0, 0.25)
    built.box(
        middle + [screen[0] - half[0] + rim, 0, 1.02 * half[2]],
        [screen[0], screen[1], 0.03],
        cut=True,
    )
    built.part(GLASS)
    at = middle + [screen[0] - half[0] + rim, 0, 0.0]
    if is_flat:
        built.box(at + [0, 0, half[2] - 0.045], [screen[0], screen[1], 0.02])
    else:
        built.ellipsoid(at + [0, 0, half[2] - 0.18], [1.35 * screen[0], 1.35 * screen[1], 0.2])
        built.box(at + [0, 0, half[2]], [screen[0], screen[1], 0.2], keep=True)
    built.part(KNOB)
    if chance(rng, 0.5):
        built.box([0, 0.5 * lift, 0], [0.08, 0.5 * lift + 0.02, 0.04])
        built.box([0, 0.03, 0], [0.4 * half[0], 0.03, 0.25], 0.02)
    else:
        for x in (-0.7, 0.7):
            built.limb(
                [0.9 * x * half[0], lift + 0.02, 0], [x * half[0] * 1.2, 0.03, 0.12], 0.04, 0.03
            )
            built.limb(
                [0.9 * x * half[0], lift + 0.02, 0], [x * half[0] * 1.2, 0.03, -0.12], 0.04, 0.03
            )


def _camera(rng: Rng, built: PrimitiveBuilder) -> None:
    """With a lens, a hump, a grip, buttons."""
    half = _size(rng, 0.6, 0.38, 0.22)
    built.part(BODY)
    built.box([0, half[1], 0], half, span(rng, 0.03, 0.12))
    if chance(rng, 0.6):
        built.box(
            [span(rng, -0.2, 0.2), 2.1 * half[1], 0], [0.2, 0.15, 0.9 * half[2]], 0.06, soft=0.05
        )
    if chance(rng, 0.5):
        built.limb([-half[0], 0.15, 0.1], [-half[0], 1.8 * half[1], 0.1], 0.13, 0.13, soft=0.05)
    y, z, x = half[1], half[2], span(rng, -0.15, 0.25)
    for part, radius in zip((FRONT, KNOB, GLASS), (0.75, 0.66, 0.55), strict=True):
        built.part(part)
        long = span(rng, 0.05, 0.25) if part != GLASS else 0.01
        built.cylinder(
            [x, y, z + long], radius * 0.9 * half[1], long + 0.02, 0.02, turned(0, np.pi / 2)
        )
        z += 1.9 * long
    for _ in range(rng.integers(1, 4)):
        built.part(KNOB)
        built.cylinder(
            [span(rng, -0.8, 0.8) * half[0], 2.05 * half[1], 0], span(rng, 0.05, 0.12), 0.06, 0.01
        )


def _suitcase(rng: Rng, built: PrimitiveBuilder) -> None:
    """With straps, a bow and locks."""
    half = _size(rng, 0.75, 0.5, 0.2)
    built.part(BODY)
    built.box([0, half[1], 0], half, span(rng, 0.04, 0.15))
    built.part(FRONT)
    for x in (-0.5, 0.5):
        if chance(rng, 0.7):
            built.box([x * half[0], half[1], 0], [0.06, half[1] + 0.012, half[2] + 0.012], 0.02)
    built.part(KNOB)
    built.ring([0, 2 * half[1], 0], span(rng, 0.15, 0.25), 0.035, 1.57, turned(0, -np.pi / 2))
    for sign in (1, -1):
        built.box([sign * 0.5 * half[0], 1.85 * half[1], half[2]], [0.06, 0.07, 0.03], 0.01)
    if chance(rng, 0.4):
        for x in (-0.8, 0.8):
            for z in (-0.7, 0.7):
                built.ellipsoid([x * half[0], -0.03, z * half[2]], [0.07, 0.07, 0.05])


def _toaster(rng: Rng, built: PrimitiveBuilder) -> None:
    """Rounded, with one or two slots."""
    half = _size(rng, 0.6, 0.4, 0.3)
    built.part(BODY)
    built.prism(
        [0, half[1], 0],
        rounded(half[2], half[1], span(rng, 0.08, 0.28), 6),
        half[0],
        0.05,
        turned(np.pi / 2),
    )
    slots = pick(rng, (1, 2, 2))
    for k in range(slots):
        z = (k - 0.5 * (slots - 1)) * 0.8 * half[2]
        built.box([0, 2 * half[1], z], [0.75 * half[0], 0.3, 0.07], cavity=True)
    if chance(rng, 0.4):
        built.part(MORE)
        built.box(
            [0, 2 * half[1] + 0.1, 0.4 * half[2] * (slots - 1)], [0.55 * half[0], 0.35, 0.05], 0.04
        )
    built.part(KNOB)
    built.box([half[0] + 0.04, span(rng, 0.8, 1.6) * half[1], 0], [0.07, 0.04, 0.1], 0.02)
    built.cylinder(
        [half[0], 0.4 * half[1], 0.4 * half[2]], 0.06, 0.05, 0.01, turned(0, 0, np.pi / 2)
    )


def _phone(rng: Rng, built: PrimitiveBuilder) -> None:
    """A telephone to carry, a tablet or a laptop."""
    half = _size(rng, 0.45, 0.04, 0.85)
    turn = turned(span(rng, 0, 6)) @ turned(0, span(rng, 0, 1.4), rng.normal(0, 0.3))
    flat = turn @ turned(0, np.pi / 2)
    built.part(BODY)
    built.prism([0, 0, 0], rounded(half[0], half[2], span(rng, 0.03, 0.15), 5), half[1], 0.02, flat)
    built.part(GLASS)
    built.box(turn @ vec(0, half[1], 0), half * [0.9, 0, 0.86] + [0, 0.012, 0], 0.008, turn)
    if chance(rng, 0.4):  # keys
        built.part(BODY)
        lid = turn @ turned(0, -span(rng, 1.4, 2.0))
        at = turn @ vec(0, 0, -half[2])
        built.box(at + lid @ vec(0, 0, half[2]), half * [1, 0.7, 1], 0.015, lid)
    elif chance(rng, 0.5):
        built.part(KNOB)
        for x in (-0.6, -0.2):
            built.cylinder(
                turn @ vec(x * half[0], -half[1], -0.8 * half[2]), 0.07, 0.03, 0.01, turn
            )


def _brick(rng: Rng, built: PrimitiveBuilder) -> None:
    """A brick with holes, or a toy's with studs."""
    half = _size(rng, 0.7, 0.28, 0.35)
    built.part(BODY)
    built.box([0, half[1], 0], half, span(rng, 0, 0.05))
    columns, rows = pick(rng, ((3, 1), (4, 2), (2, 2), (3, 2)))
    size = 0.6 * min(half[0] / columns, half[2] / rows)
    is_toy = chance(rng, 0.6)
    for i in range(columns):
        for j in range(rows):
            at = vec(
                (2 * i + 1 - columns) / columns * half[0],
                2 * half[1],
                (2 * j + 1 - rows) / rows * half[2],
            )
            built.cylinder(at, size, 0.1 if is_toy else 4.0, 0.01, cut=not is_toy)


def _parcel(rng: Rng, built: PrimitiveBuilder) -> None:
    """Wrapped, with a ribbon and a bow."""
    half = _size(rng, 0.55, 0.4, 0.55)
    built.part(BODY)
    built.box([0, half[1], 0], half, 0.015)
    if chance(rng, 0.5):
        built.part(BODY)
        built.box([0, 1.75 * half[1], 0], half * [1.06, 0.27, 1.06], 0.01)
    wide = span(rng, 0.04, 0.12)
    edge = half * 1.06 + 0.015
    built.part(FRONT)
    built.box([0, half[1], 0], [wide, half[1] + 0.03, edge[2]], 0.01)
    built.box([0, half[1], 0], [edge[0], half[1] + 0.03, wide], 0.01)
    for sign in (1, -1):
        built.part(FRONT)
        turn = turned(span(rng, -0.5, 0.5), 0, sign * 0.5)
        built.ellipsoid(vec(sign * 0.22, 2 * half[1] + 0.16, 0), [0.22, 0.07 + wide, 0.1], turn)
    built.ellipsoid([0, 2 * half[1] + 0.07, 0], [0.09, 0.08, 0.09])


def _dice(rng: Rng, built: PrimitiveBuilder) -> None:
    """With spots cut in."""
    turn = turned(span(rng, 0, 6), *(rng.normal(0, 0.5, 2) * (rng.random() < 0.5)))
    built.part(BODY)
    built.box([0, 0, 0], [0.5, 0.5, 0.5], span(rng, 0.03, 0.2), turn)
    spots = (
        [[0, 0]],
        [[-1, -1], [1, 1]],
        [[-1, -1], [0, 0], [1, 1]],
        [[-1, 1], [1, 1], [-1, -1], [1, -1]],
    )
    for k, way in enumerate((vec(0, 0, 1), vec(0, 1, 0), vec(1, 0, 0), vec(0, 0, -1))):
        side, up = np.roll(way, 1), np.roll(way, 2)
        for x, y in spots[k]:
            built.ellipsoid(
                turn @ (0.52 * way + 0.25 * (x * side + y * up)), np.full(3, 0.09), cut=True
            )


def _washer(rng: Rng, built: PrimitiveBuilder) -> None:
    """A washing machine, an oven, a refrigerator, a cupboard."""
    half = _size(rng, 0.5, 0.65, 0.48)
    built.part(BODY)
    built.box([0, half[1], 0], half, span(rng, 0.01, 0.06))
    kind = pick(rng, ("round", "door", "doors"))
    if kind == "round":
        for part, radius, z in ((KNOB, 0.62, 0.02), (GLASS, 0.48, 0.05)):
            built.part(part)
            built.cylinder(
                [0, 0.9 * half[1], half[2]], radius * min(half[:2]), z, 0.015, turned(0, np.pi / 2)
            )
    else:
        edges = (-1, 1) if kind == "door" else (-1, span(rng, -0.3, 0.5), 1)
        for low, high in itertools.pairwise(edges):
            built.part(FRONT)
            at = half[1] * (1 + 0.5 * (low + high))
            tall = 0.5 * (high - low) * half[1] - 0.03
            built.box([0, at, half[2]], [0.95 * half[0], tall, 0.04], 0.02)
            built.part(KNOB)
            built.limb(
                [0.8 * half[0], at - 0.4 * tall, half[2] + 0.09],
                [0.8 * half[0], at + 0.4 * tall, half[2] + 0.09],
                0.025,
                0.025,
            )
    built.part(MORE)
    _dials(rng, built, half * [1, 1, 1], int(rng.integers(0, 4)), 0.05)


def _stack(rng: Rng, built: PrimitiveBuilder) -> None:
    """A child's tower of blocks: boxes, drums and arches."""
    y = 0.0
    for k in range(rng.integers(2, 6)):
        half = _size(rng, 0.4, 0.2, 0.3)
        turn = turned(rng.normal(0, 0.3))
        built.part(20 + k % 4)
        at = vec(rng.normal(0, 0.06), y + half[1], rng.normal(0, 0.05))
        kind = pick(rng, ("box", "box", "drum", "arch"))
        if kind == "drum":
            built.cylinder(at, half[2], half[1], 0.02)
        else:
            built.box(at, half, 0.02, turn)
        if kind == "arch":
            lying = turn @ turned(0, np.pi / 2)
            built.cylinder(at - [0, half[1], 0], 1.3 * half[1], 1.0, 0, lying, cut=True)
        y += 2 * half[1]
    if chance(rng, 0.5):
        built.part(30)
        built.prism([0, y, 0], np.array([[-0.4, 0], [0.4, 0], [0, 0.4]]), 0.25, 0.01)
