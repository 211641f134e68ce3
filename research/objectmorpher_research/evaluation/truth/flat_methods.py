"""Methods in the plane of the picture: nothing, a similarity, an as-rigid-as-possible warp.

The warp is the puppet warp of Igarashi, Moscovich, Hughes 2005, by the local and global steps of
Sorkine, Alexa 2007, on a grid of triangles over the cut-out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from objectmorpher_core.base.arrays import F64, I32, RGB, crop
from objectmorpher_core.document.model import Matte

from .cases import EditOutcome, TruthCase, TruthGuidance
from .layer import TexturedMesh, draw_sheet

CELLS = 32  # of the warp's grid along the cut-out's longer side
LEAST_CELL = 4.0  # px
ITERATIONS = 300
STIFF = 1e4  # x the links' weight, that holds the points where they must be
STILL = 1e-4  # px, at which the warp has settled


def do_nothing(case: TruthCase) -> EditOutcome:
    """The photo as it is."""
    return EditOutcome(case.photo, case.mask.astype(np.float64), case.guidance.at)


def paste(case: TruthCase, matte: Matte, plate: RGB) -> EditOutcome:
    """The cut-out moved, turned in the plane and scaled as fits the points best."""
    motion = fitted_similarity(case.guidance)
    x0, y0, x1, y1 = (float(v) for v in matte.box)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    sheet = TexturedMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    return _drawn(sheet, motion.at(corners), case, matte, plate, motion.at(case.guidance.at))


def warp(case: TruthCase, matte: Matte, plate: RGB) -> EditOutcome:
    """The cut-out warped so that its points are where they must be, as rigidly as it can be."""
    guidance, grid = case.guidance, _grid(case, matte)
    start = fitted_similarity(guidance)
    size = start.scale if guidance.rigid is not None else 1.0  # what is given of the whole thing
    moved = _arap(grid, guidance, start.at(grid.points), size)
    reached = grid.weights(guidance.at) @ moved
    sheet = TexturedMesh(grid.points, grid.faces)
    return _drawn(sheet, moved, case, matte, plate, reached)


def _drawn(
    sheet: TexturedMesh, at: F64, case: TruthCase, matte: Matte, plate: RGB, reached: F64
) -> EditOutcome:
    height, width = case.mask.shape
    layer = draw_sheet(sheet, at, np.ones(len(at)), matte, (width, height))
    return EditOutcome(layer.over(plate, case.photo, matte), layer.alpha, reached)


@dataclass(frozen=True, eq=False)
class Similarity:
    """(x, y) -> matrix (x, y) + shift."""

    matrix: F64  # (2, 2) a turn times a scale
    shift: F64  # (2,)

    def at(self, points: F64) -> F64:
        return points @ self.matrix.T + self.shift

    @property
    def scale(self) -> float:
        return float(np.sqrt(abs(np.linalg.det(self.matrix))))


def fitted_similarity(guidance: TruthGuidance) -> Similarity:
    """The one that takes the points nearest to where they must be, by least squares."""
    at, to = guidance.at, guidance.to
    a, b = at - at.mean(0), to - to.mean(0)
    square = max(float((a**2).sum()), 1e-9)
    cosine = float((a * b).sum()) / square
    sine = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()) / square
    if len(at) < 2:
        cosine, sine = 1.0, 0.0
    matrix = np.array([[cosine, -sine], [sine, cosine]])
    return Similarity(matrix, to.mean(0) - at.mean(0) @ matrix.T)


@dataclass(frozen=True, eq=False)
class WarpGrid:
    """Squares, each cut into two triangles, that hold the cut-out."""

    points: F64  # (V, 2) px
    faces: I32  # (F, 3)
    links: I32  # (L, 2)

    def weights(self, xy: F64) -> csc_array:
        """(n, V) of the corners around places (n, 2)."""
        a, b, c = (self.points[self.faces[:, k]] for k in range(3))
        rows, columns, values = [], [], []
        for n, place in enumerate(xy):
            area = _cross(b - a, c - a)
            u = _cross(b - place, c - place) / area
            v = _cross(c - place, a - place) / area
            f = int(np.minimum(np.minimum(u, v), 1 - u - v).argmax())
            rows += [n] * 3
            columns += list(self.faces[f])
            values += [u[f], v[f], 1 - u[f] - v[f]]
        return csc_array((values, (rows, columns)), shape=(len(xy), len(self.points)))


def _cross(u: F64, v: F64) -> F64:
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _grid(case: TruthCase, matte: Matte) -> WarpGrid:
    height, width = case.mask.shape
    covered = crop(matte.alpha, matte.box, (0, 0, width, height)) > 0
    rows, columns = np.nonzero(covered)
    x0, y0 = float(columns.min()) - 1, float(rows.min()) - 1
    extent = max(np.ptp(columns), np.ptp(rows)) + 3.0
    cell = max(extent / CELLS, LEAST_CELL)
    m, n = (int(np.ceil((np.ptp(k) + 3.0) / cell)) for k in (columns, rows))
    x, y = ((columns - x0) / cell).astype(int), ((rows - y0) / cell).astype(int)
    used = np.zeros((n, m), bool)
    used[np.clip(y, 0, n - 1), np.clip(x, 0, m - 1)] = True
    used = cv2.dilate(used.astype(np.uint8), np.ones((2, 2), np.uint8)) > 0
    i, j = np.nonzero(used)
    corner = i * (m + 1) + j
    a, b, c, d = corner, corner + 1, corner + m + 2, corner + m + 1
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    links = np.concatenate(
        [np.column_stack(p) for p in ((a, b), (b, c), (d, c), (a, d), (a, c), (b, d))]
    )
    links = np.unique(np.sort(links, axis=1), axis=0)
    kept, faces = np.unique(faces, return_inverse=True)
    links = np.searchsorted(kept, links)
    places = np.column_stack([kept % (m + 1), kept // (m + 1)]).astype(np.float64)
    points = places * cell + [x0, y0]
    return WarpGrid(points, faces.reshape(-1, 3).astype(np.int32), links.astype(np.int32))


def _arap(grid: WarpGrid, guidance: TruthGuidance, start: F64, size: float) -> F64:
    """(V, 2) where the grid's points go; `size` times as large as it is."""
    count, (i, j) = len(grid.points), grid.links.T
    edges = size * (grid.points[j] - grid.points[i])
    ones = np.ones(len(i))
    links = coo_array((ones, (i, j)), shape=(count, count))
    links = csc_array(links + links.T)
    held = grid.weights(guidance.at)
    laplacian = diags_array(np.asarray(links.sum(1)).ravel()) - links
    factor = splu(csc_array(laplacian + STIFF * (held.T @ held)))
    goal = STIFF * (held.T @ guidance.to)
    points = start
    for _ in range(ITERATIONS):
        now = points[j] - points[i]
        cosine, sine = (edges * now).sum(1), _cross(edges, now)
        turn = np.zeros((count, 2))
        for ends in (i, j):
            np.add.at(turn, ends, np.column_stack([cosine, sine]))
        turn /= np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), 1e-12)
        mean = 0.5 * (turn[i] + turn[j])
        wanted = np.column_stack(
            [mean[:, 0] * edges[:, 0] - mean[:, 1] * edges[:, 1],
             mean[:, 1] * edges[:, 0] + mean[:, 0] * edges[:, 1]]
        )  # fmt: skip
        right = goal.copy()
        np.add.at(right, i, -wanted)
        np.add.at(right, j, wanted)
        before, points = points, factor.solve(right)
        if np.abs(points - before).max() < STILL:
            break
    return points
