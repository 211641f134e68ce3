"""A made-up object while it is put together: parts made of primitives, y up, the ground below.

Lengths are free while building; `PrimitiveBuilder.finish` scales the object into the unit ball.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from objectmorpher_core.base.arrays import F32, F64

from . import distance as sdf

SAMPLES = 9  # points each way on a primitive's surface, by which balls are found
MARGIN = 1.01  # x the ball of those points
BULGE = 0.3  # x softness, that a soft join stands out at most
THINNEST = 0.006  # x the object's ball, half of a sheet: rays find it


class Solid(NamedTuple):
    """The input of the kernels of `distance`; lengths in radii of the object's ball."""

    kinds: np.ndarray  # (n,) of primitives
    frames: F64  # (n, 3, 4) object -> the primitive's own frame
    numbers: F64  # (n, SIZE)
    joins: np.ndarray  # (n,)
    softness: F64  # (n,)
    cavities: np.ndarray  # (n,) bool: cut away, but what is behind belongs to the same body
    balls: F64  # (n, 4) centre and radius of a ball that holds the primitive
    parts: np.ndarray  # (m, 2) first and last + 1 primitive
    bounds: F64  # (m, 4) centre and radius of a ball that holds the part
    outlines: F64  # (k, 2)
    warp: F64  # (2,) radians per radius: twist about y, bend sideways


class Joining(TypedDict, total=False):
    """The joining of a primitive to those before it; cut, cavity, keep: at most one."""

    soft: float
    cut: bool
    cavity: bool  # cut away, but filled where thickness is measured
    keep: bool  # only what lies in it stays


@dataclass(frozen=True)
class _Primitive:
    kind: int
    frame: F64  # (4, 4) own frame -> object
    numbers: tuple[float, ...]
    join: int
    soft: float
    is_cavity: bool
    half: F64  # (3,) of its box, own frame
    middle: F64  # (3,) of its box


@dataclass
class PrimitiveBuilder:
    """Primitives, part by part; every method adds to the part that `part` began last."""

    material: list[int] = field(default_factory=list)  # of each part
    # Of a material: a picture (h, w, 3) over the xy-plane of a frame whose axes are (3, 3)
    prints: dict[int, tuple[F32, F64]] = field(default_factory=dict)
    _parts: list[list[_Primitive]] = field(default_factory=list)
    _outlines: list[F64] = field(default_factory=list)
    _rows: int = 0
    twist: float = 0.0  # radians per radius of the object's ball, about y
    bend: float = 0.0  # the same sideways
    # Of the finished object: its middle and the radius of its ball, in lengths of building
    ball: tuple[F64, float] = field(default_factory=lambda: (np.zeros(3), 1.0))

    def part(self, material: int = 0) -> None:
        """Begins a part, which looks like the others of that material."""
        self._parts.append([])
        self.material.append(material)

    def ellipsoid(
        self, at: ArrayLike, half: ArrayLike, turn: F64 | None = None, **how: Unpack[Joining]
    ) -> None:
        size = np.asarray(half, float)
        self._add(sdf.ELLIPSOID, at, turn, tuple(size), size, **how)

    def box(
        self,
        at: ArrayLike,
        half: ArrayLike,
        round_: float = 0.0,
        turn: F64 | None = None,
        **how: Unpack[Joining],
    ) -> None:
        size = np.asarray(half, float)
        self._add(sdf.BOX, at, turn, (*size, min(round_, 0.98 * size.min())), size, **how)

    def limb(
        self, a: ArrayLike, b: ArrayLike, near: float, far: float, **how: Unpack[Joining]
    ) -> None:
        """A cone with round ends from a (3,) to b (3,)."""
        start, end = np.asarray(a, float), np.asarray(b, float)
        length = max(float(np.linalg.norm(end - start)), 1e-6)
        if abs(near - far) > 0.95 * length:  # one ball holds the other: the larger one stays
            near, far = max(near, far - 0.95 * length), max(far, near - 0.95 * length)
        wide = max(near, far)
        half = np.array([wide, 0.5 * (length + near + far), wide])
        middle = np.array([0, 0.5 * (length + far - near), 0])
        numbers = (near, far, length)
        self._add(sdf.ROUND_CONE, start, along(end - start), numbers, half, middle, **how)

    def cylinder(
        self, at: ArrayLike, radius: float, half: float, round_: float = 0.0,
        turn: F64 | None = None, **how: Unpack[Joining],
    ) -> None:  # fmt: skip
        numbers = (radius, half, min(round_, 0.98 * min(radius, half)))
        self._add(sdf.CYLINDER, at, turn, numbers, np.array([radius, half, radius]), **how)

    def ring(
        self, at: ArrayLike, large: float, small: float, half_angle: float = np.pi,
        turn: F64 | None = None, **how: Unpack[Joining],
    ) -> None:  # fmt: skip
        """A torus about y; its middle is on +z, of which `half_angle` is there each way."""
        half = np.array([large + small, small, large + small])
        self._add(sdf.TORUS, at, turn, (large, small, half_angle), half, **how)

    def lathe(
        self, at: ArrayLike, outline: F64, turn: F64 | None = None, **how: Unpack[Joining]
    ) -> None:
        """`outline` (k, 2): radius and y, a closed polygon; on the axis where it is solid."""
        low, high, wide = outline[:, 1].min(), outline[:, 1].max(), outline[:, 0].max()
        half, middle = np.array([wide, (high - low) / 2, wide]), np.array([0, (high + low) / 2, 0])
        self._add(sdf.LATHE, at, turn, self._outline(outline), half, middle, **how)

    def prism(
        self, at: ArrayLike, outline: F64, half: float, round_: float = 0.0,
        turn: F64 | None = None, **how: Unpack[Joining],
    ) -> None:  # fmt: skip
        """`outline` (k, 2): x and y, a closed polygon, pulled along z."""
        low, high = outline.min(0), outline.max(0)
        numbers = (*self._outline(outline), half, round_)
        size = np.array([*(high - low) / 2, half])
        self._add(sdf.PRISM, at, turn, numbers, size, np.array([*(high + low) / 2, 0]), **how)

    def superquadric(
        self, at: ArrayLike, half: ArrayLike, side: float, above: float,
        turn: F64 | None = None, **how: Unpack[Joining],
    ) -> None:  # fmt: skip
        size = np.asarray(half, float)
        self._add(sdf.SUPERQUADRIC, at, turn, (*size, side, above), size, **how)

    def sheet(
        self, at: ArrayLike, half: ArrayLike, thick: float,
        waves: tuple[float, float, float, float], bend: float = 0.0, turn: F64 | None = None,
        **how: Unpack[Joining],
    ) -> None:  # fmt: skip
        """`half` (2,): x and y; `waves`: height, per x, per y, phase; `bend`: 1 / radius."""
        x, y = np.asarray(half, float)
        deep = thick + abs(waves[0])
        numbers = (x, y, thick, *waves, bend)
        self._add(sdf.SHEET, at, turn, numbers, np.array([x, y, deep]), **how)

    def finish(self) -> Solid:
        """The object about its middle, within the unit ball."""
        self._parts, kept = (
            [part for part in self._parts if part],
            [m for m, part in zip(self.material, self._parts, strict=True) if part],
        )
        self.material = kept
        if not self._parts or any(part[0].join != sdf.JOIN for part in self._parts):
            raise ValueError("every part begins with something that is there")
        clouds = [
            np.concatenate([_cloud(p, self._outlines) for p in part if p.join == sdf.JOIN])
            for part in self._parts
        ]
        everything = np.concatenate(clouds)
        centre = 0.5 * (everything.min(0) + everything.max(0))
        radius = MARGIN * np.linalg.norm(everything - centre, axis=1).max()
        radius += BULGE * max(p.soft for part in self._parts for p in part)
        self.ball = centre, float(radius)
        scale, flat = 1 / radius, [p for part in self._parts for p in part]
        to_object = np.diag([scale, scale, scale, 1.0])
        to_object[:3, 3] = -scale * centre
        frames = [np.linalg.inv(to_object @ p.frame @ _sized(radius))[:3] for p in flat]
        balls = np.array([_ball((_cloud(p, self._outlines) - centre) * scale) for p in flat])
        ends = np.cumsum([0] + [len(part) for part in self._parts])
        bounds = np.array([_ball((cloud - centre) * scale) for cloud in clouds])
        bounds[:, 3] += [BULGE * scale * max(p.soft for p in part) for part in self._parts]
        outlines = np.concatenate(self._outlines) if self._outlines else np.zeros((1, 2))
        return Solid(
            np.array([p.kind for p in flat], np.int64),
            np.array(frames, np.float64),
            np.array([_scaled(p, scale) for p in flat]),
            np.array([p.join for p in flat], np.int64),
            np.array([p.soft * scale for p in flat]),
            np.array([p.is_cavity for p in flat]),
            balls,
            np.column_stack([ends[:-1], ends[1:]]),
            bounds,
            outlines * scale,
            np.array([self.twist, self.bend]),
        )

    def _outline(self, outline: F64) -> tuple[float, float]:
        self._outlines.append(np.asarray(outline, float))
        self._rows += len(outline)
        return float(self._rows - len(outline)), float(len(outline))

    def _add(
        self, kind: int, at: ArrayLike, turn: F64 | None, numbers: tuple[float, ...], half: F64,
        middle: F64 | None = None, soft: float = 0.0, cut: bool = False, cavity: bool = False,
        keep: bool = False,
    ) -> None:  # fmt: skip
        frame = np.eye(4)
        frame[:3, 3] = np.asarray(at, float)
        if turn is not None:
            frame[:3, :3] = turn
        join = sdf.CUT if cut or cavity else sdf.KEEP if keep else sdf.JOIN
        middle = np.zeros(3) if middle is None else middle
        primitive = _Primitive(kind, frame, numbers, join, soft, cavity, half, middle)
        self._parts[-1].append(primitive)


# Which numbers of a primitive are lengths, by kind
_LENGTHS = {
    sdf.ELLIPSOID: (0, 1, 2), sdf.BOX: (0, 1, 2, 3), sdf.ROUND_CONE: (0, 1, 2),
    sdf.CYLINDER: (0, 1, 2), sdf.TORUS: (0, 1), sdf.LATHE: (), sdf.PRISM: (2, 3),
    sdf.SUPERQUADRIC: (0, 1, 2), sdf.SHEET: (0, 1, 2, 3),
}  # fmt: skip
_PER_LENGTH = {sdf.SHEET: (4, 5, 7)}


def _scaled(primitive: _Primitive, scale: float) -> F64:
    numbers = np.zeros(sdf.SIZE)
    numbers[: len(primitive.numbers)] = primitive.numbers
    numbers[list(_LENGTHS[primitive.kind])] *= scale
    numbers[list(_PER_LENGTH.get(primitive.kind, ()))] /= scale
    if primitive.kind == sdf.SHEET:
        numbers[2] = max(numbers[2], THINNEST)
    if primitive.kind == sdf.ROUND_CONE:
        numbers[:2] = np.maximum(numbers[:2], THINNEST)
    return numbers


def _sized(radius: float) -> F64:
    """A primitive's frame has the lengths of the unit ball, too."""
    return np.diag([radius, radius, radius, 1.0])


def _ball(cloud: F64) -> F64:
    ball = sdf.ball_of(cloud)
    ball[3] = MARGIN * ball[3] + THINNEST
    return ball


def _cloud(primitive: _Primitive, outlines: list[F64]) -> F64:
    """(n, 3) points on the surface of a primitive, or outside of it."""
    local = _surface(primitive, outlines)
    return local @ primitive.frame[:3, :3].T + primitive.frame[:3, 3]


def _surface(primitive: _Primitive, outlines: list[F64]) -> F64:
    """(n, 3) such points in the primitive's own frame."""
    kind, numbers = primitive.kind, primitive.numbers
    if kind == sdf.ELLIPSOID:
        return _sphere() * primitive.half
    if kind == sdf.SUPERQUADRIC:
        corners = _box() * primitive.half
        return corners / _norm(corners, numbers)[:, None]
    if kind == sdf.ROUND_CONE:
        near, far, height = numbers
        return np.concatenate([_sphere() * near, _sphere() * far + [0, height, 0]])
    if kind == sdf.TORUS:
        large, small, half = numbers
        steps = np.linspace(-half, half, 3 * SAMPLES)
        around = np.stack([np.sin(steps), 0 * steps, np.cos(steps)], 1)
        return (large * around[:, None] + small * 1.05 * _sphere()[None, ::3]).reshape(-1, 3)
    if kind in (sdf.CYLINDER, sdf.LATHE):
        rim = primitive.half[[0, 1]] * [[1, -1], [1, 1]]
        if kind == sdf.LATHE:
            rim = _rows(outlines, numbers) - [0, primitive.middle[1]]
        steps = np.linspace(0, 2 * np.pi, 3 * SAMPLES)
        around = np.stack([np.cos(steps), np.ones(len(steps)), np.sin(steps)], 1)
        return (around[:, None] * rim[None][..., [0, 1, 0]]).reshape(-1, 3) + primitive.middle
    if kind == sdf.PRISM:
        flat = _rows(outlines, numbers)
        return np.concatenate([np.insert(flat, 2, side * numbers[2], 1) for side in (-1, 1)])
    if kind == sdf.SHEET and numbers[7]:
        return _bent(primitive)
    return _box() * primitive.half + primitive.middle


def _box() -> F64:
    """(n, 3) points on the surface of a cube, from -1 to 1."""
    grid = np.linspace(-1, 1, SAMPLES)
    points = np.stack(np.meshgrid(grid, grid, grid), -1).reshape(-1, 3)
    return points[np.abs(points).max(1) == 1]


def _sphere() -> F64:
    """(n, 3) points on the unit sphere, those on the axes among them."""
    points = _box()
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _norm(points: F64, numbers: tuple[float, ...]) -> F64:
    """(n,) how many times a superquadric is to be enlarged to reach points (n, 3)."""
    x, y, z = np.abs(points / np.array(numbers[:3])).T
    side, above = numbers[3:5]
    flat = (x ** (2 / above) + z ** (2 / above)) ** (above / side)
    return (flat + y ** (2 / side)) ** (side / 2)


def _rows(outlines: list[F64], numbers: tuple[float, ...]) -> F64:
    return np.concatenate(outlines)[int(numbers[0]) : int(numbers[0] + numbers[1])]


def _bent(primitive: _Primitive) -> F64:
    """(n, 3) of a bent sheet."""
    points = _box() * primitive.half
    radius = 1 / primitive.numbers[7]
    angle = np.clip(points[:, 0] / abs(radius), -np.pi, np.pi)
    away = abs(radius) - np.sign(radius) * points[:, 2]
    return np.stack(
        [away * np.sin(angle), points[:, 1], radius - np.sign(radius) * away * np.cos(angle)], 1
    )


def along(direction: F64) -> F64:
    """(3, 3) a rotation whose y axis is `direction` (3,)."""
    y = direction / max(float(np.linalg.norm(direction)), 1e-9)
    helper = np.array([1.0, 0, 0]) if abs(y[0]) < 0.8 else np.array([0, 0, 1.0])
    z = np.cross(helper, y)
    z /= np.linalg.norm(z)
    return np.column_stack([np.cross(y, z), y, z])


def turned(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> F64:
    """(3, 3) about y, then x, then z, radians."""
    (cy, cx, cz), (sy, sx, sz) = (f(np.array([yaw, pitch, roll])) for f in (np.cos, np.sin))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_x @ about_y, np.float64)
