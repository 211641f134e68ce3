"""Small dense systems: for a dozen unknowns calling LAPACK takes longer than solving."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64, frozen
from ..base.kernel_files import numba
from ..base.threads import FAST

FEW = 48  # unknowns up to which it is quicker


def solve_small(matrix: F64, right: F64) -> F64:
    """x (n,) of matrix (n, n) x = right (n,), by elimination with the largest pivot of a column."""
    if len(right) > FEW:
        return np.asarray(np.linalg.solve(matrix, right), np.float64)
    x = right.copy()
    _eliminate(frozen(matrix), x)
    return x


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _eliminate(matrix, x):
    a, count = matrix.copy(), len(x)
    for k in range(count):
        pivot = k
        for i in range(k + 1, count):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            x[k], x[pivot] = x[pivot], x[k]
            for j in range(k, count):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, count):
            share = a[i, k] * inverse
            x[i] -= share * x[k]
            for j in range(k + 1, count):
                a[i, j] -= share * a[k, j]
    for k in range(count - 1, -1, -1):
        for j in range(k + 1, count):
            x[k] -= a[k, j] * x[j]
        x[k] /= a[k, k]
