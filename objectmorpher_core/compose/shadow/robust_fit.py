"""Linear regression that outliers do not spoil (Huber's loss, iteratively reweighted).

Holland and Welsch 1977, "Robust Regression Using Iteratively Reweighted Least-Squares".
"""

from __future__ import annotations

import numpy as np

from ...base.arrays import F64

ROUNDS = 5
HUBER = 1.3  # x the scale of what is usual
LEAST_SCALE = 0.02


def regressed(
    basis: F64, values: F64, weight: F64, scale: float | None = None
) -> tuple[F64, float, float]:
    """Coefficients, mean loss and scale of the robust fit of `values` (n,) by a basis (n, k)."""
    weights, found, used = weight, np.zeros(basis.shape[1]), 0.0
    rest = values
    for _ in range(ROUNDS):
        weighted = basis * weights[:, None]
        ridge = 1e-6 * len(values) * np.eye(basis.shape[1])
        found = np.linalg.solve(weighted.T @ basis + ridge, weighted.T @ values)
        rest = values - basis @ found
        used = 1.4826 * float(np.median(np.abs(rest))) + LEAST_SCALE
        weights = weight / np.maximum(np.abs(rest) / (HUBER * used), 1)
    off = np.abs(rest) / (used if scale is None else scale)
    loss = np.where(off < HUBER, off * off / 2, HUBER * off - HUBER**2 / 2)
    return np.asarray(found, np.float64), float((weight * loss).sum() / weight.sum()), used
