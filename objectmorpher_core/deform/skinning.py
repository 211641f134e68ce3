"""From control points to Gaussians: linear blend skinning (paper Eq. 5) and its Jacobian."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.spatial import cKDTree

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
    near = cKDTree(p).query(x)[1]
    order = np.argsort(graph.geodesics, axis=1, kind="stable")[:, :CANDIDATES]
    reachable = np.isfinite(np.take_along_axis(graph.geodesics, order, 1))
    count = min(NEIGHBOURS, len(p) - 1)
    inputs = [frozen(a) for a in (x, p, near, order, reachable)]
    return Binding(*_bind(*inputs, count))


@numba.njit(cache=True)
def _bind(x, p, near, order, reachable, count):
    n, width = len(x), order.shape[1]
    chosen = np.zeros((n, count), np.int32)
    weights = np.zeros((n, count))
    gradients = np.zeros((n, count, 3))
    distance = np.empty(width)
    for i in range(n):
        usable = 0
        for c in range(width):
            distance[c] = np.inf
            if reachable[near[i], c]:
                distance[c] = np.sqrt(((x[i] - p[order[near[i], c]]) ** 2).sum())
                usable += 1
        rank = np.argsort(distance, kind="mergesort")
        used = min(count, max(usable - 1, 1))
        last = order[near[i], rank[min(used, usable - 1)]]
        limit = distance[rank[min(used, usable - 1)]] if usable > 1 else np.inf
        total = 0.0
        total_gradient = np.zeros(3)
        for c in range(used):
            j = order[near[i], rank[c]]
            chosen[i, c] = j
            d = distance[rank[c]]
            if not np.isfinite(limit) or limit <= 0.0:
                weights[i, c] = 1.0
            else:
                # (1 - d / limit)^2; both distances change with x
                slack = 1.0 - d / limit
                along = (x[i] - p[j]) / max(d, 1e-12)
                limit_along = (x[i] - p[last]) / limit
                weights[i, c] = slack * slack
                gradients[i, c] = 2 * slack * (-along / limit + d / limit**2 * limit_along)
            total += weights[i, c]
            total_gradient += gradients[i, c]
        if total <= 1e-30:  # equally far from all of them
            for c in range(used):
                weights[i, c] = 1.0 / used
                gradients[i, c] = 0.0
            continue
        for c in range(used):
            weights[i, c] /= total
            gradients[i, c] = (gradients[i, c] - weights[i, c] * total_gradient) / total
    return chosen, weights, gradients


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


@numba.njit(cache=True, parallel=True)
def _skin(x, nodes, weights, gradients, p, p_new, r):
    n, count = nodes.shape
    moved = np.zeros((n, 3))
    linear = np.zeros((n, 3, 3))
    for i in numba.prange(n):
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
