"""Closed triangle meshes of solids that are given by their signed distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from skimage.measure import marching_cubes

from objectmorpher_core.base.arrays import F64

Distance = Callable[[F64], F64]  # (N, 3) points -> (N,) to the surface, negative inside

RELAXATIONS = 12  # steps that even the vertices out; after ten their spacing hardly changes
SLOPE = 1e-4  # x the grid's step: of the central differences


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface."""

    points: F64  # (N, 3)
    faces: np.ndarray  # (F, 3), anticlockwise from outside

    def corners(self, points: F64) -> tuple[F64, F64, F64]:
        """The three corners (F, 3) of each face, with the vertices at `points` (N, 3)."""
        return points[self.faces[:, 0]], points[self.faces[:, 1]], points[self.faces[:, 2]]

    def volume(self, points: F64) -> float:
        a, b, c = self.corners(points)
        return float(np.einsum("na,na->", a, np.cross(b, c)) / 6)

    def area(self, points: F64) -> float:
        a, b, c = self.corners(points)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    def normals(self, points: F64) -> F64:
        """(N, 3) unit, outward: the mean of the faces around each vertex."""
        a, b, c = self.corners(points)
        crosses = np.cross(b - a, c - a)
        sums = np.zeros(points.shape)
        for k in range(3):
            np.add.at(sums, self.faces[:, k], crosses)
        return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-30)

    def stretches(self, points: F64) -> tuple[F64, F64]:
        """Largest and smallest stretch (F,) of each face, from rest to `points`."""
        a, b, c = self.corners(self.points)
        along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        across = np.cross(normal, along)
        frame = np.stack([along, across], axis=1)  # (F, 2, 3)
        flat = frame @ np.stack([b - a, c - a], axis=2)  # (F, 2, 2) edges in the face's plane
        a, b, c = self.corners(points)
        moved = np.stack([b - a, c - a], axis=2) @ np.linalg.inv(flat)  # (F, 3, 2)
        values = np.linalg.svd(moved, compute_uv=False)
        return values[:, 0], values[:, 1]

    @cached_property
    def spacing(self) -> float:
        """Mean length of an edge."""
        a, b, c = self.corners(self.points)
        return float(np.mean([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))]))


def capsule(a: tuple, b: tuple, radius: float) -> Distance:
    """A round bar from `a` to `b` with round ends; a ball where they are the same."""
    start, axis = np.array(a, float), np.subtract(b, a).astype(float)

    def distance(p: F64) -> F64:
        along = np.clip((p - start) @ axis / max(axis @ axis, 1e-30), 0, 1)
        return np.linalg.norm(p - start - along[:, None] * axis, axis=1) - radius

    return distance


def tube(points: list[tuple], radius: float) -> Distance:
    """A round bar along the line through `points`."""
    return union(*(capsule(a, b, radius) for a, b in pairwise(points)))


def ellipsoid(centre: tuple, radii: tuple) -> Distance:
    """Good to first order near the surface, which is all that is used."""
    c, r = np.array(centre, float), np.array(radii, float)

    def distance(p: F64) -> F64:
        k0 = np.linalg.norm((p - c) / r, axis=1)
        k1 = np.linalg.norm((p - c) / r**2, axis=1)
        return np.where(k0 < 1e-3, -r.min(), k0 * (k0 - 1) / np.maximum(k1, 1e-12))

    return distance


def union(*parts: Distance) -> Distance:
    return lambda p: np.min([part(p) for part in parts], axis=0)


def smooth_union(first: Distance, second: Distance, radius: float) -> Distance:
    """The union with a fillet where the two meet (polynomial smooth minimum)."""

    def distance(p: F64) -> F64:
        one, other = first(p), second(p)
        h = np.clip(0.5 + 0.5 * (other - one) / radius, 0, 1)
        return other + (one - other) * h - radius * h * (1 - h)

    return distance


def smooth_unions(parts: list[Distance], radius: float) -> Distance:
    return reduce(lambda one, other: smooth_union(one, other, radius), parts)


def build_mesh(distance: Distance, box: tuple, step: float, through: tuple = (0, 0, 0)) -> Mesh:
    """The surface within `box`, (low, high) corners, on a grid of `step`.

    A grid point lies at `through`: put into a narrow gap it keeps the gap open, however narrow.
    """
    low, high, point = (np.array(v, float) for v in (*box, through))
    first = np.floor((low - point) / step).astype(int)
    shape = np.ceil((high - point) / step).astype(int) - first + 1
    grid = (np.indices(shape).reshape(3, -1).T + first) * step + point
    values = distance(grid).reshape(shape)
    values[np.abs(values) < 1e-9 * step] = 1e-9 * step
    vertices, faces, _, _ = marching_cubes(values, 0.0, gradient_direction="ascent")
    points = (vertices.astype(float) + first) * step + point
    mesh = _without_slivers(points, faces.astype(np.int64), 1e-6 * step)
    relaxed = _relaxed(mesh, distance, step)
    return (
        relaxed if relaxed.volume(relaxed.points) > 0 else Mesh(relaxed.points, mesh.faces[:, ::-1])
    )


def _without_slivers(points: F64, faces: np.ndarray, least: float) -> Mesh:
    """Vertices at the same place are one, and faces without an area are gone."""
    _, first, inverse = np.unique(
        np.round(points / least).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = inverse.ravel()[faces]
    is_face = (faces != np.roll(faces, 1, axis=1)).all(1)
    return Mesh(points[first], faces[is_face])


def _relaxed(mesh: Mesh, distance: Distance, step: float) -> Mesh:
    """Each vertex in the middle of its neighbours, and back on the surface."""
    count = len(mesh.points)
    first, second = mesh.faces.ravel(), np.roll(mesh.faces, 1, axis=1).ravel()
    both = np.concatenate([first, second]), np.concatenate([second, first])
    links = csr_array((np.ones(len(both[0])), both), shape=(count, count))
    links.data[:] = 1.0
    degree = links.sum(1)[:, None]
    points = mesh.points
    for _ in range(RELAXATIONS):
        points = points + 0.5 * (links @ points / degree - points)
        for _ in range(2):
            normals, slope = gradients(distance, points, SLOPE * step)
            points = points - (distance(points) / np.maximum(slope, 0.3))[:, None] * normals
    return Mesh(points, mesh.faces)


def gradients(distance: Distance, points: F64, reach: float) -> tuple[F64, F64]:
    """Unit directions (N, 3) in which the distance grows, and how fast (N,)."""
    sides = [(distance(points + e) - distance(points - e)) / (2 * reach) for e in reach * np.eye(3)]
    slopes = np.stack(sides, axis=1)
    size = np.linalg.norm(slopes, axis=1)
    return slopes / np.maximum(size, 1e-12)[:, None], size


def cylinder(top: float, bottom: float, radius: float, rounding: float) -> Distance:
    """An upright round block about the y axis, from y = `top` to `bottom`, its edges rounded."""
    middle, half = 0.5 * (top + bottom), 0.5 * (bottom - top) - rounding

    def distance(p: F64) -> F64:
        out = np.hypot(p[:, 0], p[:, 2]) - radius + rounding
        up = np.abs(p[:, 1] - middle) - half
        beyond = np.hypot(np.maximum(out, 0), np.maximum(up, 0))
        return beyond + np.minimum(np.maximum(out, up), 0) - rounding

    return distance


def difference(first: Distance, second: Distance) -> Distance:
    """The first without the second."""
    return lambda p: np.maximum(first(p), -second(p))
