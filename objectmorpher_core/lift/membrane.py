"""The membrane -laplace u = 1 over a mask: one sparse factorisation."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from ..arrays import F64, Mask

REACH = 0.25  # x the mask's longer side: how far it is thought to go on outside the picture


def solve_membrane(inside: Mask, open_sides: tuple[bool, bool, bool, bool]) -> F64:
    """u (h, w) in cells^2 with -laplace u = 1 in the cells of `inside`, u = 0 beyond its edge.

    The edge runs between an inside cell and its outside neighbour, half a cell from each centre.
    `open_sides` (top, bottom, left, right): there the mask leaves the picture, and the membrane
    goes on sloping down beyond the picture's frame, to 0 at REACH times the mask's longer side.
    The outermost ring of cells must be outside.
    """
    assert not (inside[0].any() or inside[-1].any() or inside[:, 0].any() or inside[:, -1].any())
    index = np.full(inside.shape, -1)
    rows, columns = np.nonzero(inside)
    index[rows, columns] = np.arange(len(rows))
    bottom, right = inside.shape[0] - 2, inside.shape[1] - 2
    frames = (rows == 1, rows == bottom, columns == 1, columns == right)
    steps = ((-1, 0), (1, 0), (0, -1), (0, 1))
    reach = REACH * max(np.ptp(rows), np.ptp(columns)) + 1  # cells
    diagonal = np.zeros(len(rows))
    entries = []
    for (dr, dc), is_frame, is_open in zip(steps, frames, open_sides, strict=True):
        neighbour = index[rows + dr, columns + dc]
        linked = neighbour >= 0
        # The edge lies half a cell away (weight 2), beyond an open frame farther.
        is_held = ~linked & ~(is_frame & is_open)
        diagonal += np.where(linked, 1.0, np.where(is_held, 2.0, 1.0 / reach))
        entries.append((np.flatnonzero(linked), neighbour[linked]))
    i = np.concatenate([e[0] for e in entries] + [np.arange(len(rows))])
    j = np.concatenate([e[1] for e in entries] + [np.arange(len(rows))])
    values = np.concatenate([-np.ones(len(i) - len(rows)), diagonal])
    matrix = csr_matrix((values, (i, j)), shape=(len(rows), len(rows))).tocsc()
    u = np.zeros(inside.shape)
    u[rows, columns] = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0).solve(
        np.ones(len(rows))
    )
    return u
