"""Plainly coloured Gaussians, one by one: step 3 of `reference`, compiled.

The tile's pixels lie as in `surface`. Members come in the order of their depth, 64 at a time: their
numbers are laid side by side first, and the rows that they touch computed for all of them.
"""

from __future__ import annotations

import numba
import numpy as np

from ..threads import FAST
from . import projection as p
from . import tile_memory as m
from .bell import BATCH, batch_rows, bell
from .binning import TILE
from .sampling import HALF, ONE, ZERO

CLEAR, R, G, B, ALPHA, SHOWN, MEAN, MEDIAN, STEP_X, STEP_Y = (
    np.uint64(row * m.PIXELS) for row in range(10)
)
ROWS = 10
INFINITE = np.float32(np.inf)
NOTHING = np.float32(1e-12)  # what shines through at least: ever smaller numbers are slow
PLAIN = 15  # columns of a projected Gaussian that are needed, the first
START, END = (np.uint64((PLAIN + row) * 64) for row in (0, m.STRIPS))  # of a strip's rows
BATCH_ROWS = PLAIN + 2 * m.STRIPS
CX, CY, QXX, TILT, RYY, Z, ZX, ZY, WEIGHT, RED, GREEN, BLUE = (
    np.uint64(column * 64)
    for column in (
        p.CX, p.CY, p.QXX, p.TILT, p.RYY, p.Z, p.ZX, p.ZY, p.WEIGHT, p.RED, p.GREEN, p.BLUE,
    )
)  # fmt: skip


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def draw_one_by_one(
    first, last, projected, starts, members, across, left, top, width, height, rules, kind, out,
    rgba,
):  # fmt: skip
    """Draws the tiles first..last of `out` or `rgba`; see `surface.draw_layers`."""
    s = np.zeros(ROWS * m.PIXELS, np.float32)
    batch = np.ones(BATCH_ROWS * int(BATCH), np.float32)
    m.number_pixels(s, STEP_X, STEP_Y)
    through = ONE - np.float32(rules.opaque)
    for tile in range(first, last):
        column, row = (tile % across) * TILE, (tile // across) * TILE
        rows, columns = min(TILE, height - row), min(TILE, width - column)
        if starts[tile] == starts[tile + 1]:
            m.clear_tile(out, rgba, column, row, columns, rows)
            continue
        x0, y0 = np.float32(left + column) + HALF, np.float32(top + row) + HALF
        for k in range(m.ALL):
            s[CLEAR + k] = ONE
            s[R + k] = s[G + k] = s[B + k] = s[MEAN + k] = s[MEDIAN + k] = ZERO
        for start in range(starts[tile], starts[tile + 1], int(BATCH)):
            count = min(starts[tile + 1] - start, int(BATCH))
            for j in range(np.uint64(count)):
                g = projected[members[np.uint64(start) + j]]
                for c in range(PLAIN):
                    batch[np.uint64(c) * BATCH + j] = g[c]
            batch_rows(batch, x0, y0, np.float32(rows), START, END)
            if not _draw(s, batch, count, x0, y0, through, len(rgba) == 0, kind):
                break
        if len(rgba) > 0:
            for k in range(m.ALL):
                s[ALPHA + k] = ONE - s[CLEAR + k]
            m.write_rgba(s, R, rgba, column, row, columns, rows)
            continue
        for y in range(rows):
            for x in range(columns):
                _put(out[row + y, column + x], s, m.pixel_index(x, y))


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _draw(s, batch, count, x0, y0, through, has_depth, kind):
    """A batch of Gaussians behind those that are there; whether one still sees through."""
    most, least = np.float32(kind.most), np.float32(kind.least)
    for j in range(np.uint64(count)):
        dx0, dy0 = x0 - batch[CX + j], y0 - batch[CY + j]
        qxx, tilt, ryy, weight = batch[QXX + j], batch[TILT + j], batch[RYY + j], batch[WEIGHT + j]
        red, green, blue = batch[RED + j], batch[GREEN + j], batch[BLUE + j]
        for strip in range(m.STRIPS):
            start = int(batch[START + np.uint64(strip) * BATCH + j])
            end = int(batch[END + np.uint64(strip) * BATCH + j])
            if start >= end:
                continue
            at = np.uint64(strip * m.STRIP * TILE + start * m.STRIP)
            lanes = np.uint64((end - start) * m.STRIP)
            for k in range(lanes):
                dx, dy = dx0 + s[STEP_X + at + k], dy0 + s[STEP_Y + at + k]
                e = dx + tilt * dy
                alpha = min(weight * bell(qxx * e * e + ryy * dy * dy), most)
                clear = s[CLEAR + at + k]
                shown = clear * alpha
                shown = shown if alpha >= least else ZERO
                s[SHOWN + at + k] = shown
                s[CLEAR + at + k] = max(clear - shown, NOTHING)
                s[R + at + k] += shown * red
                s[G + at + k] += shown * green
                s[B + at + k] += shown * blue
            if has_depth:
                z = batch[Z + j] + batch[ZX + j] * dx0 + batch[ZY + j] * dy0
                _measure(s, at, lanes, z, batch[ZX + j], batch[ZY + j])
    clear = ZERO  # a sum, of which vector code can be made, unlike of a maximum
    for k in range(m.ALL):
        clear += ONE if s[CLEAR + k] > through else ZERO
    return clear > ZERO


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _measure(s, at, count, z, zx, zy):
    """Adds the depth of what was just drawn: z at the tile's first pixel, and its slope."""
    for k in range(count):
        depth = z + zx * s[STEP_X + at + k] + zy * s[STEP_Y + at + k]
        shown, behind = s[SHOWN + at + k], s[CLEAR + at + k]
        is_half = (behind + shown > HALF) & (behind <= HALF)  # of one Gaussian only
        s[MEDIAN + at + k] += depth if is_half else ZERO
        s[MEAN + at + k] += shown * depth


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _put(o, s, k):
    """A pixel's results, see `reference.Picture3D`."""
    alpha, depth = ONE - s[CLEAR + k], s[MEDIAN + k]
    if depth == ZERO:
        depth = s[MEAN + k] / alpha if alpha > ZERO else INFINITE
    o[0], o[1], o[2], o[3] = s[R + k], s[G + k], s[B + k], alpha
    o[4], o[5], o[6], o[7] = depth, ZERO, ZERO, ZERO
