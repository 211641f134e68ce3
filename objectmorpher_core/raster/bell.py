"""A Gaussian on a tile: its values, and the pixels where it has any."""

from __future__ import annotations

import math

import numba
import numpy as np

from ..threads import FAST
from . import projection as p
from .sampling import ONE, ZERO
from .tile_memory import STRIP, STRIPS

STRIP_END = np.float32(STRIP - 1)
# exp(-t), 0 <= t <= 0.7: interpolated at Chebyshev points, right to 1e-7
E0, E1, E2, E3, E4, E5 = (
    np.float32(v)
    for v in (0.99999994, -0.99999389, 0.49989734, -0.16603126, 0.03986404, -0.00589814)
)
SIXTEENTH = np.float32(1 / 16)
LIMIT = np.float32(11.2)
BATCH = np.uint64(64)  # Gaussians whose rows are found together
CX, CY, TILT, EX, EY = (
    np.uint64(column * 64) for column in (p.CX, p.CY, p.TILT, p.EX, p.EY)
)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def bell(q):
    """exp(-q / 2) for 0 <= q <= 11.2, and beyond as there."""
    t = min(q, LIMIT) * SIXTEENTH
    e = E0 + t * (E1 + t * (E2 + t * (E3 + t * (E4 + t * E5))))
    e = e * e
    e = e * e
    return e * e


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def strip_rows(g, cut, dx, dy, strip, rows):
    """First and last + 1 of the `rows` that the ellipse q <= cut touches in a strip of a tile.

    `g` is a projected Gaussian; `dx`, `dy` are the way from its centre to the tile's first pixel.
    """
    ex, ey = g[p.EX], math.sqrt(cut / g[p.RYY])
    if cut < g[p.CUT]:
        ex *= math.sqrt(cut / g[p.CUT])
    left = max(dx + np.float32(strip * STRIP), -ex)
    right = min(dx + np.float32(strip * STRIP) + STRIP_END, ex)
    if left > right:
        return 0, 0
    # at dx its rows are lean dx +- reach sqrt(1 - (dx / ex)^2)
    turned = ey / ex
    lean = -g[p.TILT] * turned * turned
    reach = math.sqrt(max(ey * ey - lean * lean * ex * ex, ZERO))
    lowest = lean * ex / turned
    x = min(max(-lowest, left), right) / ex
    low = lean * ex * x - reach * math.sqrt(max(ONE - x * x, ZERO))
    x = min(max(lowest, left), right) / ex
    high = lean * ex * x + reach * math.sqrt(max(ONE - x * x, ZERO))
    start = int(max(low - dy, ZERO))
    return start, int(min(max(high - dy + ONE, ZERO), np.float32(rows)))


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def batch_rows(batch, x0, y0, rows, first, last):
    """`strip_rows` of 64 projected Gaussians, whose columns are the rows of `batch`.

    `x0`, `y0`: centre of the tile's first pixel. From the rows `first` and `last` of `batch` on:
    first and last + 1 of the rows of each strip; to be cut off to integers.
    """
    for strip in range(STRIPS):
        begin, end = first + np.uint64(strip) * BATCH, last + np.uint64(strip) * BATCH
        offset = x0 + np.float32(strip * STRIP)
        for j in range(BATCH):
            tilt = batch[TILT + j]
            ex = batch[EX + j]
            ey = batch[EY + j]
            dx = offset - batch[CX + j]
            dy = y0 - batch[CY + j]
            left, right = max(dx, -ex), min(dx + STRIP_END, ex)
            turned = ey / ex
            lean = -tilt * turned * turned * ex
            reach = math.sqrt(max(ey * ey - lean * lean, ZERO))
            lowest = lean / turned
            x = min(max(-lowest, left), right) / ex
            low = lean * x - reach * math.sqrt(max(ONE - x * x, ZERO))
            x = min(max(lowest, left), right) / ex
            high = lean * x + reach * math.sqrt(max(ONE - x * x, ZERO))
            start = max(low - dy, ZERO)
            stop = min(max(high - dy + ONE, ZERO), rows)
            batch[begin + j] = start
            batch[end + j] = stop if left <= right else ZERO
