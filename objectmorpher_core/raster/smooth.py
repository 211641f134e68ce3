"""Tiles inside a surface: sums at every second pixel, and the photo at every one.

Where a tile shows one layer of wide Gaussians, all of them photo, that is whole everywhere, the
place in the photo changes slowly: it is summed up on a grid of 9 x 9 nodes, two pixels apart, and
interpolated. Between nodes it is off by less than a hundredth of a pixel.
"""

from __future__ import annotations

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import rules as p
from . import tile_memory as m
from .bell import bell
from .binning import TILE
from .compositing import look_up
from .intrinsics import fetch
from .rules import HALF, ONE, ZERO

STEP = 2  # px between nodes
SIDE = TILE // STEP + 1  # nodes
NODES = np.uint64(-(-SIDE * SIDE // 8) * 8)  # and a few more that nobody reads
TOTAL, DEPTH, X, Y, NODE_X, NODE_Y, UPPER, LOWER = (np.uint64(row) * NODES for row in range(8))
NODE_ROWS = 8
NARROWEST = np.float32(2.5)  # px, standard deviation: finer sums need every pixel
LEAST_TOTAL = np.float32(1.0)  # kernel sum that is nowhere near a surface's edge
STEEPEST = np.float32(0.5)  # of the kernel sum, per px: so is what is no steeper
LINE, LINES = np.uint64(16), np.uint64(6)  # numbers in a line of memory; lines across a tile
LAST_ROW = np.float32(SIDE - 1)
ALMOST = np.float32(0.999)  # of a row: to begin with the next one, however it is rounded
QUARTER, THREE_QUARTERS = np.float32(0.25), np.float32(0.75)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def new_nodes():
    """The grid's memory: the rows above."""
    s = np.zeros(NODE_ROWS * int(NODES), np.float32)
    for k in range(NODES):
        s[NODE_X + k] = np.float32(int(k) % SIDE * STEP)
        s[NODE_Y + k] = np.float32(int(k) // SIDE * STEP)
    return s


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def is_plain(g, rules):
    """Whether a projected Gaussian is wide, shows the photo only, and carries it as it was."""
    narrow = g[p.QXX] * (ONE + g[p.TILT] * g[p.TILT]) + g[p.RYY]  # >= 1 / its least variance
    is_photo = (g[p.PHOTO] >= ONE) & (g[p.MATTED] >= ONE) & (g[p.SEEN] >= ONE)
    is_sharp = g[p.MAGNIFIED] <= np.float32(rules.sharp)
    return is_photo & is_sharp & (narrow * NARROWEST * NARROWEST <= ONE)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def draw_smooth(
    s, nodes, projected, members, left, top, columns, rows, view, photo, texels, shapes,
    crop_left, crop_top, kind,
):  # fmt: skip
    """Draws the tile, unless its surface turns out not to be whole: whether it did."""
    _fetch(projected[members[0]], left, top, view, photo, texels, shapes, crop_left, crop_top)
    for k in range(TOTAL, NODE_X):
        nodes[k] = ZERO
    for i in members:
        _add(nodes, projected[i], np.float32(left), np.float32(top), np.float32(kind.tail))
    if not _is_whole(nodes):
        return False
    for k in range(NODES):
        inverse = ONE / max(nodes[TOTAL + k], HALF)
        nodes[DEPTH + k] *= inverse
        nodes[X + k] *= inverse
        nodes[Y + k] *= inverse
    _spread(nodes, X, s, m.SHX)
    _spread(nodes, Y, s, m.SHY)
    _spread(nodes, DEPTH, s, m.O_DEPTH)
    for k in range(m.ALL):
        s[m.IS_PHOTO + k] = s[m.MAG + k] = ONE
    look_up(s, left, top, columns, 0, rows, view, photo, texels, shapes, crop_left, crop_top)
    for k in range(m.ALL):
        alpha = s[m.T_A + k]
        s[m.O_R + k], s[m.O_G + k] = alpha * s[m.T_R + k], alpha * s[m.T_G + k]
        s[m.O_B + k], s[m.O_A + k] = alpha * s[m.T_B + k], alpha
        s[m.O_PHOTO + k] = alpha * s[m.WITHIN + k]
        s[m.O_X + k], s[m.O_Y + k] = s[m.SHX + k], s[m.SHY + k]
    return True


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _fetch(g, left, top, view, photo, texels, shapes, crop_left, crop_top):
    """Asks for the texels that will be looked up, where a Gaussian says that the tile looks.

    The sums are computed while they come: without it a third of a frame is spent waiting.
    """
    half = HALF * np.float32(TILE)
    dx, dy = np.float32(left) + half - g[p.CX], np.float32(top) + half - g[p.CY]
    ratio = photo[0] / view[0]
    x = (left + TILE / 2 - view[1]) * ratio + photo[1] - crop_left
    y = (top + TILE / 2 - view[2]) * ratio + photo[2] - crop_top
    x += g[p.SX] + g[p.AXX] * dx + g[p.AXY] * dy
    y += g[p.SY] + g[p.AYX] * dx + g[p.AYY] * dy
    height, width = shapes[0, 0], shapes[0, 1]
    column = min(max(int(x) - TILE // 2 - 2, 0), width - 1)
    for row in range(max(int(y) - TILE // 2 - 2, 0), min(int(y) + TILE // 2 + 2, height)):
        first = np.uint64(4 * (row * width + column))
        for line in range(LINES):
            fetch(texels, first + line * LINE)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _add(nodes, g, left, top, tail):
    """A Gaussian's share of the sums; the first node is half a pixel beside the first pixel."""
    dx0, dy0 = left - g[p.CX], top - g[p.CY]
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy, weight = g[p.QXX], g[p.TILT], g[p.RYY], g[p.WEIGHT]
    # the rows that its box touches, and a few nodes more: nothing is left of it there
    first = np.int64(min(max(HALF * (-g[p.EY] - dy0) + ALMOST, ZERO), LAST_ROW))
    last = np.int64(min(max(HALF * (g[p.EY] - dy0), ZERO), LAST_ROW))
    start, eights = np.uint64(first * SIDE), np.uint64(((last - first + 1) * SIDE + 7) // 8)
    for n in range(eights * np.uint64(8)):
        k = start + n
        dx, dy = dx0 + nodes[NODE_X + k], dy0 + nodes[NODE_Y + k]
        e = dx + tilt * dy
        alpha = weight * max(bell(qxx * e * e + ryy * dy * dy) - tail, ZERO)
        nodes[TOTAL + k] += alpha
        nodes[DEPTH + k] += alpha * (z + zx * dx + zy * dy)
        nodes[X + k] += alpha * (sx + axx * dx + axy * dy)
        nodes[Y + k] += alpha * (sy + ayx * dx + ayy * dy)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _is_whole(nodes):
    """Whether coverage is 1 at all nodes, and so between them."""
    bad = ZERO
    last = np.uint64(SIDE * SIDE - SIDE - 1)  # one row and one column less than all
    for k in range(last):
        here = nodes[TOTAL + k]
        across = nodes[TOTAL + k + np.uint64(1)] - here
        down = nodes[TOTAL + k + np.uint64(SIDE)] - here
        steep = across * across + down * down
        is_bad = (here < LEAST_TOTAL) | (steep > np.float32(STEP * STEP) * STEEPEST * STEEPEST)
        bad += ONE if is_bad else ZERO
    for k in range(last, np.uint64(SIDE * SIDE)):
        bad += ONE if nodes[TOTAL + k] < LEAST_TOTAL else ZERO
    return bad == ZERO


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _spread(nodes, source, s, target):
    """A row of the grid's memory, interpolated to a row of the tile's."""
    for y in range(np.uint64(SIDE - 1)):
        at = source + y * np.uint64(SIDE)
        for i in range(np.uint64(SIDE)):
            a, b = nodes[at + i], nodes[at + np.uint64(SIDE) + i]
            nodes[UPPER + i] = THREE_QUARTERS * a + QUARTER * b
            nodes[LOWER + i] = QUARTER * a + THREE_QUARTERS * b
        for column in range(SIDE - 1):
            i, k = np.uint64(column), target + m.pixel_index(2 * column, 2 * int(y))
            below = k + np.uint64(m.STRIP)
            a, b = nodes[UPPER + i], nodes[UPPER + i + np.uint64(1)]
            s[k] = THREE_QUARTERS * a + QUARTER * b
            s[k + np.uint64(1)] = QUARTER * a + THREE_QUARTERS * b
            a, b = nodes[LOWER + i], nodes[LOWER + i + np.uint64(1)]
            s[below] = THREE_QUARTERS * a + QUARTER * b
            s[below + np.uint64(1)] = QUARTER * a + THREE_QUARTERS * b
