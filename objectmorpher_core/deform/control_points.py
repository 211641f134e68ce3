"""Farthest point sampling of the control points (paper 3.2)."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F32, F64, frozen
from ..base.kernel_files import numba

COUNT = 512  # control points, paper 3.2
MIN_COUNT = 4  # fewer do not span a volume
MAX_COUNT = 4096  # more cannot be solved within a frame
SOLID = 0.9  # opacity from which a Gaussian is part of the body (the paper's released code)
BLOCK = 64  # Gaussians that are looked at or passed over together
KEY_BITS = 20  # of each coordinate in the Morton order: an outlier leaves the rest its cells


def sample_control_points(means: np.ndarray, opacities: np.ndarray, count: int = COUNT) -> F32:
    """Evenly spread control points (M, 3), M = min(count, solid Gaussians), object frame.

    `means` (N, 3), `opacities` (N,). The first point is the solid Gaussian farthest from the
    centroid, so the result does not depend on chance. Where too few are solid, the threshold
    falls until enough remain. Raises ValueError for fewer than four distinct Gaussians.
    """
    if count < MIN_COUNT:
        raise ValueError(f"{count} control points are too few, at least {MIN_COUNT} are needed")
    if count > MAX_COUNT:
        raise ValueError(f"{count} control points are too many, at most {MAX_COUNT} can be used")
    if not (np.isfinite(means).all() and np.isfinite(opacities).all()):
        raise ValueError("the object's Gaussians hold means or opacities that are not finite")
    wanted = min(count, len(opacities))
    if wanted < MIN_COUNT:
        raise ValueError(f"the object has {wanted} distinct Gaussians, too few to deform")
    solid = opacities >= min(SOLID, np.partition(opacities, -wanted)[-wanted])
    candidates = frozen(means[solid], np.float64)
    start = int(((candidates - candidates.mean(0)) ** 2).sum(1).argmax())
    chosen = _farthest_points(candidates, start, wanted)
    if len(chosen) < MIN_COUNT:
        raise ValueError(f"the object has {len(chosen)} distinct Gaussians, too few to deform")
    return candidates[chosen].astype(np.float32)


def with_more_points(kept: np.ndarray, means: np.ndarray, gap: float) -> F32:
    """Control points `kept` (K, 3), and more of `means` (N, 3) where none is within `gap`."""
    points = [*np.asarray(kept, np.float64)]
    candidates = np.asarray(means, np.float64)
    nearest = np.full(len(candidates), np.inf)
    for point in points:
        np.minimum(nearest, ((candidates - point) ** 2).sum(1), out=nearest)
    while len(points) < MAX_COUNT and len(candidates) and nearest.max() > gap**2:
        points.append(candidates[nearest.argmax()])
        np.minimum(nearest, ((candidates - points[-1]) ** 2).sum(1), out=nearest)
    return np.array(points, np.float32).reshape(-1, 3)


def _farthest_points(points: F64, start: int, count: int) -> np.ndarray:
    """Indices (<= count,) of points (N, 3), each the farthest from all before; no point twice.

    Of equally far ones the first in `points` is taken. The points are sorted along a Morton
    curve and cut into blocks: a new control point that is farther from a block's box than the
    block's points are from the old ones changes nothing in it.
    """
    low = points.min(0)
    cell = max(float((points.max(0) - low).max()), 1e-300) / (2**KEY_BITS - 1)
    order = np.argsort(_morton_keys(points, frozen(low), cell), kind="stable")
    blocks = frozen(points[order]), frozen(order)
    return _farthest_of_blocks(*blocks, int(np.flatnonzero(order == start)[0]), count)


@numba.njit(cache=True)
def _morton_keys(points, low, cell):
    """Keys (N,) of points (N, 3): the bits of the three cell numbers, interleaved."""
    keys = np.zeros(len(points), np.int64)
    for i in range(len(points)):
        for axis in range(3):
            bits = np.int64((points[i, axis] - low[axis]) / cell)
            # Each step halves the runs of bits and moves them apart: 20 bits, every third.
            bits = (bits | bits << 32) & 0x1F00000000FFFF
            bits = (bits | bits << 16) & 0x1F0000FF0000FF
            bits = (bits | bits << 8) & 0x100F00F00F00F00F
            bits = (bits | bits << 4) & 0x10C30C30C30C30C3
            bits = (bits | bits << 2) & 0x1249249249249249
            keys[i] |= bits << axis
    return keys


@numba.njit(cache=True)
def _farthest_of_blocks(points, index, current, count):
    """Indices (<= count,): `points` (N, 3) in blocks, `index` (N,) their numbers."""
    lows, highs = _boxes(points)
    blocks = len(lows)
    nearest = np.full(len(points), np.inf)  # squared distance to the control points so far
    gap = np.full(blocks, np.inf)  # its largest of each block, and where that is
    widest = np.zeros(blocks, np.int64)
    chosen = np.empty(count, np.int64)
    for c in range(count):
        chosen[c] = index[current]
        x, y, z = points[current]
        farthest = 0
        for b in range(blocks):
            dx = max(lows[b, 0] - x, 0.0, x - highs[b, 0])
            dy = max(lows[b, 1] - y, 0.0, y - highs[b, 1])
            dz = max(lows[b, 2] - z, 0.0, z - highs[b, 2])
            # Rounding is monotone: no point's own distance comes out below its box's.
            if dx * dx + dy * dy + dz * dz < gap[b]:
                gap[b], widest[b] = _update(points, index, nearest, b, current)
            is_first = index[widest[b]] < index[widest[farthest]]
            if gap[b] > gap[farthest] or (gap[b] == gap[farthest] and is_first):
                farthest = b
        if gap[farthest] <= 0.0:
            return chosen[: c + 1]
        current = widest[farthest]
    return chosen


@numba.njit(cache=True)
def _boxes(points):
    """Corners (B, 3) of the boxes around the blocks of points (N, 3)."""
    blocks = (len(points) + BLOCK - 1) // BLOCK
    lows, highs = np.full((blocks, 3), np.inf), np.full((blocks, 3), -np.inf)
    for i in range(len(points)):
        for axis in range(3):
            lows[i // BLOCK, axis] = min(lows[i // BLOCK, axis], points[i, axis])
            highs[i // BLOCK, axis] = max(highs[i // BLOCK, axis], points[i, axis])
    return lows, highs


@numba.njit(cache=True)
def _update(points, index, nearest, block, current):
    """Brings `nearest` of one block up to date; returns its largest and where that is."""
    x, y, z = points[current]
    first = block * BLOCK
    gap, widest = -1.0, first
    for i in range(first, min(first + BLOCK, len(points))):
        dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        d = dx * dx + dy * dy + dz * dz
        if d < nearest[i]:
            nearest[i] = d
        if nearest[i] > gap or (nearest[i] == gap and index[i] < index[widest]):
            gap, widest = nearest[i], i
    return gap, widest
