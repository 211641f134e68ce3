"""Solids made of patches of surface: twelve things with limbs, necks, handles and flat sides.

Own frame of a solid: x right, y down, z away from the viewer; largest extent 1. None of them, nor
what they are made of, is among what the shape network was trained on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from objectmorpher_core.base.arrays import F64, I32

Point = tuple[float, float, float]
ROUND = 40  # patches around an axis
LONG = 28  # and along it


@dataclass(frozen=True, eq=False)
class Limb:
    """Parts that turn together about a point."""

    parts: tuple[int, ...]
    pivot: F64  # (3,)
    tip: F64  # (3,) its farthest end


@dataclass(frozen=True, eq=False)
class TruthSolid:
    """A closed surface; its parts overlap."""

    name: str
    vertices: F64  # (V, 3)
    faces: I32  # (F, 3) counterclockwise seen from outside
    welds: I32  # (V,) vertices of one number are one point of a smooth surface
    parts: I32  # (V,)
    limbs: Mapping[str, Limb] = field(default_factory=dict)

    def normals(self, vertices: F64) -> F64:
        """(V, 3) outward, unit, of its surface with the vertices at (V, 3)."""
        a, b, c = (vertices[self.faces[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        sums = np.zeros((int(self.welds.max()) + 1, 3))
        for k in range(3):
            np.add.at(sums, self.welds[self.faces[:, k]], cross)
        normals = sums[self.welds]
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


class PatchBuilder:
    """Patches, part by part; `part` begins the next."""

    def __init__(self) -> None:
        self._points: list[F64] = []
        self._faces: list[I32] = []
        self._welds: list[I32] = []
        self._parts: list[I32] = []
        self._count = self._welded = 0
        self._part = -1
        self._limbs: dict[str, tuple[tuple[int, ...], Point, Point]] = {}

    def part(self) -> int:
        self._part += 1
        return self._part

    def limb(self, name: str, parts: Sequence[int], pivot: Point, tip: Point) -> None:
        self._limbs[name] = (tuple(parts), pivot, tip)

    def patch(self, grid: F64, inside: F64) -> None:
        """A grid (n, m, 3) of points; `inside` (3,) lies behind it, or (n, m, 3) behind each."""
        n, m = grid.shape[:2]
        points = grid.reshape(-1, 3)
        index = np.arange(n * m).reshape(n, m)
        a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
        faces = np.concatenate(
            [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
        )
        corners = points[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        behind = np.broadcast_to(inside, grid.shape).reshape(-1, 3)[faces[:, 0]]
        if (cross * (corners.mean(1) - behind)).sum() < 0:
            faces = faces[:, ::-1]
        _, welds = np.unique(np.round(points, 6), axis=0, return_inverse=True)
        self._points.append(points)
        self._faces.append((faces + self._count).astype(np.int32))
        self._welds.append((welds.reshape(-1) + self._welded).astype(np.int32))
        self._parts.append(np.full(len(points), self._part, np.int32))
        self._count += len(points)
        self._welded += int(welds.max()) + 1

    def lathe(self, profile: Sequence[tuple[float, float]], at: Point = (0, 0, 0)) -> None:
        """Turned about y: (radius, y) from top to bottom, smooth along the profile."""
        self._turned(np.array(profile, float), np.eye(3), np.array(at, float))

    def ellipsoid(self, at: Point, half: Point) -> None:
        t = np.linspace(0, np.pi, LONG)
        profile = np.column_stack([np.sin(t), -np.cos(t)])
        self._turned(profile, np.diag(half).astype(float), np.array(at, float))

    def capsule(self, start: Point, end: Point, first: float, last: float | None = None) -> None:
        """Add a capsule from `start` to `end`, with a radius at either end."""
        a, b = np.array(start, float), np.array(end, float)
        last = first if last is None else last
        length = float(np.linalg.norm(b - a))
        t = np.linspace(0, np.pi / 2, 8)
        top = np.column_stack([first * np.sin(t), -first * np.cos(t)])
        side = np.linspace(0, 1, LONG)[1:-1, None]
        between = (1 - side) * [first, 0.0] + side * [last, length]
        below = np.column_stack([last * np.cos(t), length + last * np.sin(t)])
        axis = (b - a) / length
        other = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
        other /= np.linalg.norm(other)
        frame = np.column_stack([other, axis, np.cross(other, axis)])
        self._turned(np.concatenate([top, between, below]), frame, a)

    def torus(self, at: Point, large: float, small: float) -> None:
        """Around z."""
        u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * ROUND), np.linspace(0, 2 * np.pi, 20))
        ring = np.stack([np.cos(u), np.sin(u), 0 * u], -1) * large
        tube = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], -1) * small
        self.patch(ring + tube + at, ring + np.array(at, float))

    def box(self, at: Point, half: Point) -> None:
        s, t = np.meshgrid(np.linspace(-1, 1, LONG), np.linspace(-1, 1, LONG))
        middle = np.array(at, float)
        for axis in range(3):
            for side in (-1.0, 1.0):
                grid = np.empty((LONG, LONG, 3))
                grid[..., axis] = side
                grid[..., (axis + 1) % 3], grid[..., (axis + 2) % 3] = s, t
                self.patch(grid * half + middle, middle)

    def disc(self, at: Point, radius: float, inside: Point) -> None:
        """Flat, across y."""
        r, a = np.meshgrid(np.linspace(0, radius, 12), np.linspace(0, 2 * np.pi, ROUND))
        grid = np.stack([r * np.cos(a), 0 * r, r * np.sin(a)], -1) + at
        self.patch(grid, np.array(inside, float))

    def _turned(self, profile: F64, linear: F64, at: F64) -> None:
        angle = np.linspace(0, 2 * np.pi, ROUND)
        radius, along = profile[:, None, 0], profile[:, None, 1]
        grid = np.stack(
            np.broadcast_arrays(radius * np.cos(angle), along, radius * np.sin(angle)), -1
        )
        axis = np.stack(np.broadcast_arrays(0 * radius * angle, along, 0 * radius * angle), -1)
        self.patch(grid @ linear.T + at, axis @ linear.T + at)

    def finish(self, name: str) -> TruthSolid:
        points = np.concatenate(self._points)
        middle = 0.5 * (points.min(0) + points.max(0))
        extent = float((points.max(0) - points.min(0)).max())
        limbs = {
            key: Limb(parts, (np.array(pivot) - middle) / extent, (np.array(tip) - middle) / extent)
            for key, (parts, pivot, tip) in self._limbs.items()
        }
        return TruthSolid(
            name, (points - middle) / extent, np.concatenate(self._faces),
            np.concatenate(self._welds), np.concatenate(self._parts), limbs,
        )  # fmt: skip


def figure(build: PatchBuilder) -> None:
    build.part()
    build.ellipsoid((0, -0.66, 0), (0.16, 0.19, 0.17))
    build.part()
    build.ellipsoid((0, -0.12, 0), (0.24, 0.37, 0.17))
    arms = []
    for side in (-1, 1):
        elbow, hand = (side * 0.42, -0.12, -0.02), (side * 0.5, 0.18, -0.1)
        arms.append(build.part())
        build.capsule((side * 0.2, -0.36, 0), elbow, 0.085, 0.07)
        build.capsule(elbow, hand, 0.07, 0.06)
        build.limb(("left", "right")[side > 0], (arms[-1],), (side * 0.2, -0.36, 0), hand)
    for side in (-1, 1):
        build.part()
        build.capsule((side * 0.12, 0.15, 0), (side * 0.17, 0.85, 0.0), 0.12, 0.08)


def dog(build: PatchBuilder) -> None:
    build.part()
    build.ellipsoid((0, 0, 0), (0.42, 0.2, 0.17))
    for k, (x, z) in enumerate(((-0.3, -0.1), (-0.3, 0.1), (0.28, -0.1), (0.28, 0.1))):
        leg = build.part()
        build.capsule((x, 0.05, z), (x - 0.02, 0.5, z), 0.075, 0.05)
        build.limb(f"leg {k}", (leg,), (x, 0.05, z), (x - 0.02, 0.5, z))
    neck = build.part()
    build.capsule((-0.32, -0.08, 0), (-0.5, -0.32, 0), 0.12, 0.1)
    head = build.part()
    build.ellipsoid((-0.54, -0.38, 0), (0.16, 0.13, 0.12))
    build.capsule((-0.62, -0.35, 0), (-0.76, -0.32, 0), 0.075, 0.05)
    build.limb("head", (neck, head), (-0.3, -0.08, 0), (-0.76, -0.32, 0))
    tail = build.part()
    build.capsule((0.36, -0.08, 0), (0.66, -0.3, 0.02), 0.05, 0.03)
    build.limb("tail", (tail,), (0.36, -0.08, 0), (0.66, -0.3, 0.02))


def star(build: PatchBuilder) -> None:
    build.part()
    build.ellipsoid((0, 0, 0), (0.2, 0.2, 0.11))
    for k in range(5):
        angle = np.radians(72 * k - 90)
        tip = (0.62 * np.cos(angle), 0.62 * np.sin(angle), 0.0)
        arm = build.part()
        build.capsule((0, 0, 0), tip, 0.14, 0.05)
        build.limb(f"arm {k}", (arm,), (0.1 * np.cos(angle), 0.1 * np.sin(angle), 0), tip)


def cactus(build: PatchBuilder) -> None:
    build.part()
    build.capsule((0, -0.5, 0), (0, 0.5, 0), 0.15)
    for side, low, high in ((-1, 0.1, -0.25), (1, -0.05, -0.4)):
        arm = build.part()
        build.capsule((0, low, 0), (side * 0.36, low - 0.04, 0), 0.085)
        build.capsule((side * 0.36, low - 0.04, 0), (side * 0.38, high, 0), 0.085, 0.07)
        build.limb(
            ("left", "right")[side > 0], (arm,), (side * 0.1, low, 0), (side * 0.38, high, 0)
        )


def bottle(build: PatchBuilder) -> None:
    build.part()
    profile = [(0, -0.5), (0.07, -0.5), (0.075, -0.48), (0.07, -0.3), (0.09, -0.22), (0.16, -0.14)]
    profile += [(0.19, -0.05), (0.19, 0.2), (0.19, 0.46), (0.17, 0.5)]
    build.lathe(_fine(profile))
    build.disc((0, 0.5, 0), 0.17, (0, 0, 0))


def vase(build: PatchBuilder) -> None:
    t = np.linspace(0, 1, 60)
    radius = 0.16 + 0.12 * np.sin(2.9 * np.pi * t**1.2 + 0.4) * (0.5 + 0.5 * t)
    build.part()
    build.lathe(list(zip(radius.tolist(), (t - 0.5).tolist(), strict=True)))
    build.disc((0, -0.5, 0), radius[0], (0, 0, 0))
    build.disc((0, 0.5, 0), radius[-1], (0, 0, 0))


def mug(build: PatchBuilder) -> None:
    build.part()
    build.lathe(_fine([(0.33, -0.4), (0.33, 0), (0.31, 0.38), (0.28, 0.42)]))
    build.disc((0, -0.4, 0), 0.33, (0, 0, 0))
    build.disc((0, 0.42, 0), 0.28, (0, 0, 0))
    build.part()
    build.torus((0.36, 0.0, 0), 0.23, 0.06)


def crate(build: PatchBuilder) -> None:
    build.part()
    build.box((0, 0, 0), (0.36, 0.45, 0.25))


def plank(build: PatchBuilder) -> None:
    build.part()
    build.box((0, 0, 0), (0.15, 0.6, 0.07))


def banana(build: PatchBuilder) -> None:
    angle = np.linspace(-0.75, 0.75, 2 * LONG)
    radius = 0.1 * np.sqrt(np.clip(1 - (angle / 0.76) ** 6, 0.02, 1))
    turn = np.linspace(0, 2 * np.pi, ROUND)
    x = 0.7 * np.cos(angle)[:, None] + radius[:, None] * np.cos(angle)[:, None] * np.cos(turn)
    y = 0.7 * np.sin(angle)[:, None] + radius[:, None] * np.sin(angle)[:, None] * np.cos(turn)
    z = radius[:, None] * np.sin(turn)
    axis = 0.7 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)[:, None]
    build.part()
    build.patch(np.stack([x, y, z], -1), axis)


def mushroom(build: PatchBuilder) -> None:
    build.part()
    build.lathe(_fine([(0.11, -0.2), (0.1, 0.1), (0.14, 0.4), (0.1, 0.46), (0, 0.47)]))
    t = np.linspace(0, np.pi / 2, 24)
    dome = np.column_stack([0.4 * np.sin(t), -0.15 - 0.34 * np.cos(t)])
    build.part()
    build.lathe([*map(tuple, dome), (0.36, -0.1), (0.2, -0.08), (0.0, -0.08)])


def car(build: PatchBuilder) -> None:
    build.part()
    build.box((0, 0.05, 0), (0.5, 0.12, 0.22))
    build.part()
    build.box((0.04, -0.14, 0), (0.27, 0.1, 0.19))
    for x in (-0.3, 0.3):
        for z in (-0.2, 0.2):
            build.part()
            build.torus((x, 0.18, z), 0.07, 0.05)
            build.ellipsoid((x, 0.18, z), (0.08, 0.08, 0.03))


def _fine(profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """More points on a profile, along straight lines."""
    points = np.array(profile)
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.unique(np.concatenate([way, np.linspace(0, way[-1], 2 * LONG)]))
    radius, y = (np.interp(at, way, points[:, k]) for k in (0, 1))
    return list(zip(radius.tolist(), y.tolist(), strict=True))


MAKERS: Mapping[str, Callable[[PatchBuilder], None]] = {
    f.__name__: f
    for f in (figure, dog, star, cactus, bottle, vase, mug, crate, plank, banana, mushroom, car)
}


def make(name: str) -> TruthSolid:
    """The solid of that name, of MAKERS."""
    build = PatchBuilder()
    MAKERS[name](build)
    return build.finish(name)
