"""A surface from depths and normals that were both seen, and are both a little wrong.

Depths are right on the whole and wavy; normals are flat where the surface is flat. The surface
sought is the least-squares compromise. Its unknown is the logarithm of the distance along each
pixel's ray, in which a tangent plane seen in perspective is linear (Queau, Durou and Aujol,
"Normal integration: a survey", 2018): flat stays flat.
"""

from __future__ import annotations

import numpy as np

from ...base.arrays import F32, F64, Mask
from ...base.kernel_files import numba

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
    slopes, weights = [], []
    for axis in (0, 1):
        slope, weight = _steps(normal, edge, rays, mask, axis)
        slopes.append(slope)
        weights.append(weight / (SLOPE_ERROR * step) ** 2)
    change = solved(start, sure, slopes[0], slopes[1], weights[0], weights[1], ROUNDS, CLOSE)
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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _applied(x, sure, down, right, out):
    """`out` (h, w): the system's matrix times x (h, w)."""
    height, width = x.shape
    for i in range(height):
        for j in range(width):
            total = sure[i, j] * x[i, j]
            if i + 1 < height:
                total += down[i, j] * (x[i, j] - x[i + 1, j])
            if i > 0:
                total += down[i - 1, j] * (x[i, j] - x[i - 1, j])
            if j + 1 < width:
                total += right[i, j] * (x[i, j] - x[i, j + 1])
            if j > 0:
                total += right[i, j - 1] * (x[i, j] - x[i, j - 1])
            out[i, j] = total


@numba.njit(cache=True, nogil=True, error_model="numpy")
def solved(start, sure, slope_down, slope_right, down, right, rounds, close):
    """(h, w) what is to be added to `start`, so that its steps are near the slopes.

    `sure`: weights (h, w) of keeping `start`. `down`, `right`: weights (h, w) of the steps to the
    next row and column. Conjugate gradients, scaled by the diagonal.
    """
    height, width = start.shape
    x, ax = np.zeros((height, width)), np.zeros((height, width))
    residual, diagonal = np.zeros((height, width)), np.zeros((height, width))
    for i in range(height):
        for j in range(width):
            diagonal[i, j] += sure[i, j]
            if i + 1 < height:
                pull = down[i, j] * (slope_down[i, j] - (start[i + 1, j] - start[i, j]))
                residual[i, j] -= pull
                residual[i + 1, j] += pull
                diagonal[i, j] += down[i, j]
                diagonal[i + 1, j] += down[i, j]
            if j + 1 < width:
                pull = right[i, j] * (slope_right[i, j] - (start[i, j + 1] - start[i, j]))
                residual[i, j] -= pull
                residual[i, j + 1] += pull
                diagonal[i, j] += right[i, j]
                diagonal[i, j + 1] += right[i, j]
    scale = 1 / np.maximum(diagonal, 1e-30)
    way = scale * residual
    size = (residual * way).sum()
    first = size
    for _ in range(rounds):
        if size <= close * close * first or size <= 0.0:
            break
        _applied(way, sure, down, right, ax)
        along = size / (way * ax).sum()
        x += along * way
        residual -= along * ax
        scaled = scale * residual
        after = (residual * scaled).sum()
        way = scaled + after / size * way
        size = after
    return x
