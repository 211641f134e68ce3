"""Anderson acceleration of a fixed-point iteration (Peng et al. 2018; Walker & Ni 2011)."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64, frozen
from ..base.kernel_files import numba
from ..base.threads import FAST

WINDOW = 12  # previous steps that are combined
RIDGE = 1e-12  # on the normalised Gram matrix of the steps: float64 squared leaves no more


class Anderson:
    """Extrapolates from the last few steps of x -> g(x)."""

    def __init__(self, size: int) -> None:
        """`size`: how many numbers x is."""
        self._residuals = np.zeros((WINDOW, size))  # changes of g(x) - x from step to step
        self._values = np.zeros((WINDOW, size))  # changes of g(x)
        self._gram = np.zeros((WINDOW, WINDOW))  # of the residuals' changes
        self._count = 0  # steps kept
        self._next = 0  # row of the next step
        self._last: tuple[F64, F64] | None = None  # g(x), g(x) - x

    def forget(self) -> None:
        """Drops the steps: they led uphill."""
        self._count = self._next = 0

    def resume(self) -> None:
        """The map has changed a little: what was learnt of it counts, where it was does not."""
        self._last = None

    def mix(self, value: F64, residual: F64) -> F64:
        """The next x from `value` = g(x) and `residual` = g(x) - x, of any one shape."""
        flat_value, flat_residual = value.ravel(), residual.ravel()
        if self._last is not None:
            self._keep(flat_value - self._last[0], flat_residual - self._last[1])
        self._last = flat_value, flat_residual
        if self._count == 0:
            return value
        steps = self._residuals[: self._count]
        gram = self._gram[: self._count, : self._count].copy()
        size = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
        gram /= size[:, None] * size
        gram.flat[:: self._count + 1] += RIDGE
        shares = solve_small(gram, _products(steps, flat_residual) / size) / size
        mixed = np.empty(flat_value.size)
        _less(frozen(flat_value), frozen(self._values), shares, mixed)
        return mixed.reshape(value.shape)

    def _keep(self, value: F64, residual: F64) -> None:
        row = self._next
        self._residuals[row], self._values[row] = residual, value
        self._count = min(self._count + 1, WINDOW)
        self._next = (row + 1) % WINDOW
        products = _products(self._residuals[: self._count], residual)
        self._gram[row, : self._count] = self._gram[: self._count, row] = products


def _products(rows: F64, column: F64) -> F64:
    """rows (k, n) times column (n,), in this thread: BLAS would wake others for it."""
    out = np.empty(len(rows))
    _multiply(frozen(rows), frozen(column), out)
    return out


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _multiply(rows, column, out):
    for k in range(len(rows)):
        total = 0.0
        for i in range(len(column)):
            total += rows[k, i] * column[i]
        out[k] = total


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _less(value, rows, shares, out):
    """out := value - sum_k shares_k rows_k."""
    for i in range(len(value)):
        out[i] = value[i]
    for k in range(len(shares)):
        for i in range(len(value)):
            out[i] -= shares[k] * rows[k, i]


# Small dense systems: for a dozen unknowns calling LAPACK takes longer than solving.

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
