"""Compiled queries of a graph of pieces, made many times a click.

A graph is a symmetric sparse matrix of links, `indptr` (n + 1,), `indices` (m,) and `data` (m,) as
scipy lays it out by rows; nothing is linked with itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse

from ...base.arrays import F64, Mask, Sparse, frozen, frozen_rows
from ...base.kernel_files import numba


def reached(links: Sparse, allowed: Mask, start: Mask) -> Mask:
    """(n,) the pieces that can be reached from those of `start` (n,) within `allowed` (n,)."""
    indptr, indices, _ = frozen_rows(links)
    return _flood(indptr, indices, frozen(allowed), frozen(start))


def highest(values: F64, low: np.ndarray, high: np.ndarray) -> F64:
    """(n,) the largest of values[low[k] : high[k]], for bounds (n,) that never fall."""
    largest = np.empty(len(values))
    _slide(frozen(values), frozen(low, np.int64), frozen(high, np.int64), largest)
    return largest


def restarting(links: Sparse, allowed: Mask, free: Mask, stamina: float) -> Sparse:
    """(f, f) the system of a walk among pieces `free` (n,) that ends on others, see `Pieces.grow`.

    It goes nowhere that is not `allowed` (n,); all that is free is.
    """
    inner = *frozen_rows(links), frozen(allowed), frozen(free)
    count = int(np.count_nonzero(free))
    room = int(np.diff(links.indptr)[free].sum()) + count
    indptr, indices = np.empty(count + 1, np.int32), np.empty(room, np.int32)
    data = np.empty(room)
    used = _collect(*inner, stamina, indptr, indices, data)
    return sparse.csc_matrix((data[:used], indices[:used], indptr), (count, count))


class Diagonals:
    """Systems that differ on their diagonals: a diagonal less the links."""

    def __init__(self, links: Sparse) -> None:
        count = links.shape[0]
        system = (sparse.diags(np.ones(count)) - links).tocsc()
        system.sort_indices()
        columns = np.repeat(np.arange(count), np.diff(system.indptr))
        self._system, self._places = system, np.flatnonzero(system.indices == columns)

    def system(self, diagonal: F64) -> Any:
        """(n, n) with `diagonal` (n,)."""
        data = self._system.data.copy()
        data[self._places] = diagonal
        return sparse.csc_matrix(
            (data, self._system.indices, self._system.indptr), self._system.shape
        )


@numba.njit(cache=True, nogil=True)
def _flood(indptr: np.ndarray, indices: np.ndarray, allowed: Mask, start: Mask) -> Mask:
    count = len(allowed)
    found = np.zeros(count, np.bool_)
    stack = np.empty(count, np.int32)
    size = 0
    for k in range(count):
        if start[k] and allowed[k]:
            found[k] = True
            stack[size] = k
            size += 1
    while size > 0:
        size -= 1
        here = stack[size]
        for place in range(indptr[here], indptr[here + 1]):
            there = indices[place]
            if allowed[there] and not found[there]:
                found[there] = True
                stack[size] = there
                size += 1
    return found


@numba.njit(cache=True, nogil=True)
def _slide(values: F64, low: np.ndarray, high: np.ndarray, largest: F64) -> None:
    """The places of falling values wait in a queue: its first is the largest of the window."""
    queue = np.empty(len(values), np.int64)
    first = last = taken = 0
    for k in range(len(values)):
        while taken < high[k]:
            while last > first and values[queue[last - 1]] <= values[taken]:
                last -= 1
            queue[last] = taken
            last += 1
            taken += 1
        while queue[first] < low[k]:
            first += 1
        largest[k] = values[queue[first]]


@numba.njit(cache=True, nogil=True)
def _collect(
    from_indptr: np.ndarray,
    from_indices: np.ndarray,
    from_data: F64,
    allowed: Mask,
    free: Mask,
    stamina: float,
    indptr: np.ndarray,
    indices: np.ndarray,
    data: F64,
) -> int:
    """Fills the system's columns; how many entries there are."""
    number = np.cumsum(free) - 1
    used = column = 0
    for here in range(len(free)):
        if not free[here]:
            continue
        indptr[column] = used
        degree, own = 0.0, -1
        for place in range(from_indptr[here], from_indptr[here + 1]):
            there = from_indices[place]
            if not allowed[there]:
                continue
            degree += from_data[place]
            if own < 0 and there > here:
                own = used
                indices[used] = column
                used += 1
            if free[there]:
                indices[used] = number[there]
                data[used] = -stamina * from_data[place]
                used += 1
        if own < 0:
            own = used
            indices[used] = column
            used += 1
        data[own] = degree + 1e-9
        column += 1
    indptr[column] = used
    return used
