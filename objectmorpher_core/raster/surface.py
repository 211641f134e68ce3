"""Layers of photo-textured Gaussians, tile by tile: step 4 of `reference`, compiled.

A tile of 16 x 16 px has its sums in one array, a row a quantity and a column a pixel, so that the
inner loops run over many pixels without a branch and become vector instructions. The pixels come
in two strips of eight columns: the rows that an ellipse touches of a strip lie side by side. All
numbers are 32 bits wide. Where all that touches a tile lies so close together that it is
one layer everywhere, nobody looks for the layer's front: that is so on most of a surface.
"""

from __future__ import annotations

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import rules as p
from . import tile_memory as m
from .binning import TILE
from .compositing import composite_layer, look_up
from .intrinsics import fetch
from .layer_sums import (
    FAR,
    add,
    add_all,
    add_aside,
    add_body,
    add_more,
    first_front,
    multiply,
    next_front,
    take,
)
from .rules import HALF, INFINITE, LAYERS, ONE, ZERO, limits_of
from .tile_memory import bell, strip_rows

# Tiles inside a surface: sums at every second pixel, and the photo at every one.
#
# Where a tile shows one layer of wide Gaussians, all of them photo, that is whole everywhere, the
# place in the photo changes slowly: it is summed up on a grid of 9 x 9 nodes, two pixels apart,
# and interpolated. Between nodes it is off by less than a hundredth of a pixel.

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
    s, nodes, projected, members, left, top, columns, rows, lookup, kind
):  # fmt: skip
    """Draws the tile, unless its surface turns out not to be whole: whether it did."""
    _fetch(projected[members[0]], left, top, lookup)
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
    look_up(s, left, top, columns, 0, rows, lookup)
    for k in range(m.ALL):
        alpha = s[m.T_A + k]
        s[m.O_R + k], s[m.O_G + k] = alpha * s[m.T_R + k], alpha * s[m.T_G + k]
        s[m.O_B + k], s[m.O_A + k] = alpha * s[m.T_B + k], alpha
        s[m.O_PHOTO + k] = alpha * s[m.WITHIN + k]
        s[m.O_X + k], s[m.O_Y + k] = s[m.SHX + k], s[m.SHY + k]
    return True


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _fetch(g, left, top, lookup):
    """Asks for the texels that will be looked up, where a Gaussian says that the tile looks.

    The sums are computed while they come: without it a third of a frame is spent waiting.
    """
    half = HALF * np.float32(TILE)
    dx, dy = np.float32(left) + half - g[p.CX], np.float32(top) + half - g[p.CY]
    screen, photo = lookup.screen, lookup.photo
    ratio = photo[0] / screen[0]
    x = (left + TILE / 2 - screen[1]) * ratio + photo[1] - lookup.left
    y = (top + TILE / 2 - screen[2]) * ratio + photo[2] - lookup.top
    x += g[p.SX] + g[p.AXX] * dx + g[p.AXY] * dy
    y += g[p.SY] + g[p.AYX] * dx + g[p.AYY] * dy
    height, width = lookup.shapes[0, 0], lookup.shapes[0, 1]
    column = min(max(int(x) - TILE // 2 - 2, 0), width - 1)
    for row in range(max(int(y) - TILE // 2 - 2, 0), min(int(y) + TILE // 2 + 2, height)):
        first = np.uint64(4 * (row * width + column))
        for line in range(LINES):
            fetch(lookup.texels, first + line * LINE)


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


MIDDLE = np.float32(TILE / 2)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def draw_layers(first, last, tiles, lookup, gap, texture_gap, rules, kind, out, rgba):
    """Draws the tiles first..last of `out` (height, width, 8) f32 or of `rgba` (..) u32.

    The one that is not wanted is empty. A number of `rgba` is four bytes, the first the lowest.
    """
    projected, starts, across = tiles.projected, tiles.starts, tiles.across
    s = np.zeros(m.ROWS * m.PIXELS, np.float32)
    m.number_pixels(s, m.STEP_X, m.STEP_Y, m.PIXELS)
    packed = np.empty(m.PIXELS if len(rgba) > 0 else 0, np.uint32)
    nodes = new_nodes()
    room = np.empty(_fullest(starts[first : last + 1]), np.uint32)
    limits = limits_of(rules, kind, gap, texture_gap)
    for tile in range(first, last):
        begin, end = starts[tile], starts[tile + 1]
        column, row = (tile % across) * TILE, (tile // across) * TILE
        rows, columns = min(TILE, tiles.height - row), min(TILE, tiles.width - column)
        if begin == end:
            m.clear_tile(out, rgba, column, row, columns, rows)
            continue
        own, left, top = tiles.members[begin:end], tiles.left + column, tiles.top + row
        x0, y0 = np.float32(left), np.float32(top)
        # Of other assets even what is no front counts, where there is a front.
        is_one = kind.is_surface and _is_one_layer(projected, own, x0, y0, limits)
        is_done = False
        if is_one and _are_plain(projected, own, rules):
            is_done = draw_smooth(
                s, nodes, projected, own, left, top, columns, rows, lookup, kind
            )  # fmt: skip
        if not is_done:
            _draw_tile(
                s, room, projected, own, is_one, left, top, columns, rows, limits, lookup, rules,
                kind,
            )  # fmt: skip
        if len(rgba) > 0:
            m.write_rgba(s, m.O_R, packed, rgba, column, row, columns, rows)
        else:
            for y in range(rows):
                for x in range(columns):
                    for c in range(m.OUTPUTS):
                        k = np.uint64((m.RESULTS + c) * m.PIXELS) + m.pixel_index(x, y)
                        out[row + y, column + x, c] = s[k]


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _draw_tile(
    s, room, projected, members, is_one, left, top, columns, rows, limits, lookup, rules, kind
):  # fmt: skip
    """Layer by layer, until nothing is left that could be seen.

    Most Gaussians belong to the first layer with all that they are: later ones need not ask them.
    """
    _clear(s, m.O_R, m.OPEN, ZERO)
    _clear(s, m.O_DEPTH, m.O_DEPTH + m.ALL, INFINITE)
    _clear(s, m.LAST_THROUGH, m.LAST_THROUGH + m.ALL, ONE)
    _clear(s, m.OPEN, m.OPEN + m.ALL, ONE)
    x0, y0 = np.float32(left), np.float32(top)
    first, last = 0, rows  # that are not finished
    count, aside = len(members), ZERO
    for n in range(count):
        room[n] = members[n]
        aside += projected[members[n], p.ASIDE]
    for layer in range(LAYERS):
        _clear(s, m.TOTAL, m.CLEAR, ZERO)
        _clear(s, m.CLEAR, m.BODY_CLEAR + m.ALL, ONE)
        if not is_one:
            _clear(s, m.F_DEPTH, m.F_DEPTH + m.ALL, FAR)
            _clear(s, m.F_X, m.FRONT, ZERO)
            for i in room[:count]:
                _draw(s, projected[i], x0, y0, first, last, layer, False, limits, True)
        kept = 0
        for i in room[:count]:
            if _draw(s, projected[i], x0, y0, first, last, layer, is_one, limits, False) > ZERO:
                room[kept] = i
                kept += 1
        count = kept
        first, last = composite_layer(
            s, layer, left, top, columns, first, last, lookup, rules, kind, aside > ZERO
        )  # fmt: skip
        if is_one or first >= last:
            return
        if layer < LAYERS - 1:
            for k in range(m.FRONT):
                s[np.uint64(layer + 1) * m.FRONT + k] = s[k]


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _fullest(starts):
    """How many Gaussians touch the tile that most of them touch."""
    most = 0
    for tile in range(len(starts) - 1):
        most = max(most, starts[tile + 1] - starts[tile])
    return most


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _are_plain(projected, members, rules):
    for i in members:  # noqa: SIM110 (a loop is what numba compiles)
        if not is_plain(projected[i], rules):
            return False
    return True


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _clear(s, first, last, value):
    for k in range(first, last):
        s[k] = value


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _is_one_layer(projected, members, x0, y0, limits):
    """Whether any two samples on the tile at x0, y0 agree in depth and in where they look.

    That is so where each is within half the gap of one of them, on all of the tile that it touches.
    """
    middle, least = members[0], FAR
    for i in members:
        away = abs(projected[i, p.CX] - x0 - MIDDLE) + abs(projected[i, p.CY] - y0 - MIDDLE)
        if away < least and projected[i, p.PHOTO] > ZERO:
            middle, least = i, away
    a = projected[middle]
    size = np.float32(TILE)
    limit = np.float32(0.25)
    for i in members:
        g = projected[i]
        if g[p.ASIDE] != a[p.ASIDE]:  # what they show cannot be compared
            return False
        low, high = max(x0, g[p.CX] - g[p.EX]), min(x0 + size, g[p.CX] + g[p.EX])
        x, wide = HALF * (low + high), HALF * max(high - low, ZERO)
        low, high = max(y0, g[p.CY] - g[p.EY]), min(y0 + size, g[p.CY] + g[p.EY])
        y, tall = HALF * (low + high), HALF * max(high - low, ZERO)
        dx, dy, ax, ay = x - g[p.CX], y - g[p.CY], x - a[p.CX], y - a[p.CY]
        apart = abs(g[p.Z] + g[p.ZX] * dx + g[p.ZY] * dy - a[p.Z] - a[p.ZX] * ax - a[p.ZY] * ay)
        apart += wide * abs(g[p.ZX] - a[p.ZX]) + tall * abs(g[p.ZY] - a[p.ZY])
        if not apart * apart * limits.per_gap <= limit:
            return False
        if g[p.PHOTO] > ZERO and a[p.PHOTO] > ZERO:
            lx = g[p.SX] + g[p.AXX] * dx + g[p.AXY] * dy
            lx = abs(lx - a[p.SX] - a[p.AXX] * ax - a[p.AXY] * ay)
            lx += wide * abs(g[p.AXX] - a[p.AXX]) + tall * abs(g[p.AXY] - a[p.AXY])
            ly = g[p.SY] + g[p.AYX] * dx + g[p.AYY] * dy
            ly = abs(ly - a[p.SY] - a[p.AYX] * ax - a[p.AYY] * ay)
            ly += wide * abs(g[p.AYX] - a[p.AYX]) + tall * abs(g[p.AYY] - a[p.AYY])
            if not (lx * lx + ly * ly) * limits.per_texture_gap <= limit:
                return False
    return True


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _draw(s, g, x0, y0, first, last, layer, is_one, limits, is_front):
    """One Gaussian onto the tile at x0, y0: as a layer's front, or into the layer's sums.

    On the rows first..last of the tile. Gives what of it belongs to later layers, summed up.
    """
    rest = ZERO
    cut = g[p.FRONT] if is_front and layer == 0 else g[p.CUT]
    if cut <= ZERO:
        return rest
    dx, dy = x0 + HALF - g[p.CX], y0 + HALF - g[p.CY]  # of the tile's first pixel
    spans = _span(g, cut, dx, dy, 0, first, last), _span(g, cut, dx, dy, 1, first, last)
    if spans[0][1] + spans[1][1] == 0:
        return rest
    if layer > 0:
        take(s, spans, g, dx, dy, layer, limits)
    if is_front:
        if layer == 0:
            first_front(s, spans, g, dx, dy)
        else:
            next_front(s, spans, g, dx, dy, limits)
        return rest
    if is_one:
        add_all(s, spans, g, dx, dy, limits)
    else:
        rest = add(s, spans, g, dx, dy, layer, limits)
    if g[p.PHOTO] > ZERO:
        is_changed = (g[p.MATTED] < ONE) | (g[p.SEEN] < ONE)
        if is_changed or g[p.MAGNIFIED] > limits.sharp:
            add_more(s, spans, g, limits)
        if g[p.ASIDE] > ZERO:
            add_aside(s, spans, g, dx, dy)
    if g[p.BODY] > ZERO:
        add_body(s, spans, g)
    if not limits.is_surface:
        multiply(s, spans, g)
    return rest


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _span(g, cut, dx, dy, strip, first, last):
    """Where the pixels that an ellipse touches of a strip begin, and how many they are."""
    start, end = strip_rows(g, cut, dx, dy, strip, last)
    start = max(start, first)
    at = strip * m.STRIP * TILE + start * m.STRIP
    return np.uint64(at), np.uint64(max(end - start, 0) * m.STRIP)
