"""A surface from depths and normals that were both seen, and are both a little wrong.

Depths are right on the whole and wavy; normals are flat where the surface is flat. The surface
sought is the least-squares compromise. Its unknown is the logarithm of the distance along each
pixel's ray, in which a tangent plane seen in perspective is linear (Queau, Durou and Aujol,
"Normal integration: a survey", 2018): flat stays flat.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg

from ...base.arrays import F32, F64, Mask

SLOPE_ERROR = 0.25  # expected, of the normals: change of depth per length across the ray
GRAZING = 0.2  # cosine to the ray, below which a normal shows no slope
ROUNDS = 120  # of conjugate gradients
CLOSE = 1e-4  # x the first residual: near enough


def integrated(
    distance: F64, error: F32, normal: F32, edge: F32, rays: F64, mask: Mask, step: float
) -> F64:
    """(s, s) distances along unit rays (s, s, 3); `distance` itself outside `mask` (s, s).

    `error`: how far off distances (s, s) are expected to be. `normal` (s, s, 3): unit, towards
    the camera. `edge`: probability that the surface ends beside a pixel. `step`: length between
    two pixels' rays, per distance.
    """
    start = np.log(np.maximum(distance, 1e-6))
    sure = np.where(mask, (distance / np.maximum(error, 1e-4)) ** 2, 0.0)
    down, right = (_steps(normal, edge, rays, mask, axis) for axis in (0, 1))
    size = (SLOPE_ERROR * step) ** 2
    change = solved(start, sure, (down[0], right[0]), (down[1] / size, right[1] / size))
    return np.where(mask, np.exp(start + change), distance)


def _steps(normal: F32, edge: F32, rays: F64, mask: Mask, axis: int) -> tuple[F64, F64]:
    """Change (s, s) of the logarithm to the next pixel along an axis, and how sure it is.

    The last of an axis has no next: its weight is 0.
    """
    count = mask.shape[axis] - 1
    first, last = ([slice(None), slice(None)] for _ in range(2))
    first[axis], last[axis] = slice(0, count), slice(1, count + 1)
    a, b = tuple(first), tuple(last)
    mean = normal[a].astype(np.float64) + normal[b]
    mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-9)
    here, there = (-(mean * rays[side]).sum(-1) for side in (a, b))  # cosines to the rays
    least = np.minimum(here, there)
    slope, weight = np.zeros(mask.shape), np.zeros(mask.shape)
    is_told = mask[a] & mask[b] & (least > GRAZING)
    slope[a] = np.where(is_told, np.log(np.maximum(here, 1e-3) / np.maximum(there, 1e-3)), 0.0)
    whole = 1 - np.maximum(edge[a], edge[b]).astype(np.float64)
    weight[a] = np.where(is_told, (whole * least) ** 2, 0.0)
    return slope, weight


def solved(
    start: F64, sure: F64, slopes: tuple[F64, F64], weights: tuple[F64, F64], rounds: int = ROUNDS
) -> F64:
    """(h, w) what is to be added to `start`, so that its steps are near the slopes.

    `sure`: weights (h, w) of keeping `start`. `slopes` and their `weights`: (h, w) each, of the
    steps to the next row and column. Conjugate gradients, scaled by the diagonal.
    """
    index = np.arange(start.size).reshape(start.shape)
    first = np.concatenate([index[:-1].ravel(), index[:, :-1].ravel()])
    last = np.concatenate([index[1:].ravel(), index[:, 1:].ravel()])
    wanted, weight = (
        np.concatenate([down[:-1].ravel(), right[:, :-1].ravel()])
        for down, right in (slopes, weights)
    )
    count, values = len(first), start.ravel()
    ends, rows = np.column_stack([last, first]).ravel(), np.arange(0, 2 * count + 1, 2)
    steps = csr_array((np.tile([1.0, -1.0], count), ends, rows), (count, start.size))
    pulls = steps.T.tocsr() * weight
    # In single precision no library spreads the many short sums over threads that wait for others.
    system = (pulls @ steps + diags_array(sure.ravel())).astype(np.float32)
    right = (pulls @ (wanted - steps @ values)).astype(np.float32)
    scale = diags_array(1 / np.maximum(system.diagonal(), 1e-30))
    change, _ = cg(system, right, rtol=CLOSE, maxiter=rounds, M=scale)
    return change.reshape(start.shape).astype(np.float64)
