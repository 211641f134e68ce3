"""Thinning a dense cloud to an even one: no two points closer than a spacing."""

from __future__ import annotations

import numba
import numpy as np

from .arrays import F64, frozen

OPPOSED = -0.3  # cosine of two normals, below which they are of different surfaces


def thin_to_spacing(
    points: F64, spacing: float, order: np.ndarray, normals: F64 | None = None
) -> np.ndarray:
    """Indices, ascending, of a maximal subset of `points` (N, 3) at least `spacing` apart.

    Points are offered in `order` (N,) and kept when no kept one is near (dart throwing on a
    hash grid, Bridson 2007's neighbourhood test). With `normals` (N, 3) only one whose normal is
    not opposed counts: two surfaces that touch are thinned each by itself.
    """
    normals = np.zeros((1, 3)) if normals is None else normals
    cells = np.floor((points - points.min(0)) / spacing).astype(np.int64)
    size = cells.max(0) + 3
    keys = ((cells[:, 0] + 1) * size[1] + cells[:, 1] + 1) * size[2] + cells[:, 2] + 1
    unique, inverse = np.unique(keys, return_inverse=True)
    near = np.array(
        [(dx * size[1] + dy) * size[2] + dz
         for dx in (-1, 0, 1) for dy in (-1, 0, 1) for dz in (-1, 0, 1)]
    )  # fmt: skip
    neighbours = near[:, None] + unique[None]  # ascending rows: searched in half the time
    found = np.searchsorted(unique, neighbours)
    found[(found == len(unique)) | (unique[np.minimum(found, len(unique) - 1)] != neighbours)] = -1
    inputs = [frozen(a) for a in (order, inverse, found.T)]
    surface = frozen(points, np.float64), frozen(normals, np.float64)
    return np.flatnonzero(_thin(*surface, float(spacing), *inputs))


@numba.njit(cache=True)
def _thin(points, normals, spacing, order, cell_of, neighbours):
    # Cells are one spacing wide, so a cell holds at most eight kept points, sixteen on two sides.
    sides = 2 if len(normals) == len(points) else 1
    slots = np.full((len(neighbours), 8 * sides), -1)
    kept = np.zeros(len(points), np.bool_)
    for i in order:
        cell = cell_of[i]
        is_free = True
        for n in range(neighbours.shape[1]):
            other = neighbours[cell, n]
            if other < 0:
                continue
            for s in range(slots.shape[1]):
                j = slots[other, s]
                if j < 0:
                    break
                if sides == 2:
                    dot = 0.0
                    for a in range(3):
                        dot += normals[i, a] * normals[j, a]
                    if dot < OPPOSED:
                        continue
                dx = points[i, 0] - points[j, 0]
                dy = points[i, 1] - points[j, 1]
                dz = points[i, 2] - points[j, 2]
                if dx * dx + dy * dy + dz * dz < spacing * spacing:
                    is_free = False
                    break
            if not is_free:
                break
        if is_free:
            for s in range(slots.shape[1]):
                if slots[cell, s] < 0:
                    slots[cell, s] = i
                    kept[i] = True
                    break
    return kept
