"""Fields looked up between their pixels."""

from __future__ import annotations

import numpy as np

from ...base.arrays import F64, frozen
from ...base.kernel_files import numba
from ...base.threads import LEAST_ROWS, in_threads


def bilinear(field: np.ndarray, xy: F64) -> F64:
    """`field` (h, w, ...) at positions (N, 2) in its pixel indices, clamped to it."""
    height, width = field.shape[:2]
    # Large pictures are float32 already; all else is small, and compiled for once.
    dtype = np.float32 if field.dtype == np.float32 else np.float64
    channels = frozen(field.reshape(height, width, -1), dtype)
    positions = frozen(xy, np.float64)
    values = np.empty((len(positions), channels.shape[2]))

    def run(first: int, last: int) -> None:
        _look_up(channels, positions[first:last], values[first:last])

    in_threads(run, len(positions), least=LEAST_ROWS)
    return values.reshape(-1, *field.shape[2:])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _look_up(field, xy, values):
    """`values` (N, c) of a field (h, w, c) at xy (N, 2)."""
    height, width, count = field.shape
    for n in range(len(xy)):
        x = min(xy[n, 0], width - 1.001) if xy[n, 0] > 0 else 0.0  # also where it is not a number
        y = min(xy[n, 1], height - 1.001) if xy[n, 1] > 0 else 0.0
        j, i = int(x), int(y)
        s, t = x - j, y - i
        j1, i1 = min(j + 1, width - 1), min(i + 1, height - 1)
        for c in range(count):
            upper = field[i, j, c] * (1 - s) + field[i, j1, c] * s
            lower = field[i1, j, c] * (1 - s) + field[i1, j1, c] * s
            values[n, c] = upper * (1 - t) + lower * t
