"""Random walk with restart from clicks over a grid of features, and where its spread stops.

r = (D - a A)^-1 e: how often a walk that starts at the click visits each cell before it tires
(Grady 2006; Pan et al. 2004), with A_ij = exp(-d_ij / T), d_ij = |f_i - f_j|^2 / 2 between near
cells. log r falls slowly inside an object and drops at its border.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ..base.arrays import F32, F64, Mask

REACH = 2  # cells, Chebyshev: how far a step goes; beyond 1, so that a thin line is no wall
STAMINA = 0.999  # a: the chance that a walk goes on
LEVELS = 120  # outlines tried between the click's cell and all cells, growing by equal factors


@dataclass(frozen=True, eq=False)
class Region:
    """An outline around a click."""

    mask: Mask  # (h, w) cells
    contrast: float  # mean d across its outline; the photo's border does not count


class Walk:
    """Precomputed for a grid of features; `spread` and `regions` are then cheap."""

    def __init__(self, features: F32, temperature: float) -> None:
        height, width, _ = features.shape
        self.shape = (height, width)
        self.features = features
        cells = np.arange(height * width).reshape(height, width)
        rows, columns, weights = [], [], []
        for dy in range(REACH + 1):
            for dx in range(-REACH, REACH + 1):
                if (dy, dx) <= (0, 0):
                    continue
                a, b = _pairs(dy, dx)
                gap = _gap(features[a], features[b])
                rows.append(cells[a].ravel())
                columns.append(cells[b].ravel())
                weights.append(np.exp(-gap.ravel() / temperature) + 1e-9)
        triplet = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
        half = sparse.csr_matrix(triplet, shape=(cells.size, cells.size))
        links = half + half.T
        degrees = sparse.diags(np.asarray(links.sum(1)).ravel() + 1e-9)
        self._laplacian = (degrees - links).tocsc()
        self._solver = splu((degrees - STAMINA * links).tocsc())
        self._gap_x = _gaps_along_x(features)  # (h, w - 1)
        self._gap_y = _gaps_along_x(features.transpose(1, 0, 2)).T  # (h - 1, w)

    def only(self, cell: tuple[int, int]) -> F64:
        """(h, w) 1 at `cell` (row, column), 0 elsewhere."""
        alone = np.zeros(self.shape)
        alone[cell] = 1
        return alone

    def spread(self, sources: F64) -> F64:
        """(h, w) log of how much of `sources` (h, w) visits each cell."""
        visits = self._solver.solve(sources.ravel())
        return np.log(np.maximum(visits, 1e-30)).reshape(self.shape)

    def settle(self, is_object: Mask, is_ground: Mask) -> F64:
        """(h, w) chance that a walk from a cell meets the object before the ground, both (h, w)."""
        known = 1e6 * (is_object | is_ground).astype(np.float64).ravel() + 1e-9
        system = (self._laplacian + sparse.diags(known)).tocsc()
        target = np.where(is_object, 1.0, np.where(is_ground, 0.0, 0.5)).ravel()
        return splu(system).solve(known * target).reshape(self.shape)

    def contrast(self, mask: Mask, within: Mask | None = None) -> float:
        """Mean gap between the neighbours (h, w) that the outline of `mask` parts.

        With `within`, of the outline's stretches inside that mask only; 0 where there are none.
        """
        across_x, across_y = mask[:, 1:] != mask[:, :-1], mask[1:] != mask[:-1]
        if within is not None:
            across_x &= within[:, 1:] & within[:, :-1]
            across_y &= within[1:] & within[:-1]
        count = across_x.sum() + across_y.sum()
        total = self._gap_x[across_x].sum() + self._gap_y[across_y].sum()
        return float(total / max(count, 1))

    def regions(self, spread: F64, cell: tuple[int, int]) -> list[Region]:
        """The connected pieces around `cell` (row, column), from small to large."""
        found: list[Region] = []
        size = 0
        falling = np.sort(spread, axis=None)[::-1]
        ranks = np.unique(np.geomspace(1, falling.size, LEVELS).astype(int)) - 1
        for level in falling[ranks]:
            if level > spread[cell]:
                continue
            _, labels = cv2.connectedComponents((spread >= level).astype(np.uint8), connectivity=4)
            mask = labels == labels[cell]
            if mask.sum() > size and not mask.all():
                size = int(mask.sum())
                found.append(Region(mask, self.contrast(mask)))
        return found


def _gaps_along_x(features: F32) -> F64:
    """(h, w - 1) d across each border between neighbours, tolerant of a border one cell off.

    Half is d of the two neighbours, half the largest d of pairs up to three cells apart.
    """
    width = features.shape[1]
    near = _gap(features[:, 1:], features[:, :-1])
    far = near.copy()
    for before, after in ((1, 0), (0, 1), (1, 1)):
        left = np.maximum(np.arange(width - 1) - before, 0)
        right = np.minimum(np.arange(1, width) + after, width - 1)
        far = np.maximum(far, _gap(features[:, left], features[:, right]))
    return 0.5 * (near + far)


def _gap(a: F32, b: F32) -> F64:
    return 0.5 * np.square(a - b).sum(-1, dtype=np.float64)


def _pairs(dy: int, dx: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The two slices of a grid whose cells lie (dy >= 0, dx) apart."""
    near = slice(None, -dy or None)
    far = slice(dy, None)
    if dx >= 0:
        return (near, slice(None, -dx or None)), (far, slice(dx, None))
    return (near, slice(-dx, None)), (far, slice(None, dx))
