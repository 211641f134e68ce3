"""A made-up object while it is put together: parts made of primitives, y up, the ground below.

Lengths are free while building; `Builder.finish` scales the object into the unit ball.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...arrays import F64
from . import distance as sdf

SAMPLES = 6  # points each way on a primitive's box, by which balls are found


class Solid(NamedTuple):
    """What the kernels of `distance` take; lengths in radii of the object's ball."""

    kinds: np.ndarray  # (n,) of primitives
    frames: F64  # (n, 3, 4) object -> the primitive's own frame
    numbers: F64  # (n, SIZE)
    joins: np.ndarray  # (n,)
    softness: F64  # (n,)
    cavities: np.ndarray  # (n,) bool: cut away, but what is behind belongs to the same body
    parts: np.ndarray  # (m, 2) first and last + 1 primitive
    bounds: F64  # (m, 4) centre and radius of a ball that holds the part
    outlines: F64  # (k, 2)
    warp: F64  # (2,) radians per length: twist about y, bend sideways


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
class Builder:
    """Primitives, part by part; every method adds to the part that `part` began last."""

    material: list[int] = field(default_factory=list)  # of each part
    _parts: list[list[_Primitive]] = field(default_factory=list)
    _outlines: list[F64] = field(default_factory=list)
    _rows: int = 0
    twist: float = 0.0  # radians over the object's height
    bend: float = 0.0

    def part(self, material: int = 0) -> None:
        """Begins a part, which looks like the others of that material."""
        self._parts.append([])
        self.material.append(material)

    def ellipsoid(self, at: object, half: object, turn: F64 | None = None, **how: float) -> None:
        size = np.asarray(half, float)
        self._add(sdf.ELLIPSOID, at, turn, tuple(size), size, **how)

    def box(
        self, at: object, half: object, round_: float = 0.0, turn: F64 | None = None, **how: float
    ) -> None:
        size = np.asarray(half, float)
        self._add(sdf.BOX, at, turn, (*size, min(round_, 0.98 * size.min())), size, **how)

    def limb(self, a: object, b: object, near: float, far: float, **how: float) -> None:
        """A cone with round ends from a (3,) to b (3,)."""
        start, end = np.asarray(a, float), np.asarray(b, float)
        length = max(float(np.linalg.norm(end - start)), 1e-6)
        if abs(near - far) > 0.95 * length:  # one ball holds the other
            far = near - np.sign(near - far) * 0.95 * length
        wide = max(near, far)
        half = np.array([wide, 0.5 * (length + near + far), wide])
        middle = np.array([0, 0.5 * (length + far - near), 0])
        numbers = (near, far, length)
        self._add(sdf.ROUND_CONE, start, along(end - start), numbers, half, middle, **how)

    def cylinder(
        self, at: object, radius: float, half: float, round_: float = 0.0,
        turn: F64 | None = None, **how: float,
    ) -> None:  # fmt: skip
        numbers = (radius, half, min(round_, 0.98 * min(radius, half)))
        self._add(sdf.CYLINDER, at, turn, numbers, np.array([radius, half, radius]), **how)

    def ring(
        self, at: object, large: float, small: float, half_angle: float = np.pi,
        turn: F64 | None = None, **how: float,
    ) -> None:  # fmt: skip
        """A torus about y; its middle is on +z, of which `half_angle` is there each way."""
        half = np.array([large + small, small, large + small])
        self._add(sdf.TORUS, at, turn, (large, small, half_angle), half, **how)

    def lathe(self, at: object, outline: F64, turn: F64 | None = None, **how: float) -> None:
        """`outline` (k, 2): radius and y, a closed polygon; on the axis where it is solid."""
        low, high, wide = outline[:, 1].min(), outline[:, 1].max(), outline[:, 0].max()
        half, middle = np.array([wide, (high - low) / 2, wide]), np.array([0, (high + low) / 2, 0])
        self._add(sdf.LATHE, at, turn, self._outline(outline), half, middle, **how)

    def prism(
        self, at: object, outline: F64, half: float, round_: float = 0.0,
        turn: F64 | None = None, **how: float,
    ) -> None:  # fmt: skip
        """`outline` (k, 2): x and y, a closed polygon, pulled along z."""
        low, high = outline.min(0), outline.max(0)
        numbers = (*self._outline(outline), half, round_)
        size = np.array([*(high - low) / 2, half])
        self._add(sdf.PRISM, at, turn, numbers, size, np.array([*(high + low) / 2, 0]), **how)

    def superquadric(
        self, at: object, half: object, side: float, above: float,
        turn: F64 | None = None, **how: float,
    ) -> None:  # fmt: skip
        size = np.asarray(half, float)
        self._add(sdf.SUPERQUADRIC, at, turn, (*size, side, above), size, **how)

    def sheet(
        self, at: object, half: object, thick: float, waves: tuple[float, float, float, float],
        bend: float = 0.0, turn: F64 | None = None, **how: float,
    ) -> None:  # fmt: skip
        """`half` (2,): x and y; `waves`: height, per x, per y, phase; `bend`: 1 / radius."""
        x, y = np.asarray(half, float)
        deep = thick + abs(waves[0]) + (x if bend else 0.0)
        numbers = (x, y, thick, *waves, bend)
        self._add(sdf.SHEET, at, turn, numbers, np.array([x, y, deep]), **how)

    def finish(self) -> Solid:
        """The object about its middle, within the unit ball."""
        self._parts, kept = (
            [part for part in self._parts if part],
            [m for m, part in zip(self.material, self._parts, strict=True) if part],
        )
        self.material = kept
        clouds = [np.concatenate([_cloud(p) for p in part if p.join != sdf.CUT] or
                                 [_cloud(p) for p in part]) for part in self._parts]  # fmt: skip
        everything = np.concatenate(clouds)
        centre = 0.5 * (everything.min(0) + everything.max(0))
        radius = 1.001 * np.linalg.norm(everything - centre, axis=1).max()
        if self.twist or self.bend:
            radius *= 1.15
        scale, flat = 1 / radius, [p for part in self._parts for p in part]
        to_object = np.diag([scale, scale, scale, 1.0])
        to_object[:3, 3] = -scale * centre
        frames = [np.linalg.inv(to_object @ p.frame @ _sized(radius))[:3] for p in flat]
        ends = np.cumsum([0] + [len(part) for part in self._parts])
        bounds = np.array([sdf.ball_of((cloud - centre) * scale) for cloud in clouds])
        outlines = np.concatenate(self._outlines) if self._outlines else np.zeros((1, 2))
        return Solid(
            np.array([p.kind for p in flat], np.int64),
            np.array(frames),
            np.array([_scaled(p, scale) for p in flat]),
            np.array([p.join for p in flat], np.int64),
            np.array([p.soft * scale for p in flat]),
            np.array([p.is_cavity for p in flat]),
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
        self, kind: int, at: object, turn: F64 | None, numbers: tuple[float, ...], half: F64,
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
    return numbers


def _sized(radius: float) -> F64:
    """A primitive's frame has the object's own lengths: those of the unit ball."""
    return np.diag([radius, radius, radius, 1.0])


def _cloud(primitive: _Primitive) -> F64:
    """(n, 3) points on the box of a primitive, corners drawn in as far as its shape is round."""
    grid = np.linspace(-1, 1, SAMPLES)
    points = np.stack(np.meshgrid(grid, grid, grid), -1).reshape(-1, 3)
    if primitive.kind in (sdf.ELLIPSOID, sdf.SUPERQUADRIC) and _is_round(primitive):
        points = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1.0)
    elif primitive.kind in (sdf.ROUND_CONE, sdf.CYLINDER, sdf.TORUS, sdf.LATHE):
        around = np.linalg.norm(points[:, [0, 2]], axis=1, keepdims=True)
        points[:, [0, 2]] /= np.maximum(around, 1.0)
    local = points * primitive.half + primitive.middle
    return local @ primitive.frame[:3, :3].T + primitive.frame[:3, 3]


def _is_round(primitive: _Primitive) -> bool:
    return primitive.kind == sdf.ELLIPSOID or min(primitive.numbers[3:5]) >= 1.0


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
