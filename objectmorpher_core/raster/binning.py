"""Which Gaussians touch which tile of the picture.

By the ellipse outside which alpha is 0, which knows the opacity, and by the tile's pixel centres:
a tile that gets a Gaussian has pixels that it colours, or misses by less than one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np

from ..arrays import F32, frozen
from ..threads import FAST, core_count, in_threads
from .projection import CUT, CX, CY, EX, EY, QXX, TILT, WEIGHT

TILE = 16  # px
LEAST_SHARE = 4096  # Gaussians, for which a second thread counts


@dataclass(frozen=True, eq=False)
class Bins:
    """Members of each tile, in the order in which they were given."""

    starts: np.ndarray  # (tiles + 1,) i64, tiles row by row
    members: np.ndarray  # (starts[-1],) u32 rows of the projected Gaussians
    across: int  # tiles
    down: int


def bin_tiles(
    projected: F32, window: tuple[int, int, int, int], order: np.ndarray | None = None
) -> Bins:
    """Bins the Gaussians of `projected` (N, SPAN), or those of `order` (M,) u32 in that order.

    `window`: left, top, width, height px of the part of the view that is cut into tiles.
    """
    left, top, width, height = window
    across, down = -(-width // TILE), -(-height // TILE)
    if order is None:
        order = np.arange(len(projected), dtype=np.uint32)
    parts = min(core_count(), max(len(order) // LEAST_SHARE, 1))
    bounds = np.linspace(0, len(order), parts + 1).astype(np.int64)
    counts = np.zeros((parts, across * down), np.int64)
    nothing = np.empty(0, np.uint32)
    inputs = (frozen(projected), frozen(order), across, left, top, width, height)

    def pass_over(members: np.ndarray) -> None:
        def run(first: int, last: int) -> None:
            for part in range(first, last):
                a, b = int(bounds[part]), int(bounds[part + 1])
                _bin(a, b, *inputs, counts[part], members)

        in_threads(run, parts)

    pass_over(nothing)
    sizes = counts.sum(0)
    starts = np.concatenate([[0], np.cumsum(sizes)])
    # where each part puts its first member of each tile
    counts[:] = starts[:-1] + np.cumsum(np.vstack([np.zeros_like(sizes), counts[:-1]]), axis=0)
    members = np.empty(int(starts[-1]), np.uint32)
    if len(members):
        pass_over(members)
    return Bins(starts, members, across, down)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _bin(first, last, projected, order, across, left, top, width, height, at, members):
    """Counts the members of each tile in `at`, or, where there is room, puts them there."""
    is_counting = len(members) == 0
    for n in range(first, last):
        i = order[n]
        if not projected[i, WEIGHT] > 0.0:
            continue
        cx, cy = projected[i, CX] - left, projected[i, CY] - top
        ex, ey = projected[i, EX], projected[i, EY]
        # rows and columns of pixels whose centres are inside the box
        upper = max(math.ceil(cy - ey - 0.5), 0.0)
        lower = min(math.floor(cy + ey - 0.5), height - 1.0)
        if upper > lower or cx + ex < 0.5 or cx - ex > width - 0.5:
            continue
        reach = math.sqrt(projected[i, CUT] / projected[i, QXX])  # half the ellipse's row at cy
        tilt = projected[i, TILT]
        lean = tilt * ey * ey / ex  # dy at which the ellipse is widest, to the left
        for row in range(int(upper) // TILE, int(lower) // TILE + 1):
            low = max(row * TILE + 0.5 - cy, -ey)  # dy of the tile's rows
            high = min(row * TILE + (TILE - 0.5) - cy, ey)
            start = _edge(min(max(lean, low), high), tilt, ey, reach, -1.0)
            end = _edge(min(max(-lean, low), high), tilt, ey, reach, 1.0)
            start, end = math.ceil(cx + start - 0.51), math.floor(cx + end - 0.49)
            if end < 0 or start > width - 1 or start > end:
                continue
            for column in range(int(max(start, 0)) // TILE, int(min(end, width - 1)) // TILE + 1):
                tile = row * across + column
                if not is_counting:
                    members[at[tile]] = i
                at[tile] += 1
    return


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _edge(dy, tilt, ey, reach, side):
    """dx of the ellipse's left (side -1) or right (1) edge at dy."""
    y = dy / ey
    return side * reach * math.sqrt(max(1.0 - y * y, 0.0)) - tilt * dy
