"""From control points to Gaussians: linear blend skinning (paper Eq. 5) and its Jacobian."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.spatial import KDTree

from ..arrays import F64, I32, frozen
from .graph import Graph

NEIGHBOURS = 4  # control points that move a Gaussian, paper 3.2.2
CANDIDATES = 16  # geodesic neighbours of the nearest control point that may be among them


@dataclass(frozen=True, eq=False)
class Binding:
    """Which control points move each point of the rest shape, and how much."""

    control_points: I32  # (N, K)
    weights: F64  # (N, K), rows sum to 1
    weight_gradients: F64  # (N, K, 3) per object unit, rows sum to 0


@dataclass(frozen=True, eq=False)
class Skinned:
    """Points after the deformation."""

    points: F64  # (N, 3)
    linear: F64  # (N, 3, 3) Jacobian of the motion there: F


def bind(points: np.ndarray, control_points: np.ndarray, graph: Graph) -> Binding:
    """Binds points (N, 3) to their K = 4 control points.

    The nearest control point is found by straight distance, the others among its neighbours
    along the surface (paper 3.2.2). Weights are (1 - d / d_5)^2, normalised, with d_5 the
    distance of the next control point that is not used: a weight is 0 when its control point
    enters or leaves the set, so the motion has no seams (embedded deformation, Sumner et al.
    2007).
    """
    p = control_points.astype(np.float64)
    x = np.atleast_2d(points).astype(np.float64)
    nearest, row = np.unique(KDTree(p).query(x)[1], return_inverse=True)
    geodesics = graph.geodesics[nearest]  # of those in use: picking binds a single point
    order = np.argsort(geodesics, axis=1, kind="stable")[:, :CANDIDATES]
    reach = np.take_along_axis(geodesics, order, 1)[row]
    order = order[row]  # (N, C)
    distances = np.linalg.norm(x[:, None] - p[order], axis=2)
    distances[~np.isfinite(reach)] = np.inf
    count = min(NEIGHBOURS, len(p) - 1)
    rank = np.argsort(distances, axis=1, kind="stable")[:, : count + 1]
    chosen = np.take_along_axis(order, rank, 1)  # (N, K + 1), the last one is not used
    distances = np.take_along_axis(distances, rank, 1)
    weights, gradients = _falloff(x, p[chosen], distances)
    return Binding(chosen[:, :count].astype(np.int32), weights, gradients)


def _falloff(x: F64, nodes: F64, distances: F64) -> tuple[F64, F64]:
    """Normalised (1 - d_k / d_K+1)^2 of (N, K) control points, and its gradients (N, K, 3).

    `nodes` (N, K + 1, 3) and `distances` (N, K + 1) are in the order of distance; inf marks one
    on another part.
    """
    # In a part with few control points the farthest of it takes the place of the next one.
    usable = np.isfinite(distances).sum(1)
    last = np.maximum(usable - 1, 0)
    rows = np.arange(len(x))
    limit = distances[rows, last][:, None]
    d = distances[:, :-1]
    is_used = np.arange(d.shape[1])[None] < np.maximum(last, 1)[:, None]
    d = np.where(is_used, d, 0.0)
    safe = np.maximum(limit, 1e-300)
    slack = np.where(is_used, 1 - d / safe, 0.0)
    along = (x[:, None] - nodes[:, :-1]) / np.maximum(d, 1e-12)[..., None]
    limit_along = (x - nodes[rows, last]) / safe
    change = -along / safe[..., None] + (d / safe**2)[..., None] * limit_along[:, None]
    weights = slack**2
    gradients = 2 * slack[..., None] * change
    total = weights.sum(1, keepdims=True)
    # Equally far from all of them, or alone: equal shares that do not change.
    even = total[:, 0] <= 1e-30
    weights[even] = is_used[even]
    gradients[even] = 0.0
    total = weights.sum(1, keepdims=True)
    weights /= total
    gradients = (gradients - weights[..., None] * gradients.sum(1, keepdims=True)) / total[
        ..., None
    ]
    return weights, gradients


def skin(
    points: np.ndarray,
    binding: Binding,
    control_points: np.ndarray,
    pose_points: np.ndarray,
    pose_rotations: np.ndarray,
) -> Skinned:
    """Moves rest points (N, 3) with their control points: paper Eq. 5, first line.

    `linear` is the exact Jacobian of the motion, the change of the weights included, so that a
    stretched limb stretches its Gaussians and leaves no gaps.
    """
    return Skinned(
        *_skin(
            frozen(np.atleast_2d(points), np.float64),
            frozen(binding.control_points),
            frozen(binding.weights),
            frozen(binding.weight_gradients),
            frozen(control_points, np.float64),
            frozen(pose_points),
            frozen(pose_rotations),
        )
    )


@numba.njit(cache=True, nogil=True)
def _skin(x, nodes, weights, gradients, p, p_new, r):
    n, count = nodes.shape
    moved = np.zeros((n, 3))
    linear = np.zeros((n, 3, 3))
    for i in range(n):
        for c in range(count):
            w = weights[i, c]
            j = nodes[i, c]
            d0, d1, d2 = x[i, 0] - p[j, 0], x[i, 1] - p[j, 1], x[i, 2] - p[j, 2]
            for a in range(3):
                # the displacement, not the position: gradients sum to 0, so this loses no digits
                y = r[j, a, 0] * d0 + r[j, a, 1] * d1 + r[j, a, 2] * d2 + p_new[j, a]
                moved[i, a] += w * y
                for b in range(3):
                    linear[i, a, b] += w * r[j, a, b] + (y - x[i, a]) * gradients[i, c, b]
    return moved, linear


def faithful_linear(
    binding: Binding,
    control_points: np.ndarray,
    pose_points: np.ndarray,
    pose_rotations: np.ndarray,
    graph: Graph,
) -> F64:
    """The paper's own Gaussian motion (N, 3, 3): Eq. 5, second and third line.

    A rotation, the mean of the control points' quaternions (signs aligned before averaging),
    times one scale, the mean ratio of their links' lengths.
    """
    from ..rotations import matrices_from_quats, quats_from_matrices

    quats = quats_from_matrices(pose_rotations)[binding.control_points]  # (N, K, 4)
    signs = np.sign((quats * quats[:, :1]).sum(-1, keepdims=True))
    blended = (quats * np.where(signs == 0, 1, signs) * binding.weights[..., None]).sum(1)
    linked = graph.weights > 0
    rest = np.linalg.norm(control_points[:, None] - control_points[None], axis=-1)
    posed = np.linalg.norm(pose_points[:, None] - pose_points[None], axis=-1)
    ratios = np.where(linked, posed / np.where(rest > 0, rest, 1), 0)
    stretch = ratios.sum(1) / np.maximum(linked.sum(1), 1)
    scale = (stretch[binding.control_points] * binding.weights).sum(1)
    return matrices_from_quats(blended) * scale[:, None, None]
