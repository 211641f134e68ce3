"""How much a pose bends and stretches the object, control point by control point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64, Sparse
from ..document import Pose


@dataclass(frozen=True, eq=False)
class Strain:
    """Dimensionless; all 0 or 1 for a rigid motion."""

    energy: F64  # (M,) share of Eq. 2 over the weighted squares of the links at rest
    most: F64  # (M,) largest stretch along the surface, 1 = none
    least: F64  # (M,) smallest

    @property
    def worst(self) -> float:
        """The largest factor by which anything is longer or shorter than at rest."""
        return float(max(self.most.max(), 1.0 / max(float(self.least.min()), 1e-9)))


def measure_strain(points: F64, weights: Sparse, pose: Pose) -> Strain:
    """Strain of `pose` on the links `weights` (M, M) between rest control points (M, 3).

    The surroundings of a control point are mapped by F_i = (sum w e' e^T)(sum w e e^T)^-1, the
    least-squares fit to its links. Its links lie along a surface, so F_i is taken in the plane
    of their two widest directions, and its singular values are the stretches.
    """
    count = len(points)
    i = np.repeat(np.arange(count), np.diff(weights.indptr))
    j, w = weights.indices, weights.data
    rest, moved = points[j] - points[i], pose.points[j] - pose.points[i]
    gaps = moved - (pose.rotations[i] @ rest[..., None])[..., 0]
    squares = np.bincount(i, w * (rest**2).sum(1), minlength=count)
    energy = np.bincount(i, w * (gaps**2).sum(1), minlength=count)
    before = _summed(i, w[:, None, None] * rest[:, :, None] * rest[:, None, :], count)
    after = _summed(i, w[:, None, None] * moved[:, :, None] * rest[:, None, :], count)
    spread, axes = np.linalg.eigh(before)  # rising
    widest = np.maximum(spread[:, 2], 1e-300)
    is_line = spread[:, 1] < 1e-9 * widest  # of links all in one line: no second direction
    scale = np.where(np.stack([is_line, np.zeros_like(is_line)], 1), 1.0, spread[:, 1:])
    plane = after @ axes[:, :, 1:] / np.maximum(scale, 1e-300)[:, None, :]  # F V, (M, 3, 2)
    stretches = np.linalg.svd(plane, compute_uv=False)
    stretches[is_line] = stretches[is_line, :1]
    stretches[squares <= 0] = 1.0
    most, least = np.asarray(stretches.T, np.float64)
    return Strain(energy / np.maximum(squares, 1e-300), most, least)


def _summed(rows: np.ndarray, terms: F64, count: int) -> F64:
    """Sums (count, 3, 3) of the terms (E, 3, 3) of each row; rows ascend."""
    sums = np.zeros((count, 3, 3))
    starts = np.searchsorted(rows, np.arange(count))
    filled = np.flatnonzero(np.bincount(rows, minlength=count))
    if len(filled):
        sums[filled] = np.add.reduceat(terms, starts[filled], axis=0)
    return sums
