"""Plainly coloured Gaussians, one by one: step 3 of `reference`, compiled.

The tile's pixels lie as in `surface`. Members come in the order of their depth, and what lies
behind a tile that is opaque everywhere is not looked at.
"""

from __future__ import annotations

import numba
import numpy as np

from ..threads import FAST
from . import projection as p
from . import tile_memory as m
from .bell import bell, strip_rows
from .binning import TILE
from .sampling import HALF, ONE, ZERO

CLEAR, R, G, B, MEAN, MEDIAN, STEP_X, STEP_Y = (np.uint64(row * m.PIXELS) for row in range(8))
ROWS = 8
INFINITE = np.float32(np.inf)
OFTEN = 4  # Gaussians after which one looks whether the tile is opaque


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def draw_one_by_one(
    first, last, projected, starts, members, across, left, top, width, height, rules, kind, out
):
    """Draws the tiles first..last of `out` (height, width, 8); see `surface.draw_layers`."""
    s = np.zeros(ROWS * m.PIXELS, np.float32)
    for k in range(m.ALL):
        i = int(k)
        s[STEP_X + k] = np.float32(i // (m.STRIP * TILE) * m.STRIP + i % m.STRIP)
        s[STEP_Y + k] = np.float32(i // m.STRIP % TILE)
    through = ONE - np.float32(rules.opaque)
    for tile in range(first, last):
        column, row = (tile % across) * TILE, (tile // across) * TILE
        rows, columns = min(TILE, height - row), min(TILE, width - column)
        x0, y0 = np.float32(left + column), np.float32(top + row)
        for k in range(m.ALL):
            s[CLEAR + k], s[MEDIAN + k] = ONE, INFINITE
            s[R + k] = s[G + k] = s[B + k] = s[MEAN + k] = ZERO
        since = 0
        for slot in range(starts[tile], starts[tile + 1]):
            _draw(s, projected[members[slot]], x0, y0, rows, kind)
            since += 1
            if since == OFTEN:
                since = 0
                clearest = ZERO
                for k in range(m.ALL):
                    clearest = max(clearest, s[CLEAR + k])
                if clearest < through:
                    break
        for y in range(rows):
            for x in range(columns):
                k = m.pixel_index(x, y)
                o = out[row + y, column + x]
                alpha = ONE - s[CLEAR + k]
                o[0], o[1], o[2], o[3] = s[R + k], s[G + k], s[B + k], alpha
                depth = s[MEDIAN + k]
                if depth == INFINITE and alpha > ZERO:
                    depth = s[MEAN + k] / alpha
                o[4], o[5], o[6], o[7] = depth, ZERO, ZERO, ZERO


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _draw(s, g, x0, y0, rows, kind):
    """One Gaussian behind those that are there."""
    dx0, dy0 = x0 + HALF - g[p.CX], y0 + HALF - g[p.CY]  # of the tile's first pixel
    z, zx, zy = g[p.Z], g[p.ZX], g[p.ZY]
    qxx, tilt, ryy, weight = g[p.QXX], g[p.TILT], g[p.RYY], g[p.WEIGHT]
    red, green, blue = g[p.RED], g[p.GREEN], g[p.BLUE]
    tail, most, least = np.float32(kind.tail), np.float32(kind.most), np.float32(kind.least)
    for strip in range(m.STRIPS):
        start, end = strip_rows(g, g[p.CUT], dx0, dy0, strip, rows)
        if start >= end:
            continue
        at = np.uint64(strip * m.STRIP * TILE + start * m.STRIP)
        for k in range(np.uint64((end - start) * m.STRIP)):
            dx, dy = dx0 + s[STEP_X + at + k], dy0 + s[STEP_Y + at + k]
            e = dx + tilt * dy
            alpha = min(weight * (bell(qxx * e * e + ryy * dy * dy) - tail), most)
            is_there = (alpha >= least) & (alpha > ZERO)
            alpha = alpha if is_there else ZERO
            clear = s[CLEAR + at + k]
            shown = clear * alpha
            behind = clear - shown
            depth = z + zx * dx + zy * dy
            median = s[MEDIAN + at + k]
            is_half = (clear > HALF) & (behind <= HALF)
            s[MEDIAN + at + k] = depth if is_half else median
            s[CLEAR + at + k] = behind
            s[MEAN + at + k] += shown * depth
            s[R + at + k] += shown * red
            s[G + at + k] += shown * green
            s[B + at + k] += shown * blue
