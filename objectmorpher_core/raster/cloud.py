"""Plainly coloured Gaussians, one by one: step 3 of `reference`, compiled.

A tile is one strip, 8 px wide and 64 tall: what a Gaussian touches of it are whole rows of eight
pixels that lie side by side in the memory, so that one loop without a branch draws it. Members come
in the order of their depth, 64 at a time: their numbers are laid side by side first, and what is
needed of all of them computed for all of them.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import rules as p
from .rules import HALF, INFINITE, ONE, ZERO
from .tile_memory import SIXTEENTH, STRIP, clear_tile, number_pixels, rows_of, write_rgba

WIDE, TALL = STRIP, 64  # px, of a tile
PIXELS = WIDE * TALL
ALL, ROW = np.uint64(PIXELS), np.uint64(WIDE)
CLEAR, R, G, B, ALPHA, SHOWN, MEAN, MEDIAN, STEP_X, STEP_Y = (
    np.uint64(row * PIXELS) for row in range(10)
)
ROWS = 10
# exp(-t), 0 <= t <= 0.7, so that its 8th power is right to 4e-5 everywhere (minimax): of a colour
# a hundredth of what 8 bits tell apart
E0, E1, E2, E3 = (np.float32(v) for v in (0.999994874, -0.999412537, 0.491425544, -0.132089347))
NOTHING = np.float32(1e-12)  # what shines through at least: ever smaller numbers are slow
BATCH = np.uint64(64)  # Gaussians that are prepared together, a row of it a number of each
CX, CY, QXX, TILT, RYY, CUT, EX, EY, Z, ZX, ZY, WEIGHT, RED, GREEN, BLUE = (
    np.uint64(column) * BATCH for column in (
        p.CX, p.CY, p.QXX, p.TILT, p.RYY, p.CUT, p.EX, p.EY, p.Z, p.ZX, p.ZY, p.WEIGHT,
        p.RED, p.GREEN, p.BLUE,
    )
)  # fmt: skip
# Of a batch, further: t = (UX x + UY y + U)^2 + (VY y + V)^2 is what the bell is a function of, at
# the pixel in column x and row y of the tile; LIMIT is t where alpha ends, BELL0 to BELL3 are the
# coefficients of the bell with the weight in them, DEPTH is the depth at the first pixel.
UX, UY, U, VY, V, LIMIT, BELL0, BELL1, BELL2, BELL3, DEPTH, START, END = (
    np.uint64(p.PLAIN_SPAN + row) * BATCH for row in range(13)
)
BATCH_ROWS = p.PLAIN_SPAN + 13


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def draw_one_by_one(first, last, tiles, rules, kind, out, rgba):
    """Draws the tiles first..last of `out` or `rgba`; see `surface.draw_layers`."""
    projected, starts, members = tiles.projected, tiles.starts, tiles.members
    s = np.zeros(ROWS * PIXELS, np.float32)
    batch = np.ones(BATCH_ROWS * int(BATCH), np.float32)
    packed = np.empty(PIXELS if len(rgba) > 0 else 0, np.uint32)
    number_pixels(s, STEP_X, STEP_Y, PIXELS, TALL)
    through = ONE - np.float32(rules.opaque)
    for tile in range(first, last):
        column, row = (tile % tiles.across) * WIDE, (tile // tiles.across) * TALL
        rows, columns = min(TALL, tiles.height - row), min(WIDE, tiles.width - column)
        if starts[tile] == starts[tile + 1]:
            clear_tile(out, rgba, column, row, columns, rows)
            continue
        x0, y0 = np.float32(tiles.left + column) + HALF, np.float32(tiles.top + row) + HALF
        for k in range(ALL):
            s[CLEAR + k] = ONE
            s[R + k] = s[G + k] = s[B + k] = s[MEAN + k] = s[MEDIAN + k] = ZERO
        for start in range(starts[tile], starts[tile + 1], int(BATCH)):
            count = min(starts[tile + 1] - start, int(BATCH))
            for j in range(np.uint64(count)):
                g = projected[members[np.uint64(start) + j]]
                for c in range(p.Z):
                    batch[np.uint64(c) * BATCH + j] = g[c]
                if len(rgba) == 0:
                    for c in range(p.Z, p.SX):
                        batch[np.uint64(c) * BATCH + j] = g[c]
            _prepare(batch, x0, y0, np.float32(rows))
            _draw(s, batch, count, len(rgba) == 0, kind)
            clear = ZERO  # a sum, of which vector code can be made, unlike of a maximum
            for k in range(ALL):
                clear += ONE if s[CLEAR + k] > through else ZERO
            if clear == ZERO:
                break
        if len(rgba) > 0:
            for k in range(ALL):
                s[ALPHA + k] = ONE - s[CLEAR + k]
            write_rgba(s, R, packed, rgba, column, row, columns, rows, TALL)
            continue
        for y in range(rows):
            for x in range(columns):
                _put(out[row + y, column + x], s, np.uint64(y * WIDE + x))


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _prepare(batch, x0, y0, rows):
    """Everything about the batch's Gaussians on the tile whose first pixel's centre is x0, y0."""
    for j in range(BATCH):
        cx, cy, tilt, cut = batch[CX + j], batch[CY + j], batch[TILT + j], batch[CUT + j]
        dx, dy = x0 - cx, y0 - cy
        start, end = rows_of(tilt, batch[EX + j], batch[EY + j], dx, dy, rows)
        batch[START + j], batch[END + j] = start, end
        across, down = math.sqrt(SIXTEENTH * batch[QXX + j]), math.sqrt(SIXTEENTH * batch[RYY + j])
        batch[UX + j] = across
        batch[UY + j] = across * tilt
        batch[U + j] = across * (dx + tilt * dy)
        batch[VY + j] = down
        batch[V + j] = down * dy
        batch[LIMIT + j] = SIXTEENTH * cut
        root = math.sqrt(math.sqrt(math.sqrt(batch[WEIGHT + j])))
        batch[BELL0 + j], batch[BELL1 + j] = root * E0, root * E1
        batch[BELL2 + j], batch[BELL3 + j] = root * E2, root * E3
        batch[DEPTH + j] = batch[Z + j] + batch[ZX + j] * dx + batch[ZY + j] * dy


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _draw(s, batch, count, has_depth, kind):
    """A batch of Gaussians behind those that are there."""
    most = np.float32(kind.most)
    for j in range(np.uint64(count)):
        begin = np.uint64(int(batch[START + j])) * ROW
        lanes = np.uint64(max(int(batch[END + j]) - int(batch[START + j]), 0)) * ROW
        ux, uy, u = batch[UX + j], batch[UY + j], batch[U + j]
        vy, v, limit = batch[VY + j], batch[V + j], batch[LIMIT + j]
        color = batch[RED + j], batch[GREEN + j], batch[BLUE + j]
        bells = batch[BELL0 + j], batch[BELL1 + j], batch[BELL2 + j], batch[BELL3 + j]
        if has_depth:
            for i in range(lanes):
                k = begin + i
                s[SHOWN + k] = _add(s, k, ux, uy, u, vy, v, limit, bells, most, color)
            _measure(s, begin, lanes, batch[DEPTH + j], batch[ZX + j], batch[ZY + j])
        else:
            for i in range(lanes):
                _add(s, begin + i, ux, uy, u, vy, v, limit, bells, most, color)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _add(s, k, ux, uy, u, vy, v, limit, bells, most, color):
    """A Gaussian behind what is there of pixel k; the share of the pixel that it gets."""
    a = u + ux * s[STEP_X + k] + uy * s[STEP_Y + k]
    b = v + vy * s[STEP_Y + k]
    t = a * a + b * b
    clear = s[CLEAR + k]
    shown = clear * min(_bell(t, bells), most)
    shown = shown if t <= limit else ZERO
    s[CLEAR + k] = max(clear - shown, NOTHING)
    s[R + k] += shown * color[0]
    s[G + k] += shown * color[1]
    s[B + k] += shown * color[2]
    return shown


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _bell(t, coefficients):
    """exp(-8 t) for 0 <= t <= 0.7, times the 8th power of what E0 to E3 are multiplied by."""
    e0, e1, e2, e3 = coefficients
    e = e0 + t * (e1 + t * (e2 + t * e3))
    e = e * e
    e = e * e
    return e * e


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _measure(s, begin, count, z, zx, zy):
    """Adds the depth of what was just drawn: z at the tile's first pixel, and its slope."""
    for i in range(count):
        k = begin + i
        depth = z + zx * s[STEP_X + k] + zy * s[STEP_Y + k]
        shown, behind = s[SHOWN + k], s[CLEAR + k]
        is_half = (behind + shown > HALF) & (behind <= HALF)  # of one Gaussian only
        s[MEDIAN + k] += depth if is_half else ZERO
        s[MEAN + k] += shown * depth


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _put(o, s, k):
    """A pixel's results, see `reference.Picture3D`."""
    alpha, depth = ONE - s[CLEAR + k], s[MEDIAN + k]
    if depth == ZERO:
        depth = s[MEAN + k] / alpha if alpha > ZERO else INFINITE
    o[0], o[1], o[2], o[3] = s[R + k], s[G + k], s[B + k], alpha
    o[4], o[5], o[6], o[7] = depth, ZERO, ZERO, ZERO
