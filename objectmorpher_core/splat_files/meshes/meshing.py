"""The surface that Gaussians lie on, as triangles.

The signed distance to the Gaussians' planes, blended by nearness (implicit moving least squares,
Kolluri 2008), is sampled on a grid near them; between inside and outside each cell that the
surface crosses gets one vertex (surface nets, Gibson 1998), which is then moved onto the surface.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F64, I64
from ...document.gaussians import Gaussians
from ..limits import SplatFileError

CELLS = 144  # along the longest side
LEAST_CELL = 0.9  # x the spacing of the Gaussians: finer cells show their planes
REACH = 2.5  # cells around the Gaussians in which there is a distance
NEAREST = 12  # Gaussians that it is blended of
STEPS = 3  # of a vertex towards the surface
MOST_PLACES = 4_000_000  # of the grid, near the Gaussians
CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.int64)
EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8)
                  if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1])  # fmt: skip


def surface_of(gaussians: Gaussians) -> tuple[F64, I64]:
    """Vertices (V, 3) and triangles (T, 3), outward by the right-hand rule.

    The Gaussians are of one object, local +z outwards. Raises SplatFileError where they are no
    surface.
    """
    means, normals = gaussians.means.astype(np.float64), gaussians.normals.astype(np.float64)
    if len(means) < NEAREST:
        raise SplatFileError("there are too few Gaussians for a surface")
    tree = KDTree(means)
    spacing = float(np.median(tree.query(means, 2)[0][:, 1])) * np.sqrt(2)
    extent = float(np.ptp(means, axis=0).max())
    cell = max(extent / CELLS, LEAST_CELL * spacing)
    if not extent > 0 or not cell > 0:
        raise SplatFileError("the Gaussians all lie in one point")
    field = _Field(tree, means, normals, cell)
    places = _near(means, cell)
    low = means.min(0) - 4 * cell
    values = field.at(low + places * cell)
    vertices, quads = _net(places, values)
    if not len(quads):
        raise SplatFileError("the Gaussians lie on no surface")
    vertices = field.onto_surface(low + vertices * cell)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return _used(vertices, triangles)


class _Field:
    """The signed distance to the Gaussians' planes, blended by nearness."""

    def __init__(self, tree: KDTree, means: F64, normals: F64, cell: float) -> None:
        self._tree, self._means, self._normals, self._cell = tree, means, normals, cell

    def at(self, points: F64) -> F64:
        """(P,) positive outside."""
        return np.concatenate([self._block(p)[0] for p in _blocks(points)])

    def onto_surface(self, points: F64) -> F64:
        """(P, 3) moved along the blended normal to where the distance is zero."""
        for _ in range(STEPS):
            moved = []
            for block in _blocks(points):
                distance, normal = self._block(block)
                step = np.clip(distance, -self._cell, self._cell)
                moved.append(block - step[:, None] * normal)
            points = np.concatenate(moved)
        return points

    def _block(self, points: F64) -> tuple[F64, F64]:
        far, which = self._tree.query(points, NEAREST)
        width = np.maximum(far[:, NEAREST // 2], self._cell)[:, None]
        weights = np.exp(-((far / width) ** 2) * 2)
        weights /= weights.sum(1, keepdims=True)
        normals = self._normals[which]
        planes = np.einsum("pkc,pkc->pk", normals, points[:, None] - self._means[which])
        normal = np.einsum("pk,pkc->pc", weights, normals)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return (weights * planes).sum(1), normal / np.maximum(length, 1e-9)


def _blocks(points: F64) -> list[F64]:
    return np.array_split(points, max(len(points) // 50_000, 1))


def _near(means: F64, cell: float) -> I64:
    """(P, 3) the places of the grid that are near a Gaussian, each once."""
    own = np.unique(np.floor((means - means.min(0)) / cell).astype(np.int64) + 4, axis=0)
    reach = int(np.ceil(REACH))
    steps = np.mgrid[-reach : reach + 2, -reach : reach + 2, -reach : reach + 2]
    steps = steps.reshape(3, -1).T
    steps = steps[np.linalg.norm(steps - 0.5, axis=1) <= REACH + 0.5]
    size = own.max(0) + 8
    if len(own) > MOST_PLACES // 8:
        raise SplatFileError("there are too many Gaussians for a mesh")
    flags = np.zeros(size, bool)
    for step in steps:
        flags[tuple((own + step).T)] = True
    return np.argwhere(flags)


def _net(places: I64, values: F64) -> tuple[F64, I64]:
    """Vertices (V, 3) in cells, and quadrilaterals (Q, 4) of them."""
    size = places.max(0) + 2
    grid = np.full(size, np.nan)
    grid[tuple(places.T)] = values
    corners = np.stack([_shifted(grid, c) for c in CORNERS])  # (8, x, y, z) of each cell
    low, high = corners.min(0), corners.max(0)  # NaN where a corner is missing
    with np.errstate(invalid="ignore"):
        crossed = np.argwhere((low < 0) & (high >= 0))
    number = np.full(low.shape, -1, np.int64)
    number[tuple(crossed.T)] = np.arange(len(crossed))
    own = corners[:, crossed[:, 0], crossed[:, 1], crossed[:, 2]].T  # (V, 8)
    a, b = own[:, EDGES[:, 0]], own[:, EDGES[:, 1]]
    cuts = (a < 0) != (b < 0)
    along = np.where(cuts, a / np.where(cuts, a - b, 1), 0)
    ends = CORNERS[EDGES[:, 0]], CORNERS[EDGES[:, 1]]
    spots = ends[0] + along[..., None] * (ends[1] - ends[0])
    vertices = crossed + (spots * cuts[..., None]).sum(1) / cuts.sum(1, keepdims=True)
    quads = [_quads(grid, number, axis) for axis in range(3)]
    return vertices, np.concatenate(quads)


def _shifted(grid: F64, corner: I64) -> F64:
    x, y, z = corner
    return grid[x : grid.shape[0] - 1 + x, y : grid.shape[1] - 1 + y, z : grid.shape[2] - 1 + z]


def _quads(grid: F64, number: I64, axis: int) -> I64:
    """The four cells around each edge along `axis` that the surface crosses, outwards."""
    one, two = [k for k in range(3) if k != axis] if axis != 1 else (2, 0)
    step = np.eye(3, dtype=np.int64)
    start = grid[tuple(slice(1, -1) if k != axis else slice(0, -1) for k in range(3))]
    end = grid[tuple(slice(1, -1) if k != axis else slice(1, None) for k in range(3))]
    with np.errstate(invalid="ignore"):
        found = np.argwhere(((start < 0) & (end >= 0)) | ((start >= 0) & (end < 0)))
    leaves = start[tuple(found.T)] < 0  # from inside to outside
    at = found + 1 - step[axis]
    around = [at - step[one] - step[two], at - step[two], at, at - step[one]]
    last = np.array(number.shape) - 1
    quads = np.stack([number[tuple(np.minimum(place, last).T)] for place in around], 1)
    quads[~leaves] = quads[~leaves][:, ::-1]
    return quads[(quads >= 0).all(1)]


def _used(vertices: F64, triangles: I64) -> tuple[F64, I64]:
    """Without the vertices that no triangle has."""
    used, fresh = np.unique(triangles, return_inverse=True)
    return vertices[used], fresh.reshape(-1, 3)
