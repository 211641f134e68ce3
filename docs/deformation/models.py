"""The objects of the page, all made here: a mesh, Gaussians at its vertices, and what is dragged.

Axes are the camera's: x right, y down, z away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from solids import (
    Distance,
    Mesh,
    build_mesh,
    capsule,
    cylinder,
    difference,
    ellipsoid,
    gradients,
    smooth_union,
    smooth_unions,
    tube,
    union,
)

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import matrix_from_vector, quats_along, turn_matrix
from objectmorpher_core.deform.control_points import sample_control_points
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import Handle, LiftedObject, PhotoTexture

CONTROL_POINTS = 512
CAMERA = Camera.from_fov(1000, 1000, 30.0)
DEPTH = 3.5  # of the object's centre before the camera
CHECK = 0.09  # object units, of a square of the checker
FLAT = (0.7, 0.7, 0.1)  # x spacing: standard deviations of a Gaussian

Pattern = Callable[[F64], F64]  # (N, 3) rest points -> (N,) in [-1, 1], which of the two tones


def checker(p: F64) -> F64:
    """A checkerboard in space; no face lies in one of its planes."""
    waves = np.sin(np.pi * (p @ turn_matrix(20, 30, 10).T) / CHECK)
    return np.tanh(6 * waves.prod(1))


def stripes(p: F64) -> F64:
    """Squares around and along a bar on the x axis."""
    around = np.sin(4 * np.arctan2(p[:, 1], p[:, 2]))
    return np.tanh(6 * around * np.sin(np.pi * p[:, 0] / 0.0625))


@dataclass(frozen=True, eq=False)
class Model:
    """An object to be deformed."""

    distance: Distance
    mesh: Mesh
    view: tuple[float, float, float]  # degrees: yaw, pitch, roll
    pattern: Pattern = checker

    @cached_property
    def lifted(self) -> LiftedObject:
        """Gaussians at the vertices of the mesh, flat along the surface."""
        points, count = self.mesh.points, len(self.mesh.points)
        normals = gradients(self.distance, points, 1e-3 * self.mesh.spacing)[0]
        tones = 0.5 + 0.5 * self.pattern(points)[:, None]
        colors = tones * np.array([0.95, 0.60, 0.30]) + (1 - tones) * np.array([0.98, 0.92, 0.80])
        scales = np.tile(self.mesh.spacing * np.array(FLAT), (count, 1))
        ones = np.ones(count)
        gaussians = Gaussians(points, quats_along(normals), scales, ones, colors)
        order = np.random.default_rng(0).permutation(count)  # rows of a grid are no fair order
        control_points = sample_control_points(points[order], ones, CONTROL_POINTS)
        world_from_object = np.eye(4)
        world_from_object[:3, :3] = turn_matrix(*self.view)
        world_from_object[2, 3] = DEPTH
        texture = PhotoTexture(np.zeros((count, 2)), np.zeros(count), ones)
        return LiftedObject(
            gaussians, texture, control_points, world_from_object, self.mesh.spacing, "made"
        )

    def handle(self, near: tuple, move: tuple = (0, 0, 0), **more) -> Handle:
        """The control point nearest to `near` is taken by `move`; without one it is a pin."""
        points = self.lifted.control_points.astype(np.float64)
        node = int(((points - near) ** 2).sum(1).argmin())
        is_pin = not np.any(move) and more.get("turn") is None
        return Handle(node, points[node], points[node] + move, **more).pinned(is_pin, None)

    def handles(self, *all_near: tuple, motion: Callable[[F64], F64] = lambda p: p) -> tuple:
        """Handles at the control points nearest to some points, taken to `motion` of them."""
        found: dict[int, Handle] = {}
        for near in all_near:
            handle = self.handle(near)
            target = motion(handle.point)
            is_pin = bool(np.allclose(target, handle.point))
            own = Handle(handle.control_point, handle.point, target).pinned(is_pin, None)
            found.setdefault(handle.control_point, own)
        return tuple(found.values())


def turned_about(pivot: tuple, vector: tuple) -> Callable[[F64], F64]:
    """The motion that turns about `pivot` by the rotation vector, degrees."""
    turn = matrix_from_vector(np.radians(vector))
    return lambda p: np.array(pivot) + turn @ (p - np.array(pivot))


# ---- objects without gaps -------------------------------------------------------------------

LIMBS, LENGTH, RADIUS = 5, 0.5, 0.07


def limb_axis(limb: int) -> F64:
    """(3,) unit; the first limb points up, the others follow clockwise."""
    angle = np.radians(-90 + 360 * limb / LIMBS)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def five_limbs() -> Model:
    """Round limbs in a plane around a ball."""
    limbs = [capsule((0, 0, 0), (LENGTH - RADIUS) * limb_axis(k), RADIUS) for k in range(LIMBS)]
    ball = capsule((0, 0, 0), (0, 0, 0), 0.18)
    distance = smooth_unions([ball, union(*limbs)], 0.08)
    mesh = build_mesh(distance, ((-0.6, -0.6, -0.25), (0.6, 0.6, 0.25)), 0.0105)
    return Model(distance, mesh, (0, 22, 0))


def limb_handles(model: Model, motion: Callable[[F64], F64]) -> tuple[Handle, ...]:
    """Two handles at the end of each limb; those of the first one are moved, the rest pinned."""
    moved, pinned = [], []
    for k in range(LIMBS):
        tip = (LENGTH - RADIUS) * limb_axis(k)
        both = [tuple(tip + [0, 0, side * RADIUS]) for side in (1, -1)]
        (pinned if k else moved).extend(both)
    return model.handles(*moved, motion=motion) + model.handles(*pinned)


def bar() -> Model:
    """A round bar from -0.5 to 0.5 on the x axis."""
    distance = capsule((-0.42, 0, 0), (0.42, 0, 0), 0.08)
    mesh = build_mesh(distance, ((-0.53, -0.12, -0.12), (0.53, 0.12, 0.12)), 0.008)
    return Model(distance, mesh, (-10, 20, 0), stripes)


def end_ring(side: int) -> list[tuple]:
    """Four points around an end of the bar, `side` -1 or 1."""
    return [(side * 0.42, 0.08 * np.cos(a), 0.08 * np.sin(a)) for a in np.pi / 2 * np.arange(4)]


# ---- objects with gaps ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Gap:
    """An object two parts of which come near without touching, and a drag of one of them.

    `parts` gives for points (N, 3) the number of their part, -1 near the joint, and the least
    way along the surface from each to another part.
    """

    model: Model
    parts: Callable[[F64], tuple[np.ndarray, F64]]
    moved: list[tuple]  # near these points are the handles that are dragged
    pinned: list[tuple]
    way: F64  # (3,) of the drag, x 0.2 diameters
    gap: float
    is_joined_twice: bool = False


def legs() -> Gap:
    """Two upright legs on a hip."""
    gap, r = 0.04, 0.08
    x = r + gap / 2
    both = union(*(capsule((s * x, 0, 0), (s * x, 0.85, 0), r) for s in (-1, 1)))
    hip = capsule((-0.1, -0.02, 0), (0.1, -0.02, 0), 0.14)
    distance = smooth_union(hip, both, 0.04)
    mesh = build_mesh(distance, ((-0.3, -0.2, -0.2), (0.3, 0.98, 0.2)), 0.0105)

    def parts(p: F64) -> tuple[np.ndarray, F64]:
        return np.where(p[:, 1] < 0.18, -1, p[:, 0] > 0), p[:, 1] - 0.16

    moved = [(x, 0.85, -r), (x, 0.85, r)]
    pinned = [(s * 0.2, -0.02, z) for s in (-1, 1) for z in (-0.1, 0.1)]
    return Gap(Model(distance, mesh, (-20, 10, 0)), parts, moved, pinned, _unit(1, -0.3, 0), gap)


def fingers() -> Gap:
    """Four fingers on a palm; they touch but for a thousandth."""
    gap, r = 0.001, 0.05
    pitch = 2 * r + gap
    tips = (0.50, 0.58, 0.55, 0.44)
    centres = pitch * (np.arange(4) - 1.5)
    palm = ellipsoid((0, 0.12, 0), (0.25, 0.22, 0.09))
    own = [
        smooth_union(palm, capsule((c, 0, 0), (c, -tip, 0), r), 0.03)
        for c, tip in zip(centres, tips, strict=True)
    ]
    distance = union(*own)
    box = ((-0.3, -0.7, -0.14), (0.3, 0.4, 0.14))
    mesh = build_mesh(distance, box, pitch / 11)

    def parts(p: F64) -> tuple[np.ndarray, F64]:
        return np.where(p[:, 1] > -0.12, -1, np.round(p[:, 0] / pitch + 1.5)), -0.12 - p[:, 1]

    moved = [(centres[3], -tips[3], z) for z in (-r, r)]
    pinned = [(s * 0.12, 0.2, z) for s in (-1, 1) for z in (-0.08, 0.08)]
    return Gap(Model(distance, mesh, (-15, 15, 0)), parts, moved, pinned, _unit(1, 0.2, -0.2), gap)


def cup() -> Gap:
    """A cup with a handle that stands a little off its wall."""
    gap, r, outer, wall = 0.05, 0.035, 0.3, 0.05
    hollow = difference(
        cylinder(-0.35, 0.35, outer, 0.02), cylinder(-0.6, 0.28, outer - wall, 0.02)
    )
    out = outer + gap + r
    way = [(outer - 0.02, -0.24, 0), (out - 0.02, -0.24, 0), (out, -0.2, 0), (out, 0.2, 0),
           (out - 0.02, 0.24, 0), (outer - 0.02, 0.24, 0)]  # fmt: skip
    distance = smooth_union(hollow, tube(way, r), 0.015)
    mesh = build_mesh(distance, ((-0.33, -0.38, -0.33), (0.45, 0.38, 0.33)), 0.0125)

    def parts(p: F64) -> tuple[np.ndarray, F64]:
        is_handle = np.hypot(p[:, 0], p[:, 2]) > outer + 0.01
        joints = np.array([(outer, y, 0) for y in (-0.24, 0.24)])
        apart = np.linalg.norm(p[:, None] - joints, axis=2).min(1)
        return is_handle, np.maximum(apart - r - 0.02, 0)

    pinned = [(outer * np.cos(a), y, outer * np.sin(a))
              for a in np.radians([60, 180, 300]) for y in (-0.3, 0.3)]  # fmt: skip
    pinned += [(outer, y, 0) for y in (-0.33, 0.33)]
    moved = [(out + r, 0, 0)]
    return Gap(Model(distance, mesh, (-15, 25, 0)), parts, moved, pinned, _unit(1, 0, 0), gap, True)


def tail() -> Gap:
    """A tail that leaves a body at its end and comes to lie along it."""
    gap, r, thick = 0.004, 0.045, 0.2
    y = -(thick + gap + r)
    body = capsule((-0.4, 0, 0), (0.4, 0, 0), thick)
    root = smooth_union(body, tube([(0.45, 0, 0), (0.72, -0.04, 0)], r), 0.06)
    upper = tube([(0.72, -0.04, 0), (0.76, -0.15, 0), (0.68, y, 0), (-0.35, y, 0)], r)
    distance = union(root, upper)
    box = ((-0.65, -0.36, -0.25), (0.85, 0.25, 0.25))
    mesh = build_mesh(distance, box, 0.012, (0, -thick - gap / 2, 0))

    def parts(p: F64) -> tuple[np.ndarray, F64]:
        is_tail = upper(p) < root(p)
        lies = is_tail & (p[:, 1] < y + 0.06)
        return is_tail, np.where(lies, np.maximum(0.68 - p[:, 0], 0) + 0.2, 0)

    moved = [(-0.35 - r, y, 0)]
    pinned = [(x, 0.1, z) for x in (-0.4, 0.0, 0.4) for z in (-0.17, 0.17)]
    return Gap(Model(distance, mesh, (-15, 15, 0)), parts, moved, pinned, _unit(0.2, -1, 0), gap)


def _unit(*way: float) -> F64:
    return np.array(way) / np.linalg.norm(way)
