"""Thinning a dense cloud to an even one: no two points closer than a spacing."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np

from .arrays import F32, F64, I64, Mask, frozen
from .kernel_files import numba

# Distances to the nearest empty pixel, the same on every call, and which pixel is nearest.

SNAPPED = 1400.0  # px; the squares of larger distances have steps in float32 themselves


def distance_inside(mask: Mask | np.ndarray) -> F32:
    """Return the exact distances (H, W), px, from pixels of `mask` to the nearest one outside.

    Where everything is inside, distances are larger than the mask.

    OpenCV takes the root by the processor's wide instructions where memory happens to be aligned
    for them, and another one elsewhere: the last bit is not the same on every call. The squares
    are whole numbers, which tells the root that is meant.
    """
    wide = cv2.distanceTransform(
        np.asarray(mask, np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )  # fmt: skip
    near = np.sqrt(np.rint(np.square(wide, dtype=np.float64))).astype(np.float32)
    return np.where(wide < SNAPPED, near, wide)


def nearest_in(mask: Mask) -> I64:
    """(H, W) the flat index of the pixel of `mask` (H, W) that is nearest; 0 where it is empty."""
    if not mask.any():
        return np.zeros(mask.shape, np.int64)
    _, found = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    label = np.asarray(found, np.int64)
    index = np.zeros(int(label.max()) + 1, np.int64)
    index[label[mask]] = np.flatnonzero(mask)
    return index[label]


OPPOSED = -0.3  # cosine of two normals, below which they are of different surfaces
CAPACITY = 1024  # cells that the table of kept points has room for at first
# A point's own cell and those around it, nearest first: most points are turned down there.
AROUND = frozen(
    np.array(sorted(product((-1, 0, 1), repeat=3), key=lambda cell: sum(map(abs, cell))))
)


def thin_to_spacing(
    points: F64, spacing: float, order: np.ndarray, normals: F64 | None = None
) -> np.ndarray:
    """Indices, ascending, of a maximal subset of `points` (N, 3) at least `spacing` apart.

    Points are offered in `order` (N,) and kept when no kept one is near (dart throwing on a
    hash grid, Bridson 2007's neighbourhood test). With `normals` (N, 3) only one whose normal is
    not opposed counts: two surfaces that touch are thinned each by itself.
    """
    if len(points) == 0:
        return np.empty(0, np.int64)
    sides = np.zeros((1, 3)) if normals is None else normals
    surface = frozen(points, np.float64), frozen(sides, np.float64)
    return np.flatnonzero(_thin(*surface, float(spacing), frozen(order, np.int64), AROUND))


@numba.njit(cache=True, nogil=True)
def _thin(points, normals, spacing, order, around):
    """Which points (N,) are kept. Only those are in the table, so that it stays small."""
    keys, firsts = np.zeros(CAPACITY, np.int64), np.full(CAPACITY, -1)  # of cells
    others = np.full(len(points), -1)  # that were kept before in the same cell
    kept = np.zeros(len(points), np.bool_)
    place, cell = np.empty(3), np.empty(3, np.int64)
    used = 0
    for i in order:
        for a in range(3):
            place[a] = points[i, a] / spacing
            cell[a] = np.int64(np.floor(place[a]))
            place[a] -= cell[a]
        if _is_near_kept(points, normals, spacing, i, place, cell, around, keys, firsts, others):
            continue
        key = _key(cell[0], cell[1], cell[2])
        slot = _slot(keys, firsts, key)
        used += firsts[slot] < 0
        kept[i], keys[slot], others[i], firsts[slot] = True, key, firsts[slot], i
        if 2 * used > len(keys):
            keys, firsts = _enlarged(keys, firsts)
    return kept


@numba.njit(cache=True, nogil=True)
def _is_near_kept(points, normals, spacing, i, place, cell, around, keys, firsts, others):
    """Whether a kept point is near point `i`, which is at `place` (3,), in cells, in its cell."""
    for n in range(len(around)):
        beyond = 0.0  # squared distance of that cell
        for a in range(3):
            step = around[n, a]
            beyond += 0.0 if step == 0 else place[a] ** 2 if step < 0 else (1 - place[a]) ** 2
        if beyond > 1 + 1e-9:
            continue
        key = _key(cell[0] + around[n, 0], cell[1] + around[n, 1], cell[2] + around[n, 2])
        j = firsts[_slot(keys, firsts, key)]
        while j >= 0:
            apart = dot = 0.0
            for a in range(3):
                apart += (points[i, a] - points[j, a]) ** 2
            if len(normals) == len(points):
                for a in range(3):
                    dot += normals[i, a] * normals[j, a]
            if apart < spacing * spacing and dot >= OPPOSED:
                return True
            j = others[j]
    return False


@numba.njit(cache=True, nogil=True)
def _key(x, y, z):
    """A number for a cell. Should two share one, that costs time and nothing else."""
    key = x * 73856093 + y * 19349663 + z * 83492791
    return key * 2654435761


@numba.njit(cache=True, nogil=True)
def _slot(keys, firsts, key):
    """Where the cell is in the table, or would be."""
    slot = (key >> 16) & (len(keys) - 1)
    while firsts[slot] >= 0 and keys[slot] != key:
        slot = (slot + 1) & (len(keys) - 1)
    return slot


@numba.njit(cache=True, nogil=True)
def _enlarged(keys, firsts):
    """The table with twice the room."""
    more, heads = np.zeros(2 * len(keys), np.int64), np.full(2 * len(keys), -1)
    for slot in range(len(keys)):
        if firsts[slot] >= 0:
            other = _slot(more, heads, keys[slot])
            more[other], heads[other] = keys[slot], firsts[slot]
    return more, heads


def scattered(expected: F64, rng: np.random.Generator) -> F64:
    """(N, 2) x, y of random points from a grid's corner on, `expected` (h, w) of them per cell."""
    counts = np.floor(expected + rng.random(expected.shape)).astype(int)
    rows, columns = np.nonzero(counts)
    repeat = counts[rows, columns]
    cells = np.column_stack([np.repeat(columns, repeat), np.repeat(rows, repeat)])
    return cells + rng.random((len(cells), 2))
