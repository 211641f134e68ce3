"""Anderson acceleration of a fixed-point iteration (Peng et al. 2018; Walker & Ni 2011)."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64

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
        shares = np.linalg.solve(gram, _products(steps, flat_residual) / size) / size
        mixed = flat_value - np.einsum("k,kn->n", shares, self._values[: self._count])
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
    return np.einsum("kn,n->k", rows, column)
