"""Which side of a surface is outside, from its points alone.

The points mark the cells of a coarse grid, and the cells around those. What can be reached from
the grid's border through unmarked cells is outside. A point looks along its normal and against
it: the sooner it sees the outside, the more that side is open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F64, Mask
from ...base.threads import LEAST_ROWS, in_threads

NEIGHBOURS = 6  # whose distance is the width of a cell: with those around it, nothing leaks
MOST_CELLS = 160  # along the longest side
PARTS = 16  # pieces for each thread: what one works with is small enough to stay in the cache
LOOKS = np.arange(1.0, 4.6, 0.25)  # cells from the surface at which a point looks


@dataclass(frozen=True, eq=False)
class OutsideDistance:
    """The distance from each point to the outside, in cells; inf where it is not near."""

    before: F64  # (N,) along the normal
    behind: F64  # (N,) against it


def sides(points: F64, normals: F64) -> OutsideDistance:
    """Return the sides of points (N, 3) on a surface with unit normals (N, 3)."""
    from scipy.ndimage import binary_dilation, binary_propagation
    from scipy.spatial import KDTree

    extent = float(np.ptp(points, axis=0).max())
    some = points[:: max(1, len(points) // 4000)]
    near = min(NEIGHBOURS + 1, len(points))
    gaps = KDTree(points).query(some, k=near, workers=1)[0].reshape(len(some), -1)
    cell = max(float(np.median(gaps[:, -1])), extent / MOST_CELLS, 1e-12)
    margin = int(LOOKS[-1]) + 2
    low = points.min(0) - margin * cell
    shape = tuple(((points.max(0) - low) / cell).astype(int) + margin + 1)

    def cells(places: F64) -> tuple[np.ndarray, ...]:
        return tuple(np.floor((places - low) / cell).astype(int).T)

    marked = np.zeros(shape, bool)
    marked[cells(points)] = True
    marked = np.asarray(binary_dilation(marked, np.ones((3, 3, 3), bool)))
    border = np.zeros(shape, bool)
    border[0] = True
    free = np.logical_not(marked)
    outside: Mask = np.asarray(binary_propagation(border, mask=free), bool)

    def first_open(directions: F64) -> F64:
        found = np.full(len(points), np.inf)

        def run(first: int, last: int) -> None:
            waiting = np.arange(first, last)  # that have not seen the outside yet
            for distance in LOOKS:
                places = points[waiting] + distance * cell * directions[waiting]
                is_out = outside[cells(places)]
                found[waiting[is_out]] = distance
                waiting = waiting[~is_out]

        in_threads(run, len(points), PARTS, least=LEAST_ROWS)
        return found

    return OutsideDistance(first_open(normals), first_open(-normals))
