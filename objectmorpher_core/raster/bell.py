"""A Gaussian on a tile: its values, and the pixels where it has any."""

from __future__ import annotations

import math

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import rules as p
from .rules import ONE, ZERO
from .tile_memory import STRIP

STRIP_END = np.float32(STRIP - 1)
# exp(-t), 0 <= t <= 0.7: interpolated at Chebyshev points, right to 1e-7
E0, E1, E2, E3, E4, E5 = (
    np.float32(v)
    for v in (0.99999994, -0.99999389, 0.49989734, -0.16603126, 0.03986404, -0.00589814)
)
SIXTEENTH = np.float32(1 / 16)
LIMIT = np.float32(0.7)
ALMOST = np.float32(0.999)  # of a row: to begin with the next one, however it is rounded


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def bell(q):
    """exp(-q / 2) for 0 <= q <= 11.2, and beyond as there."""
    t = min(q * SIXTEENTH, LIMIT)
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
    dx += np.float32(strip * STRIP)
    if max(dx, -ex) > min(dx + STRIP_END, ex):
        return 0, 0
    start, end = rows_of(g[p.TILT], ex, ey, dx, dy, np.float32(rows))
    return int(start), int(end)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def rows_of(tilt, ex, ey, dx, dy, rows):
    """Return the rows of any strip, to be cut off to integers; start >= end for none.

    `ex`, `ey`: half the size of the ellipse's box; `dx`, `dy`: way to the strip's first pixel.
    """
    left, right = max(dx, -ex), min(dx + STRIP_END, ex)
    # at dx its rows are lean dx / ex +- reach sqrt(1 - (dx / ex)^2)
    turned = ey / ex
    lean = -tilt * turned * ey
    reach = math.sqrt(max(ey * ey - lean * lean, ZERO))
    lowest = lean / turned
    x = min(max(-lowest, left), right) / ex
    low = lean * x - reach * math.sqrt(max(ONE - x * x, ZERO))
    x = min(max(lowest, left), right) / ex
    high = lean * x + reach * math.sqrt(max(ONE - x * x, ZERO))
    start = max(low - dy + ALMOST, ZERO)
    return start, min(max(high - dy + ONE, ZERO), rows) if left <= right else ZERO
