"""An object out of a splat file: without stray splats, its flat ones facing outwards.

A trained file knows nothing of surfaces: the axes of its Gaussians stand in any order, a few of
them float far outside, and nothing says where outside is. The document's Gaussians are better
known (see `Gaussians`): local +z is the thinnest axis and the outward normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F64, Mask
from ...base.rotations import matrices_from_quats, quats_from_matrices
from ...base.threads import LEAST_ROWS, in_threads
from ...document.gaussians import Gaussians
from ..limits import SplatFileError

# Which side of a surface is outside, from its points alone.
#
# The points mark the cells of a coarse grid, and the cells around those. What can be reached from
# the grid's border through unmarked cells is outside. A point looks along its normal and against
# it: the sooner it sees the outside, the more that side is open.

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


SHARE = 0.005  # of the opacity, that may lie outside the core box on each side
MARGIN = 0.75  # x the core box: what reaches farther out than this belongs to no object
THICK = 0.5  # x the core box: a Gaussian wider than this is haze
FAINT = 0.02  # opacity that nobody sees


def as_object(gaussians: Gaussians) -> Gaussians:
    """The Gaussians as an object's, in the object frame: centred, largest extent 1.

    Left out are floaters and what is too faint to be seen. Raises SplatFileError where no more
    than a point is left.
    """
    gaussians = gaussians.select(is_of_object(gaussians))
    gaussians = centred(gaussians)
    return facing_outwards(thinnest_last(gaussians))


def is_of_object(gaussians: Gaussians) -> Mask:
    """(N,) False for floaters: far outside the box that holds nearly all of the opacity."""
    seen = gaussians.opacities > FAINT
    if not seen.any():
        raise SplatFileError("none of the file's Gaussians can be seen")
    low, high = core_box(gaussians.means[seen], gaussians.opacities[seen])
    extent = float((high - low).max())
    if not extent > 0:
        return seen
    margin = MARGIN * extent
    near = ((gaussians.means >= low - margin) & (gaussians.means <= high + margin)).all(1)
    return seen & near & (gaussians.scales.max(1) <= THICK * extent)


def core_box(points: np.ndarray, weights: np.ndarray) -> tuple[F64, F64]:
    """Low and high corner (3,) of the box that holds all but SHARE of the weight on each side."""
    corners = []
    for axis in range(3):
        order = np.argsort(points[:, axis], kind="stable")
        share = np.cumsum(weights[order], dtype=np.float64)
        first, last = np.searchsorted(share / share[-1], [SHARE, 1 - SHARE])
        corners.append(points[order[[first, min(last, len(order) - 1)]], axis])
    low, high = np.array(corners, np.float64).T
    return low, high


def centred(gaussians: Gaussians) -> Gaussians:
    """Moved and scaled to the object frame: centred, largest extent 1."""
    if not len(gaussians):
        raise SplatFileError("the file holds no Gaussians of an object")
    low, high = gaussians.means.min(0), gaussians.means.max(0)
    extent = float((high - low).max())
    if not extent > 0:
        raise SplatFileError("the file's Gaussians all lie in one point")
    means = (gaussians.means.astype(np.float64) - (low.astype(np.float64) + high) / 2) / extent
    return Gaussians(
        means.astype(np.float32), gaussians.quats, (gaussians.scales / extent).astype(np.float32),
        gaussians.opacities, gaussians.colors,
    )  # fmt: skip


def thinnest_last(gaussians: Gaussians) -> Gaussians:
    """Return the same Gaussians with axes in the order of their lengths, local +z the thinnest."""
    order = np.argsort(-gaussians.scales, axis=1, kind="stable")
    if (order == [0, 1, 2]).all():
        return gaussians
    axes = matrices_from_quats(gaussians.quats.astype(np.float64))
    axes = np.take_along_axis(axes, order[:, None, :], axis=2)
    axes[np.linalg.det(axes) < 0, :, 0] *= -1
    scales = np.take_along_axis(gaussians.scales, order, axis=1)
    quats = quats_from_matrices(axes).astype(np.float32)
    return Gaussians(gaussians.means, quats, scales, gaussians.opacities, gaussians.colors)


def facing_outwards(gaussians: Gaussians) -> Gaussians:
    """Return the same Gaussians with local +z towards the nearer outside."""
    out = sides(gaussians.means.astype(np.float64), gaussians.normals.astype(np.float64))
    inward = out.behind < out.before
    w, x, y, z = gaussians.quats.T
    about_x = np.stack([-x, w, z, -y], axis=1)  # half a turn about the local x axis
    quats = np.where(inward[:, None], about_x, gaussians.quats)
    return Gaussians(
        gaussians.means, quats.astype(np.float32), gaussians.scales, gaussians.opacities,
        gaussians.colors,
    )  # fmt: skip
