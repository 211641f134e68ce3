"""Which Gaussians touch which tile of the picture, and their order from near to far.

By the ellipse outside which alpha is 0, which knows the opacity, and by the tile's pixel centres:
a tile that gets a Gaussian has pixels that it colours, or misses by less than one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import F32, frozen
from ..base.kernel_files import numba
from ..base.threads import FAST, core_count, in_threads
from .rules import CUT, CX, CY, EX, EY, HALF, ONE, QXX, TILT, WEIGHT, ZERO

TILE = 16  # px, of a surface's tiles
SMALL = np.float32(1 / 4)  # of a tile, extents of a Gaussian that touches about four
LEAST_SHARE = 4096  # Gaussians, for which a second thread counts


@dataclass(frozen=True, eq=False)
class Bins:
    """Members of each tile, in the order in which they were given."""

    starts: np.ndarray  # (tiles + 1,) i64, tiles row by row
    members: np.ndarray  # (starts[-1],) u32 rows of the projected Gaussians
    across: int  # tiles
    down: int


class TiledSplats(NamedTuple):
    """Projected Gaussians and a part of the view that is cut into tiles, as kernels take them."""

    projected: F32  # (N, SPAN), see `projection`
    starts: np.ndarray  # as in `Bins`
    members: np.ndarray
    across: int
    left: int  # px of the view, where the part begins
    top: int
    width: int  # px of the part
    height: int


def bin_tiles(
    projected: F32, window: tuple[int, int, int, int], tile: tuple[int, int],
    order: np.ndarray | None = None,
) -> Bins:  # fmt: skip
    """Bins the Gaussians of `projected` (N, SPAN), or those of `order` (M,) u32 in that order.

    `window`: left, top, width, height px of the part of the view that is cut into tiles; `tile`:
    width and height px of each.
    """
    left, top, width, height = window
    wide, tall = tile
    across, down = -(-width // wide), -(-height // tall)
    boxes = np.empty(len(projected), np.uint64)  # one number each: quickly put in another order
    parts = min(core_count(), max(len(projected) // LEAST_SHARE, 1))
    counts = np.zeros((parts, across * down), np.int64)
    rows, corners = frozen(projected), boxes.view(np.int16).reshape(-1, 4)

    def count(first: int, last: int) -> None:
        for part in range(first, last):
            begin, end = (len(projected) * (part + k) // parts for k in (0, 1))
            _count(begin, end, rows, corners, across, *window, wide, tall, counts[part])

    in_threads(count, parts)
    starts = np.concatenate([[0], np.cumsum(counts.sum(0))])
    members = np.empty(int(starts[-1]), np.uint32)
    at = starts[:-1].copy()
    if order is None:
        order = np.arange(len(projected), dtype=np.uint32)
    else:
        corners = boxes[order].view(np.int16).reshape(-1, 4)
    inputs = (rows, frozen(order), frozen(corners), across, left, top, wide, tall, at, members)
    # Each thread fills some rows of tiles: their members come in order by themselves.
    in_threads(lambda first, last: _fill(first, last, *inputs), down, least=-(-down // parts))
    return Bins(starts, members, across, down)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _count(
    first, last, projected, boxes, across, left, top, width, height, wide, tall, counts
):  # fmt: skip
    """Tiles of the box around the Gaussians first..last, and how many each tile has of them.

    `boxes` (N, 4) i16: x0, y0, x1, y1. Where the ellipse leaves out some of them, x0 is -1 - x0.
    """
    scale_x, scale_y = np.float32(1 / wide), np.float32(1 / tall)
    small = SMALL * np.float32(wide * tall)
    right, bottom = np.float32(width) - HALF, np.float32(height) - HALF
    left, top = np.float32(left), np.float32(top)
    for n in range(np.uint64(first), np.uint64(last)):
        g, box = projected[n], boxes[n]
        cx, cy, ex, ey = g[CX] - left, g[CY] - top, g[EX], g[EY]
        # the first and last pixel whose centre is inside
        x0, x1 = max(cx - ex, HALF), min(cx + ex, right)
        y0, y1 = max(cy - ey, HALF), min(cy + ey, bottom)
        if not (g[WEIGHT] > ZERO and x0 <= x1 and y0 <= y1):
            box[0] = box[1] = 0
            box[2] = box[3] = -1
            continue
        first_column, first_row = np.int32((x0 + HALF) * scale_x), np.int32((y0 + HALF) * scale_y)
        last_column, last_row = np.int32((x1 - HALF) * scale_x), np.int32((y1 - HALF) * scale_y)
        # Where there is little to gain the box will do; decided alike for all parts of a view.
        is_large = ex * ey > small
        box[0] = ~first_column if is_large else first_column
        box[1], box[2], box[3] = first_row, last_column, last_row
        for row in range(first_row, last_row + 1):
            start, end = first_column, last_column
            if is_large:
                start, end = _columns(g, start, end, row, cx, cy, wide, tall)
            for column in range(start, end + 1):
                counts[np.uint64(row * across + column)] += 1


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _fill(first, last, projected, order, boxes, across, left, top, wide, tall, at, members):
    """Puts the Gaussians `order`, whose boxes come in that order, where `at` says that the next
    members belong, of the tiles' rows first..last."""
    for n in range(np.uint64(len(order))):
        i, box = order[n], boxes[n]
        for row in range(max(box[1], first), min(box[3], last - 1) + 1):
            start, end = np.int32(box[0]), np.int32(box[2])
            if start < 0:
                g = projected[i]
                cx, cy = g[CX] - np.float32(left), g[CY] - np.float32(top)
                start, end = _columns(g, ~start, end, row, cx, cy, wide, tall)
            for column in range(start, end + 1):
                tile = np.uint64(row * across + column)
                members[np.uint64(at[tile])] = i
                at[tile] += 1


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _columns(g, first, last, row, cx, cy, wide, tall):
    """Those of the tiles first..last of a row that the ellipse touches."""
    ex, ey, tilt = g[EX], g[EY], g[TILT]
    low = max(np.float32(row * tall) + HALF - cy, -ey)  # dy of the tile's rows
    high = min(np.float32(row * tall) + np.float32(tall - 0.5) - cy, ey)
    lean = tilt * ey * ey / ex  # dy at which the ellipse is widest, to the left
    reach = math.sqrt(g[CUT] / g[QXX])  # half its row at dy = 0
    start = cx + _edge(min(max(lean, low), high), tilt, ey, reach, np.float32(-1))
    end = cx + _edge(min(max(-lean, low), high), tilt, ey, reach, ONE)
    scale, slack = np.float32(1 / wide), np.float32(0.51)
    first = max(np.int32(max(start - slack, ZERO) * scale), first)
    return first, min(np.int32(max(end + slack, ZERO) * scale), last)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _edge(dy, tilt, ey, reach, side):
    """dx of the ellipse's left (side -1) or right (1) edge at dy."""
    y = dy / ey
    return side * reach * math.sqrt(max(ONE - y * y, ZERO)) - tilt * dy


# The order of Gaussians from near to far: a radix sort on float32 depths, compiled.

BITS = 8  # of a digit: more of them would write to more places than a processor keeps in reach
PASSES = 4


def depth_order(depths: np.ndarray) -> np.ndarray:
    """Rows (M,) u32 of `depths` (N,) that are > 0, ascending; equal float32 depths stay in order.

    The bits of positive float32 numbers ascend as they do. A fraction of the time of
    `np.argsort(depths, kind="stable")`.
    """
    keys = frozen(np.maximum(depths, 0), np.float32).view(np.uint32)
    pairs, spare = np.empty(len(keys), np.uint64), np.empty(len(keys), np.uint64)
    order = np.empty(len(keys), np.uint32)
    return order[: _sort(keys, pairs, spare, order)]


@numba.njit(cache=True, nogil=True, fastmath=FAST)
def _sort(keys, pairs, spare, order):
    """Rows of `keys` (N,) u32 other than 0 into `order`, ascending; how many they are.

    A pair: key and row in one number. Only the digits in which the keys differ are sorted by.
    """
    size = 1 << BITS
    last = np.uint64(size - 1)
    low, high = np.uint32(0xFFFFFFFF), np.uint32(0)
    for i in range(len(keys)):
        if keys[i] > 0:
            low, high = min(low, keys[i]), max(high, keys[i])
    passes = 1
    while passes < PASSES and (np.uint64(high) - np.uint64(low)) >> np.uint64(passes * BITS) > 0:
        passes += 1
    counts = np.zeros((PASSES, size), np.uint32)  # unsigned: no index is looked at for its sign
    there = np.uint64(0)
    for i in range(len(keys)):
        if keys[i] == 0:
            continue
        key = np.uint64(keys[i] - low)
        pairs[there] = (key << np.uint64(32)) | np.uint64(i)
        there += np.uint64(1)
        for p in range(passes):
            counts[p, (key >> np.uint64(p * BITS)) & last] += np.uint32(1)
    for p in range(passes):
        start = np.uint32(0)
        for d in range(size):
            own = counts[p, d]
            counts[p, d] = start
            start += own
    source, target = pairs[:there], spare[:there]
    for p in range(passes - 1):
        _scatter(source, target, counts[p], np.uint64(32 + p * BITS))
        source, target = target, source
    starts, shift = counts[passes - 1], np.uint64(32 + (passes - 1) * BITS)
    for i in range(len(source)):
        pair = source[i]
        d = (pair >> shift) & last
        order[starts[d]] = np.uint32(pair & np.uint64(0xFFFFFFFF))
        starts[d] += np.uint32(1)
    return len(source)


@numba.njit(nogil=True, fastmath=FAST)
def _scatter(source, target, starts, shift):
    """Puts the pairs in the order of the digit at `shift`, those of one digit as they come."""
    last = np.uint64((1 << BITS) - 1)
    for i in range(len(source)):
        pair = source[i]
        d = (pair >> shift) & last
        target[starts[d]] = pair
        starts[d] += np.uint32(1)
