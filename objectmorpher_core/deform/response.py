"""The response of control points to forces: the inverse of the grounded Laplacian.

Factored once per graph. Handles, pins and grips only add a few rows and columns to it
(`constraints.py`), so a change of their set needs no new factorisation.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.linalg import cholesky, get_lapack_funcs
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from ..base.arrays import F64, Sparse, frozen
from ..base.kernel_files import numba
from ..base.threads import FAST

SPARSE_FROM = 1500  # unknowns: from here two sparse triangular solves beat a dense product
JITTER = 1e-10  # x the largest diagonal, where rounding makes a pivot negative


class Response(Protocol):
    """K^-1 of a symmetric positive definite (n, n) K."""

    def solve(self, forces: F64) -> F64:
        """K^-1 forces, (n, 3)."""
        ...

    def columns(self, nodes: np.ndarray) -> F64:
        """Columns (n, len(nodes)) of K^-1."""
        ...


def build_response(matrix: Sparse) -> Response:
    """The response of K: dense for a few hundred unknowns, sparse for thousands."""
    if matrix.shape[0] < SPARSE_FROM:
        return DenseResponse(matrix)
    return SparseResponse(matrix)


class DenseResponse:
    """The inverse itself: a product for three columns takes some 0.05 ms for 512 unknowns."""

    def __init__(self, sparse: Sparse) -> None:
        matrix = sparse.toarray()
        top = float(matrix.diagonal().max(initial=0.0)) or 1.0
        try:
            lower = cholesky(matrix, lower=True, check_finite=False)
        except np.linalg.LinAlgError:  # coincident points: the smallest push off singular
            matrix = matrix + JITTER * top * np.eye(len(matrix))
            lower = cholesky(matrix, lower=True, check_finite=False)
        (potri,) = get_lapack_funcs(("potri",), (lower,))
        inverse, info = potri(lower, lower=True)
        assert info == 0, "the factor has a positive diagonal"
        self._inverse = frozen(np.tril(inverse) + np.tril(inverse, -1).T)

    def solve(self, forces: F64) -> F64:
        out = np.zeros((3, len(forces)))
        _symmetric_product(self._inverse, frozen(forces.T), out)
        return out.T

    def columns(self, nodes: np.ndarray) -> F64:
        return self._inverse[nodes].T  # symmetric, and rows are read in order


class SparseResponse:
    """L D L^T of a reordered K (minimum degree, by SuperLU without pivoting)."""

    def __init__(self, matrix: Sparse) -> None:
        top = float(matrix.diagonal().max(initial=0.0)) or 1.0
        factor = splu(
            csc_array(matrix + JITTER * 1e-4 * top * _identity(matrix.shape[0])),
            permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True},
        )  # fmt: skip
        assert np.array_equal(factor.perm_r, factor.perm_c), "K is symmetric: no pivoting"
        self._order = np.argsort(factor.perm_c)  # unknown at each row of the factor
        self._pivots = frozen(1.0 / factor.U.diagonal())
        self._lower = _triangle(csr_array(factor.L))
        # From its end backwards, L^T is lower triangular too.
        self._upper = _triangle(csr_array(factor.L.T[::-1, ::-1]))
        self._columns: dict[int, F64] = {}

    def solve(self, forces: F64) -> F64:
        x = np.ascontiguousarray(forces[self._order])
        _substitute(*self._lower, x)
        x = np.ascontiguousarray((x * self._pivots[:, None])[::-1])
        _substitute(*self._upper, x)
        out = np.empty(x.shape)
        out[self._order] = x[::-1]
        return out

    def columns(self, nodes: np.ndarray) -> F64:
        """Solved three at a time and remembered: the next handle set shares most of them."""
        new = [int(n) for n in np.unique(nodes) if int(n) not in self._columns]
        for first in range(0, len(new), 3):
            own = new[first : first + 3]
            unit = np.zeros((len(self._order), 3))
            unit[own, np.arange(len(own))] = 1.0
            self._columns |= dict(zip(own, self.solve(unit).T, strict=False))
        if len(nodes) == 0:
            return np.empty((len(self._order), 0))
        return np.stack([self._columns[int(n)] for n in nodes], axis=1)


def _identity(count: int) -> Sparse:
    steps = np.arange(count + 1)
    return csr_array((np.ones(count), steps[:-1], steps), shape=(count, count))


def _triangle(matrix: Sparse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row starts, columns and values without the unit diagonal."""
    matrix.setdiag(0.0)
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return (
        frozen(matrix.indptr, np.uint32), frozen(matrix.indices, np.uint32), frozen(matrix.data)
    )  # fmt: skip


def product(matrix: F64, columns: F64) -> F64:
    """matrix (n, m) times columns (m, 3): three columns are too few for BLAS to be quick."""
    out = np.empty((len(matrix), 3))
    _product(frozen(matrix), frozen(columns.T), out)
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _product(matrix, columns, out):
    """Two rows at a time, so that a column is read once for both."""
    count, length = matrix.shape
    for i in range(0, count - 1, 2):
        a0 = a1 = a2 = b0 = b1 = b2 = 0.0
        for k in range(length):
            a, b = matrix[i, k], matrix[i + 1, k]
            x, y, z = columns[0, k], columns[1, k], columns[2, k]
            a0 += a * x
            a1 += a * y
            a2 += a * z
            b0 += b * x
            b1 += b * y
            b2 += b * z
        out[i, 0], out[i, 1], out[i, 2] = a0, a1, a2
        out[i + 1, 0], out[i + 1, 1], out[i + 1, 2] = b0, b1, b2
    if count % 2:
        i = count - 1
        a0 = a1 = a2 = 0.0
        for k in range(length):
            a = matrix[i, k]
            a0 += a * columns[0, k]
            a1 += a * columns[1, k]
            a2 += a * columns[2, k]
        out[i, 0], out[i, 1], out[i, 2] = a0, a1, a2


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _symmetric_product(matrix, x, y):
    """y += matrix x for symmetric (n, n), x and y (3, n).

    Only the lower triangle is read, two rows at a time: half the memory, which is what takes time.
    """
    count = len(matrix)
    for i in range(0, count - 1, 2):
        x0, x1, x2 = x[0, i], x[1, i], x[2, i]
        z0, z1, z2 = x[0, i + 1], x[1, i + 1], x[2, i + 1]
        a0 = a1 = a2 = b0 = b1 = b2 = 0.0
        for k in range(i):
            a, b = matrix[i, k], matrix[i + 1, k]
            u, v, w = x[0, k], x[1, k], x[2, k]
            a0 += a * u
            a1 += a * v
            a2 += a * w
            b0 += b * u
            b1 += b * v
            b2 += b * w
            y[0, k] += a * x0 + b * z0
            y[1, k] += a * x1 + b * z1
            y[2, k] += a * x2 + b * z2
        d, e, f = matrix[i, i], matrix[i + 1, i], matrix[i + 1, i + 1]
        y[0, i] += a0 + d * x0 + e * z0
        y[1, i] += a1 + d * x1 + e * z1
        y[2, i] += a2 + d * x2 + e * z2
        y[0, i + 1] += b0 + e * x0 + f * z0
        y[1, i + 1] += b1 + e * x1 + f * z1
        y[2, i + 1] += b2 + e * x2 + f * z2
    if count % 2:
        i = count - 1
        for c in range(3):
            own = matrix[i, i] * x[c, i]
            for k in range(i):
                own += matrix[i, k] * x[c, k]
                y[c, k] += matrix[i, k] * x[c, i]
            y[c, i] += own


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _substitute(starts, columns, values, x):
    """x := L^-1 x, L unit lower triangular by rows without its diagonal, x (n, 3)."""
    for i in range(len(x)):
        a = b = c = 0.0
        for e in range(starts[i], starts[i + 1]):
            j, v = columns[e], values[e]
            a += v * x[j, 0]
            b += v * x[j, 1]
            c += v * x[j, 2]
        x[i, 0] -= a
        x[i, 1] -= b
        x[i, 2] -= c
