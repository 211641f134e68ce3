"""Kernel Inception Distance (Binkowski et al., arXiv 1801.01401): MMD^2 with a cubic kernel.

k(x, y) = (x.y / d + 1)^3. Gretton et al. (JMLR 13, 2012) give two unbiased estimators of MMD^2:
eq. 3 takes x and y to be independent, eq. 4 leaves the pairs (x_i, y_i) out. A set of photos and
the same photos edited are not independent: eq. 3 then falls below zero, by about
2/n E[k(x_i, y_i) - k(x_i, y_j)] less than it should, and rewards doing nothing. Eq. 4 does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..bootstrap import NORMAL, Estimate
from ..error import EvaluationError

DEGREE = 3
SUBSETS, SUBSET_SIZE = 100, 1000  # the usual ones; a subset is never larger than a set


@dataclass(frozen=True)
class Subsets:
    """The averaging of KID."""

    count: int = SUBSETS
    size: int = SUBSET_SIZE
    seed: int = 0


def polynomial_kernel(x: F64, y: F64) -> F64:
    """(n, m) of rows (n, d) and (m, d)."""
    return (x @ y.T / x.shape[1] + 1) ** DEGREE


def unbiased_mmd2(x: F64, y: F64) -> float:
    """Gretton eq. 3 of independent samples (n, d) and (m, d): below zero as often as above."""
    within_x, within_y = (_mean_off_diagonal(polynomial_kernel(s, s)) for s in _checked(x, y))
    return within_x + within_y - 2 * float(polynomial_kernel(x, y).mean())


def kid(x: F64, y: F64, subsets: Subsets) -> Estimate:
    """The mean of `unbiased_mmd2` over random subsets, and the middle 95 % of theirs.

    One subset holds all where `subsets.size` is as large as the sets: there is no interval then.
    """
    size = min(subsets.size, len(x), len(y))
    if size == len(x) == len(y):
        return Estimate(unbiased_mmd2(x, y))
    random = np.random.default_rng(subsets.seed)
    found = [
        unbiased_mmd2(
            x[random.choice(len(x), size, replace=False)],
            y[random.choice(len(y), size, replace=False)],
        )
        for _ in range(subsets.count)
    ]
    low, high = np.quantile(found, (0.025, 0.975))
    return Estimate(float(np.mean(found)), float(low), float(high))


def paired_kid(x: F64, y: F64) -> Estimate:
    """Gretton eq. 4 of pairs (n, d) and (n, d): unbiased although x_i and y_i belong together.

    Exactly zero for equal sets. The interval is the jackknife's: in the bootstrap a pair that is
    drawn twice is alike to itself, which biases the estimate.
    """
    terms = _paired_terms(x, y)
    n = len(terms)
    np.fill_diagonal(terms, 0)
    total = terms.sum()
    value = float(total / (n * (n - 1)))
    if n < 3:
        return Estimate(value)
    without = (total - 2 * terms.sum(1)) / ((n - 1) * (n - 2))  # the i-th pair left out
    error = float(np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum()))
    return Estimate(value, value - NORMAL * error, value + NORMAL * error)


def _paired_terms(x: F64, y: F64) -> F64:
    """(n, n) h(z_i, z_j) = k(x_i, x_j) + k(y_i, y_j) - k(x_i, y_j) - k(x_j, y_i)."""
    x, y = _checked(x, y)
    if len(x) != len(y):
        raise EvaluationError(f"pairs need two sets of one size, not {len(x)} and {len(y)}")
    across = polynomial_kernel(x, y)
    return polynomial_kernel(x, x) + polynomial_kernel(y, y) - across - across.T


def _checked(x: F64, y: F64) -> tuple[F64, F64]:
    if min(len(x), len(y)) < 2:
        raise EvaluationError("the distance of two sets needs at least two pictures in each")
    return np.asarray(x, np.float64), np.asarray(y, np.float64)


def _mean_off_diagonal(kernel: F64) -> float:
    n = len(kernel)
    return float((kernel.sum() - np.trace(kernel)) / (n * (n - 1)))
