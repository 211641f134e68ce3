"""The mirror plane of an object: the best of many planes, then fitted to what it mirrors.

A plane is as good as the mirrored points are near the object. Candidates go through the centre;
the best few are fitted: for pairs (p, q) of a mirrored point and what is nearest to it,
sum |q - mirror(p)|^2 is least where the plane's normal n is the eigenvector of the symmetric part
of sum (p - p0)(q - q0)^T with the smallest eigenvalue, and the plane goes through (p0 + q0) / 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ..base.arrays import F64

CANDIDATES = 200  # directions on a half sphere: about 10 degrees apart
ROUGH = 64  # points that all candidates mirror
FITTED = 5  # of the candidates, the best
STEPS = 12  # of a fit, at most
SETTLED = 1e-4  # x the gap: a fit that gains less is done
SAMPLES, DENSE = 256, 3000  # points that are mirrored, and those they are compared with
SYMMETRIC = 0.03  # x diameter, mean gap of a mirrored object to itself: more is no symmetry
LEANING = 2.0  # how much worse a plane counts that is not upright at all
FACING = 0.75  # largest cosine of the normal with the line of sight: front and back look alike


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """Points p with normal . p = offset."""

    normal: F64  # (3,) unit
    offset: float
    gap: float  # x diameter: how far mirrored points are from the object, on average

    def mirrored(self, points: np.ndarray) -> F64:
        """Points (..., 3) on the other side."""
        away = points @ self.normal - self.offset
        return points - 2 * away[..., None] * self.normal

    def mirrored_vector(self, vector: np.ndarray) -> F64:
        """A displacement (3,) on the other side."""
        return vector - 2 * (vector @ self.normal) * self.normal

    def mirrored_turn(self, turn: np.ndarray) -> F64:
        """A rotation vector (3,) on the other side: clockwise becomes anticlockwise."""
        return -self.mirrored_vector(turn)

    def distance(self, point: np.ndarray) -> float:
        return abs(float(point @ self.normal) - self.offset)


def find_mirror(
    points: np.ndarray, sight: np.ndarray | None = None, across: np.ndarray | None = None
) -> MirrorPlane | None:
    """The mirror plane of points (N, 3) spread evenly over an object; None where it has none.

    With a line of `sight` (3,), planes that part the front from the back are left out: a lifter
    makes the back in the image of the front. With a direction `across` (3,), of planes that are
    about as good the one is taken whose normal lies along it: most things are upright.
    """
    every = max(len(points) // DENSE, 1)
    dense = np.asarray(points[::every], np.float64)
    low, high = dense.min(0), dense.max(0)
    diameter = float(np.linalg.norm(high - low)) or 1.0
    tree = KDTree(dense)
    few = dense[:: max(len(dense) // SAMPLES, 1)]
    normals = _half_sphere(CANDIDATES)
    if sight is not None:
        normals = normals[np.abs(normals @ _unit(sight)) <= FACING]
    centre = dense.mean(0)
    rough = few[:: max(len(few) // ROUGH, 1)] - centre
    images = rough[None] - 2 * (rough @ normals.T).T[..., None] * normals[:, None]
    gaps = tree.query((images + centre).reshape(-1, 3))[0].reshape(len(normals), -1).mean(1)
    best: MirrorPlane | None = None
    for k in np.argsort(gaps * _strangeness(normals, across), kind="stable")[:FITTED]:
        start = MirrorPlane(normals[k], float(normals[k] @ centre), float("inf"))
        plane = _fitted(tree, few, start, diameter)
        if sight is not None and abs(plane.normal @ _unit(sight)) > FACING:
            continue
        if best is None or _cost(plane, across) < _cost(best, across):
            best = plane
    return None if best is None or best.gap > SYMMETRIC else best


def plane_through(point: np.ndarray, normal: np.ndarray) -> MirrorPlane:
    """The plane through a point (3,), for an object that has no mirror plane."""
    unit = _unit(normal)
    return MirrorPlane(unit, float(unit @ point), float("inf"))


def _fitted(tree: KDTree, points: F64, start: MirrorPlane, diameter: float) -> MirrorPlane:
    """The plane near `start` for which the mirrored `points` are nearest to the object."""
    dense = np.asarray(tree.data)
    best, normal, offset = start, start.normal, start.offset
    for _ in range(STEPS):
        images = points - 2 * (points @ normal - offset)[:, None] * normal
        gaps, nearest = tree.query(images)
        gap = float(gaps.mean()) / diameter
        if gap >= best.gap * (1 - SETTLED):
            break
        best = MirrorPlane(normal, offset, gap)
        there = dense[nearest]
        p0, q0 = points.mean(0), there.mean(0)
        product = (points - p0).T @ (there - q0)
        normal = np.linalg.eigh(product + product.T)[1][:, 0]
        offset = float(normal @ (p0 + q0) / 2)
    return best


def _strangeness(normals: F64, across: np.ndarray | None) -> F64:
    """(...) what the gap of a plane with a normal (..., 3) is multiplied by: 1 or more."""
    if across is None:
        return np.ones(normals.shape[:-1])
    return 1 + LEANING * (1 - np.abs(normals @ _unit(across)))


def _cost(plane: MirrorPlane, across: np.ndarray | None) -> float:
    return plane.gap * float(_strangeness(plane.normal, across))


def _half_sphere(count: int) -> F64:
    """(count, 3) unit vectors spread over half a sphere."""
    k = np.arange(count) + 0.5
    z = 1 - k / count
    angle = np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - z * z)
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])


def _unit(vector: np.ndarray) -> F64:
    return np.asarray(vector, np.float64) / np.linalg.norm(vector)
