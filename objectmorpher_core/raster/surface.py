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
from .bell import strip_rows
from .binning import TILE
from .compositing import composite_layer
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
from .smooth import draw_smooth, is_plain, new_nodes

MIDDLE = np.float32(TILE / 2)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def draw_layers(
    first, last, projected, starts, members, across, left, top, width, height, view, photo,
    gap, texture_gap, texels, shapes, crop_left, crop_top, rules, kind, out, rgba,
):  # fmt: skip
    """Draws the tiles first..last of `out` (height, width, 8) f32 or of `rgba` (..) u32.

    The one that is not wanted is empty. A number of `rgba` is four bytes, the first the lowest.

    `left`, `top`: the pixel of the view at which `out` begins. `view`, `photo`: focal, cx, cy,
    width, height of the view and of the photo, px.
    """
    s = np.zeros(m.ROWS * m.PIXELS, np.float32)
    m.number_pixels(s, m.STEP_X, m.STEP_Y, m.PIXELS)
    packed = np.empty(m.PIXELS if len(rgba) > 0 else 0, np.uint32)
    nodes = new_nodes()
    room = np.empty(_fullest(starts[first : last + 1]), np.uint32)
    limits = limits_of(rules, kind, gap, texture_gap)
    for tile in range(first, last):
        begin, end = starts[tile], starts[tile + 1]
        column, row = (tile % across) * TILE, (tile // across) * TILE
        rows, columns = min(TILE, height - row), min(TILE, width - column)
        if begin == end:
            m.clear_tile(out, rgba, column, row, columns, rows)
            continue
        own = members[begin:end]
        x0, y0 = np.float32(left + column), np.float32(top + row)
        # Of other assets even what is no front counts, where there is a front.
        is_one = kind.is_surface and _is_one_layer(projected, own, x0, y0, limits)
        is_done = False
        if is_one and _are_plain(projected, own, rules):
            is_done = draw_smooth(
                s, nodes, projected, own, left + column, top + row, columns, rows, view, photo,
                texels, shapes, crop_left, crop_top, kind,
            )  # fmt: skip
        if not is_done:
            _draw_tile(
                s, room, projected, own, is_one, left + column, top + row, columns, rows, limits,
                view, photo, texels, shapes, crop_left, crop_top, rules, kind,
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
    s, room, projected, members, is_one, left, top, columns, rows, limits, view, photo, texels,
    shapes, crop_left, crop_top, rules, kind,
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
            s, layer, left, top, columns, first, last, view, photo, texels, shapes, crop_left,
            crop_top, rules, kind, aside > ZERO,
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
