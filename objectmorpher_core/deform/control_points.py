"""Farthest point sampling of the control points (paper 3.2)."""

from __future__ import annotations

import numba
import numpy as np

from ..arrays import F32, frozen

COUNT = 512  # control points, paper 3.2
MIN_COUNT = 4  # fewer do not span a volume
SOLID = 0.9  # opacity from which a Gaussian is part of the body (the paper's released code)


def sample_control_points(means: np.ndarray, opacities: np.ndarray, count: int = COUNT) -> F32:
    """Evenly spread control points (M, 3), M = min(count, solid Gaussians), object frame.

    `means` (N, 3), `opacities` (N,). The first point is the solid Gaussian farthest from the
    centroid, so the result does not depend on chance. Where too few are solid, the threshold
    falls until enough remain. Raises ValueError for fewer than four distinct Gaussians.
    """
    if count < MIN_COUNT:
        raise ValueError(f"{count} control points are too few, at least {MIN_COUNT} are needed")
    solid = opacities >= min(SOLID, np.sort(opacities)[-min(count, len(opacities))])
    candidates = frozen(means[solid], np.float64)
    start = int(((candidates - candidates.mean(0)) ** 2).sum(1).argmax())
    chosen = _farthest_points(candidates, start, min(count, len(candidates)))
    if len(chosen) < MIN_COUNT:
        raise ValueError(f"the object has {len(chosen)} distinct Gaussians, too few to deform")
    return candidates[chosen].astype(np.float32)


@numba.njit(cache=True)
def _farthest_points(points: np.ndarray, start: int, count: int) -> np.ndarray:
    """Indices (<= count,) of points, each the farthest from all before; no point twice."""
    chosen = np.empty(count, np.int64)
    nearest = np.full(len(points), np.inf)
    current = start
    for c in range(count):
        chosen[c] = current
        x, y, z = points[current]
        farthest, gap = 0, -1.0
        for i in range(len(points)):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            d = dx * dx + dy * dy + dz * dz
            if d < nearest[i]:
                nearest[i] = d
            if nearest[i] > gap:
                farthest, gap = i, nearest[i]
        if gap <= 0.0:
            return chosen[: c + 1]
        current = farthest
    return chosen
