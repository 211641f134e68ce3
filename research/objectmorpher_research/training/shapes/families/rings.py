"""Things with a hole or a bend: rings, tubes, chains, tyres, wreaths, knots, springs, frames."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..solid import PrimitiveBuilder, turned
from .making import Rng, chance, curve, ngon, pick, rounded, span, tube, vec

BODY, MORE, THIRD = range(3)


def rings(rng: Rng) -> PrimitiveBuilder:
    """Make one that lies, stands or hangs."""
    kinds = (
        _torus,
        _torus,
        _bent_tube,
        _bent_tube,
        _chain,
        _tyre,
        _wreath,
        _knot,
        _spring,
        _hook,
        _pipes,
        _frame,
        _frame,
        _washers,
        _links,
        _basket,
        _headphones,
        _glasses,
    )
    built = PrimitiveBuilder()
    pick(rng, kinds)(rng, built)
    return built


def _any_turn(rng: Rng) -> F64:
    """Anyhow, upright, or lying."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    upright = turned(span(rng, 0, 6)) @ turned(0, np.pi / 2)
    lying = turned(0, *rng.normal(0, 0.15, 2))
    return pick(rng, (turn * np.sign(np.linalg.det(turn)), upright, lying))


def _torus(rng: Rng, built: PrimitiveBuilder) -> None:
    """A ring or an arc of one, a doughnut with icing, a finger ring with a stone."""
    turn, thick = _any_turn(rng), span(rng, 0.08, 0.42)
    half = np.pi if chance(rng, 0.6) else span(rng, 0.6, 2.8)
    built.part(BODY)
    built.ring([0, 0, 0], 1.0, thick, half, turn)
    kind = rng.random()
    if kind < 0.3:
        built.part(MORE)
        built.ring(turn @ vec(0, 0.25 * thick, 0), 1.0, 0.92 * thick, half, turn)
    elif kind < 0.5:
        built.part(MORE)
        built.superquadric(
            turn @ vec(0, 0, 1 + thick), np.full(3, span(rng, 0.15, 0.35)), 0.7, 0.6, turn
        )
    elif kind < 0.75:
        for _k in range(rng.integers(2, 9)):
            built.part(MORE)
            way = span(rng, -half, half)
            at = vec(np.sin(way), span(rng, 0.5, 1) * thick, np.cos(way))
            built.ellipsoid(turn @ at, np.full(3, span(rng, 0.4, 0.8) * thick + 0.02))


def _bent_tube(rng: Rng, built: PrimitiveBuilder) -> None:
    """Along a smooth line: hoses, snakes, worms, sausages, ropes, horns."""
    count = int(rng.integers(4, 8))
    steps = rng.normal(0, 1, (count, 3)) * [1, span(rng, 0.1, 1), 1]
    knots = np.cumsum(steps / np.linalg.norm(steps, axis=1, keepdims=True), 0)
    is_closed = chance(rng, 0.25)
    thick = span(rng, 0.08, 0.35)
    far = thick if is_closed else thick * pick(rng, (1.0, 1.0, 0.6, 0.2))
    built.part(BODY)
    line = curve(knots, min(5 * count, 28), is_closed)
    tube(built, line, thick, far, is_closed)
    if not is_closed and chance(rng, 0.5):
        built.part(MORE)
        size = thick * span(rng, 1.1, 1.7)
        built.ellipsoid(line[0], size * np.exp(rng.normal(0, 0.2, 3)))


def _chain(rng: Rng, built: PrimitiveBuilder) -> None:
    """Links along a line, each turned against the last; a clasp or a pendant."""
    count = int(rng.integers(4, 11))
    bow = span(rng, -0.25, 0.25)
    at, way, flat = np.zeros(3), 0.0, turned(span(rng, 0, 3), rng.normal(0, 0.5))
    small = span(rng, 0.07, 0.13)
    for k in range(count):
        step = vec(np.cos(way), np.sin(way), 0)
        axes = turned(0, 0, way) @ turned(0, np.pi / 2 * (k % 2))
        built.part(BODY if k % 2 or chance(rng, 0.8) else MORE)
        for sign in (1, -1):
            side = axes @ vec(0, 0, 0.24 * sign)
            built.limb(
                flat @ (at + side - 0.15 * step), flat @ (at + side + 0.15 * step), small, small
            )
            end = flat @ axes @ turned(sign * np.pi / 2)
            built.ring(flat @ (at + sign * 0.15 * step), 0.24, small, np.pi / 2, end)
        at = at + (0.78 - 2 * small) * step
        way += bow + rng.normal(0, 0.1)


def _tyre(rng: Rng, built: PrimitiveBuilder) -> None:
    """A tyre with its tread, alone or piled up; or on its rim."""
    large, small = span(rng, 0.5, 0.8), span(rng, 0.15, 0.3)
    piled = pick(rng, (1, 1, 2, 3))
    turn = turned(0, np.pi / 2) if piled == 1 and chance(rng, 0.5) else np.eye(3)
    for k in range(piled):
        shift = vec(0, 1.9 * small * k, 0) + (rng.normal(0, 0.06, 3) * [1, 0, 1] if k else 0)
        built.part(BODY)
        built.cylinder(turn @ shift, large + small, small, 0.6 * small, turn)
        built.cylinder(turn @ shift, large - 0.3 * small, 2 * small, 0, turn, cut=True)
        built.ring(turn @ shift, large - 0.2 * small, 0.75 * small, turn=turn, cut=True)
        if piled == 1:
            for j in range(14):
                spin = turn @ turned(j * 0.4488)
                built.box(
                    spin @ vec(0, 0, large + 1.02 * small),
                    [0.03, 2 * small, 0.04],
                    0,
                    spin,
                    cut=True,
                )
    if piled == 1 and chance(rng, 0.5):
        built.part(MORE)
        built.cylinder([0, 0, 0], large - 0.28 * small, 0.3 * small, 0.02, turn)
        for j in range(5):
            at = turned(j * 1.2566) @ vec(0, 0, 0.55 * large)
            built.cylinder(turn @ at, 0.15 * large, small, 0, turn, cut=True)


def _wreath(rng: Rng, built: PrimitiveBuilder) -> None:
    """Balls, leaves or lumps on a ring."""
    turn, count, size = _any_turn(rng), int(rng.integers(10, 24)), span(rng, 0.12, 0.25)
    built.part(BODY)
    built.ring([0, 0, 0], 1.0, 0.5 * size, turn=turn)
    kind = pick(rng, ("ball", "leaf", "mixed"))
    for k in range(count):
        built.part(pick(rng, (BODY, MORE, MORE, THIRD)))
        spin = turn @ turned(k * 2 * np.pi / count + rng.normal(0, 0.05))
        at = spin @ vec(0, rng.normal(0, 0.4) * size, 1 + rng.normal(0, 0.3) * size)
        if kind == "ball" or (kind == "mixed" and chance(rng, 0.4)):
            built.ellipsoid(at, np.full(3, size * span(rng, 0.5, 1)))
        else:
            leaf = spin @ turned(*rng.normal(0, 0.6, 3))
            built.ellipsoid(at, size * vec(1.5, 0.25, 0.7), leaf)


def _knot(rng: Rng, built: PrimitiveBuilder) -> None:
    """A torus knot; the trefoil is the simplest."""
    p, q = pick(rng, ((2, 3), (3, 2), (2, 5), (1, 3), (1, 4), (3, 1)))
    t = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    wide = span(rng, 0.3, 0.5)
    r = 1 + wide * np.cos(q * t)
    line = np.stack([r * np.cos(p * t), wide * np.sin(q * t), r * np.sin(p * t)], 1)
    built.part(BODY)
    tube(built, line @ _any_turn(rng).T, span(rng, 0.08, 0.2), is_closed=True)


def _spring(rng: Rng, built: PrimitiveBuilder) -> None:
    """A coil, a telephone's cord, a corkscrew."""
    turns, high = span(rng, 2.0, 4.5), span(rng, 0.8, 2.5)
    count = min(int(9 * turns), 38)
    t = np.linspace(0, 1, count)
    radius = np.linspace(0.6, pick(rng, (0.6, 0.6, 0.25, 0.9)), count)
    angle = 2 * np.pi * turns * t
    line = np.stack([radius * np.cos(angle), high * t, radius * np.sin(angle)], 1)
    thick = min(span(rng, 0.05, 0.14), 0.4 * high / turns)
    turn = _any_turn(rng) if chance(rng, 0.5) else np.eye(3)
    for k in range(0, count - 1, 6):  # parts are short, so that rays pass most of them by
        built.part(BODY)
        tube(built, line[k : k + 7] @ turn.T, thick)
    if chance(rng, 0.4):
        built.part(MORE)
        for end in (line[0], line[-1]):
            middle = end * [0, 1, 0]
            built.cylinder(turn @ middle, 0.7, 0.06, 0.02, turn)


def _hook(rng: Rng, built: PrimitiveBuilder) -> None:
    """Hooks, canes, clothes hangers, question marks, anchors."""
    thick = span(rng, 0.06, 0.16)
    kind = pick(rng, ("cane", "hanger", "anchor", "ess"))
    flat = turned(span(rng, 0, 6), rng.normal(0, 0.4))
    built.part(BODY)
    if kind == "hanger":
        line = np.array([[0, 0.25, 0], [-1, -0.3, 0], [1, -0.3, 0], [0, 0.25, 0], [0, 0.45, 0]])
        tube(built, line @ flat.T, 0.6 * thick)
        built.part(MORE)
        bow = curve([[0, 0.4, 0], [0.15, 0.6, 0], [0.0, 0.8, 0], [-0.17, 0.65, 0]], 8)
        tube(built, bow @ flat.T, 0.5 * thick)
        return
    if kind == "anchor":
        bow = curve(
            [[-0.7, -0.3, 0], [-0.55, -0.7, 0], [0, -0.95, 0], [0.55, -0.7, 0], [0.7, -0.3, 0]], 11
        )
        tube(built, bow @ flat.T, thick)
        built.limb(flat @ vec(0, -0.95, 0), flat @ vec(0, 0.7, 0), thick, thick)
        built.limb(flat @ vec(-0.4, 0.45, 0), flat @ vec(0.4, 0.45, 0), 0.8 * thick, 0.8 * thick)
        built.part(MORE)
        built.ring(flat @ vec(0, 0.9, 0), 0.18, 0.06, turn=flat @ turned(0, np.pi / 2))
        return
    top = [[0, 0.6, 0], [0.1, 0.95, 0], [0.4, 1.1, 0], [0.7, 0.9, 0], [0.72, 0.6, 0]]
    low = (
        [[0, -1.2, 0]]
        if kind == "cane"
        else [[-0.6, -0.7, 0], [-0.4, -1.0, 0], [-0.05, -0.8, 0], [0, -0.3, 0]]
    )
    tube(built, curve(np.array(low + top), 18) @ flat.T, thick, thick * span(rng, 0.6, 1.1))
    if chance(rng, 0.5):
        built.part(MORE)
        built.ellipsoid(flat @ np.array(top[-1]), np.full(3, 1.4 * thick))


def _pipes(rng: Rng, built: PrimitiveBuilder) -> None:
    """Straight pieces with elbows, flanges and a tap."""
    at, way, thick = np.zeros(3), vec(1, 0, 0), span(rng, 0.12, 0.25)
    axes = [vec(*row) for row in np.concatenate([np.eye(3), -np.eye(3)])]
    for _ in range(rng.integers(2, 6)):
        end = at + way * span(rng, 0.5, 1.2)
        built.part(BODY)
        built.limb(at, end, thick, thick)
        if chance(rng, 0.7):
            built.part(MORE)
            helper = np.eye(3)[:, np.argsort(np.abs(way))]
            turn = np.column_stack([helper[:, 0], way, np.cross(helper[:, 0], way)])
            built.cylinder(0.5 * (at + end), 1.35 * thick, 0.35 * thick, 0.02, turn)
        at = end
        way = pick(rng, [a for a in axes if abs(a @ way) < 0.5])
    if chance(rng, 0.5):
        built.part(THIRD)
        built.limb(at, at + vec(0, 2.2 * thick, 0), 0.4 * thick, 0.4 * thick)
        built.ring(at + vec(0, 2.3 * thick, 0), 1.2 * thick, 0.25 * thick)


def _frame(rng: Rng, built: PrimitiveBuilder) -> None:
    """Picture frames, mirrors, windows, doors: a hole cut into a board."""
    half, deep = vec(span(rng, 0.5, 1.0), span(rng, 0.5, 1.2)), span(rng, 0.03, 0.12)
    rim = span(rng, 0.08, 0.3) * float(half.min())
    turn = turned(span(rng, 0, 6)) @ turned(0, -span(rng, 0, 0.5))
    built.part(BODY)
    kind = pick(rng, ("square", "square", "round", "arch"))
    if kind == "round":
        outline, hole = ngon(24) * half, ngon(24) * (half - rim)
    elif kind == "arch":
        outline, hole = (
            np.concatenate([[[-h[0], -h[1]], [h[0], -h[1]]], ngon(20)[:11] * h * [1, 0.5]])
            for h in (half, half - rim)
        )
    else:
        round_ = span(rng, 0.0, 0.3) * float(half.min()) + 0.01
        outline, hole = (rounded(h[0], h[1], round_, 3) for h in (half, half - rim))
    built.prism([0, 0, 0], outline, deep, min(0.4 * deep, 0.03), turn)
    built.prism([0, 0, 0], hole, 3 * deep, 0, turn, cut=True)
    if chance(rng, 0.5):  # a picture or a pane; otherwise one looks through
        built.part(MORE)
        built.prism(turn @ vec(0, 0, -0.4 * deep), hole * 1.05, 0.35 * deep + 0.01, 0, turn)
    elif chance(rng, 0.5):
        built.part(BODY)
        for x in np.linspace(-1, 1, int(rng.integers(3, 5)))[1:-1]:
            built.box(turn @ vec(x * half[0], 0, 0), [0.04, half[1], 0.5 * deep], 0.01, turn)
        built.box([0, 0, 0], [half[0] - 0.02, 0.04, 0.5 * deep], 0.01, turn)
    if chance(rng, 0.3):
        built.part(BODY)
        leg = turn @ vec(0, -0.8 * half[1], -0.6 * half[1])
        built.limb(turn @ vec(0, 0.3 * half[1], -deep), leg, 0.04, 0.04)


def _washers(rng: Rng, built: PrimitiveBuilder) -> None:
    """Rings on a peg, rolls of tape and paper, a nut."""
    wide = span(rng, 0.6, 1.0)
    if chance(rng, 0.5):
        y = 0.0
        for k in range(rng.integers(2, 6)):
            small = span(rng, 0.1, 0.18)
            built.part(10 + k)
            built.ring([rng.normal(0, 0.02), y + small, 0], wide * (1 - 0.12 * k) - small, small)
            y += 1.95 * small
        built.part(MORE)
        built.limb([0, 0, 0], [0, y + 0.15, 0], 0.12, 0.12)
        built.cylinder([0, -0.05, 0], wide, 0.05, 0.02)
        return
    turn, high = _any_turn(rng), span(rng, 0.15, 0.8)
    built.part(BODY)
    if chance(rng, 0.4):
        built.prism([0, 0, 0], ngon(6), high, 0.04, turn @ turned(0, np.pi / 2))
    else:
        built.cylinder([0, 0, 0], 1.0, high, 0.02, turn)
    built.cylinder([0, 0, 0], span(rng, 0.3, 0.8), 2 * high, 0, turn, cut=True)


def _links(rng: Rng, built: PrimitiveBuilder) -> None:
    """A bunch of rings, a key ring with keys."""
    built.part(BODY)
    built.ring([0, 0.9, 0], 0.35, 0.045, turn=turned(span(rng, 0, 0.5), np.pi / 2))
    for k in range(rng.integers(1, 5)):
        built.part(10 + k)
        turn = turned(rng.normal(0, 0.5), 0, rng.normal(0, 0.5))
        at = vec(0, 0.55, 0.08 * k)
        built.cylinder(at, 0.2, 0.035, 0.01, turn @ turned(0, np.pi / 2))
        built.cylinder(
            at + turn @ vec(0, 0.1, 0), 0.06, 0.2, 0, turn @ turned(0, np.pi / 2), cut=True
        )
        built.box(at + turn @ vec(0, -0.55, 0), [0.06, 0.4, 0.03], 0.01, turn)
        for y in rng.uniform(-0.9, -0.6, 3):
            built.box(at + turn @ vec(0.08, y, 0), [0.06, 0.04, 0.03], 0.005, turn)


def _basket(rng: Rng, built: PrimitiveBuilder) -> None:
    """A basket or a bucket with a bow over it."""
    wide, high = span(rng, 0.5, 0.8), span(rng, 0.3, 0.6)
    built.part(BODY)
    built.cylinder([0, 0.5 * high, 0], wide, 0.5 * high, 0.08)
    built.cylinder([0, high, 0], wide - 0.07, 0.85 * high, 0.05, cavity=True)
    for y in np.arange(0.1, high, 0.14):
        built.ring([0, y, 0], wide, 0.045)
    built.part(MORE)
    built.ring(
        [0, high - 0.04, 0],
        wide - 0.02,
        0.045,
        np.pi / 2,
        turned(0, -np.pi / 2 + span(rng, -0.6, 0.6)),
    )
    for k in range(rng.integers(0, 6)):
        built.part(THIRD)
        at = 0.55 * wide * vec(np.cos(1.3 * k), 0, np.sin(1.3 * k))
        built.ellipsoid(at + [0, 0.75 * high, 0], np.full(3, span(rng, 0.14, 0.24)))


def _headphones(rng: Rng, built: PrimitiveBuilder) -> None:
    """A band over two cups."""
    built.part(BODY)
    turn = turned(0, -np.pi / 2)
    built.ring([0, 0, 0], 0.7, span(rng, 0.05, 0.09), 1.6, turn)
    lying, wide = turned(0, 0, np.pi / 2), span(rng, 0.22, 0.34)
    for sign in (1, -1):
        for part, x, half in ((MORE, 0.72, 0.1), (BODY, 0.57, 0.09)):
            built.part(part)
            built.cylinder([sign * x, -0.08, 0], wide, half, 0.07, lying)


def _glasses(rng: Rng, built: PrimitiveBuilder) -> None:
    """Spectacles: two rims, a bridge, two bars."""
    size, thick = span(rng, 0.24, 0.32), span(rng, 0.025, 0.05)
    gap = size + 0.1
    for sign in (1, -1):
        built.part(BODY)
        built.ring([sign * gap, 0, 0], size, thick, turn=turned(0, np.pi / 2))
        built.limb(
            [sign * (gap + size), 0.08, 0], [sign * (gap + size + 0.02), 0.1, -0.8], thick, thick
        )
        built.limb(
            [sign * (gap + size + 0.02), 0.1, -0.8],
            [sign * (gap + size), -0.12, -1.0],
            thick,
            thick,
        )
        if chance(rng, 0.5):
            built.part(MORE)
            built.cylinder([sign * gap, 0, 0], size, 0.014, 0.0, turned(0, np.pi / 2))
    built.part(BODY)
    tube(built, curve([[gap - size, 0, 0], [0, 0.09, 0.02], [size - gap, 0, 0]], 5), thick)
