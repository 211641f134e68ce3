"""Layers of photo-textured Gaussians, tile by tile: step 4 of `reference`, compiled.

A tile of 16 x 16 px has its sums in one array, a row a quantity and a column a pixel, so that the
inner loops run over many pixels without a branch and become vector instructions. The pixels come
in two strips of eight columns: the rows that an ellipse touches of a strip lie side by side. All
numbers are 32 bits wide. Where all that touches a tile lies so close together that it is
one layer everywhere, nobody looks for the layer's front: that is so on most of a surface.
"""

from __future__ import annotations

import numpy as np

from ..kernel_files import numba
from ..threads import FAST
from . import columns as p
from . import tile_memory as m
from .bell import bell, strip_rows
from .binning import TILE
from .compositing import composite_layer
from .fronts import FAR, first_front, next_front
from .rules import LAYERS
from .singles import HALF, INFINITE, ONE, THREE, TWO, ZERO
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
    gaps = ONE / np.float32(gap * gap), ONE / np.float32(texture_gap * texture_gap)
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
        is_one = kind.is_surface and _is_one_layer(projected, own, x0, y0, gaps)
        is_done = False
        if is_one and _are_plain(projected, own, rules):
            is_done = draw_smooth(
                s, nodes, projected, own, left + column, top + row, columns, rows, view, photo,
                texels, shapes, crop_left, crop_top, kind,
            )  # fmt: skip
        if not is_done:
            _draw_tile(
                s, room, projected, own, is_one, left + column, top + row, columns, rows, gaps,
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
    s, room, projected, members, is_one, left, top, columns, rows, gaps, view, photo, texels,
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
    count = len(members)
    for n in range(count):
        room[n] = members[n]
    for layer in range(LAYERS):
        _clear(s, m.TOTAL, m.CLEAR, ZERO)
        _clear(s, m.CLEAR, m.BODY_CLEAR + m.ALL, ONE)
        if not is_one:
            _clear(s, m.F_DEPTH, m.F_DEPTH + m.ALL, FAR)
            _clear(s, m.F_X, m.FRONT, ZERO)
            for i in room[:count]:
                _draw(s, projected[i], x0, y0, first, last, layer, False, gaps, rules, kind, True)
        kept = 0
        for i in room[:count]:
            rest = _draw(
                s, projected[i], x0, y0, first, last, layer, is_one, gaps, rules, kind, False
            )
            if rest > ZERO:
                room[kept] = i
                kept += 1
        count = kept
        first, last = composite_layer(
            s, layer, left, top, columns, first, last, view, photo, texels, shapes, crop_left,
            crop_top, rules, kind,
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
def _is_one_layer(projected, members, x0, y0, gaps):
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
        low, high = max(x0, g[p.CX] - g[p.EX]), min(x0 + size, g[p.CX] + g[p.EX])
        x, wide = HALF * (low + high), HALF * max(high - low, ZERO)
        low, high = max(y0, g[p.CY] - g[p.EY]), min(y0 + size, g[p.CY] + g[p.EY])
        y, tall = HALF * (low + high), HALF * max(high - low, ZERO)
        dx, dy, ax, ay = x - g[p.CX], y - g[p.CY], x - a[p.CX], y - a[p.CY]
        apart = abs(g[p.Z] + g[p.ZX] * dx + g[p.ZY] * dy - a[p.Z] - a[p.ZX] * ax - a[p.ZY] * ay)
        apart += wide * abs(g[p.ZX] - a[p.ZX]) + tall * abs(g[p.ZY] - a[p.ZY])
        if not apart * apart * gaps[0] <= limit:
            return False
        if g[p.PHOTO] > ZERO and a[p.PHOTO] > ZERO:
            lx = g[p.SX] + g[p.AXX] * dx + g[p.AXY] * dy
            lx = abs(lx - a[p.SX] - a[p.AXX] * ax - a[p.AXY] * ay)
            lx += wide * abs(g[p.AXX] - a[p.AXX]) + tall * abs(g[p.AXY] - a[p.AXY])
            ly = g[p.SY] + g[p.AYX] * dx + g[p.AYY] * dy
            ly = abs(ly - a[p.SY] - a[p.AYX] * ax - a[p.AYY] * ay)
            ly += wide * abs(g[p.AYX] - a[p.AYX]) + tall * abs(g[p.AYY] - a[p.AYY])
            if not (lx * lx + ly * ly) * gaps[1] <= limit:
                return False
    return True


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _draw(s, g, x0, y0, first, last, layer, is_one, gaps, rules, kind, is_front):
    """One Gaussian onto the tile at x0, y0: as a layer's front, or into the layer's sums.

    On the rows first..last of the tile. Gives what of it belongs to later layers, summed up.
    """
    rest = ZERO
    cut = g[p.FRONT] if is_front and layer == 0 else g[p.CUT]
    if cut <= ZERO:
        return rest
    dx, dy = x0 + HALF - g[p.CX], y0 + HALF - g[p.CY]  # of the tile's first pixel
    for strip in range(m.STRIPS):
        start, end = strip_rows(g, cut, dx, dy, strip, last)
        start = max(start, first)
        if start >= end:
            continue
        at = np.uint64(strip * m.STRIP * TILE + start * m.STRIP)
        count = np.uint64((end - start) * m.STRIP)
        rest += _draw_strip(s, at, count, g, dx, dy, layer, is_one, gaps, rules, kind, is_front)
    return rest


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _draw_strip(s, at, count, g, dx, dy, layer, is_one, gaps, rules, kind, is_front):
    """The same on `count` pixels from `at` on: some rows of a strip."""
    rest = ZERO
    if is_one:
        _add_all(s, at, count, g, dx, dy, kind)
    elif layer == 0:
        if is_front:
            first_front(s, at, count, g, dx, dy)
            return rest
        rest = _add(s, at, count, g, dx, dy, layer, gaps, rules, kind)
    else:
        for k in range(count):
            s[m.SHARE + at + k] = s[m.OPEN + at + k]
        for before in range(layer):
            _take(s, at, count, g, dx, dy, before, gaps, rules)
        if is_front:
            next_front(s, at, count, g, dx, dy, rules, kind)
            return rest
        rest = _add(s, at, count, g, dx, dy, layer, gaps, rules, kind)
    if g[p.PHOTO] > ZERO:
        is_changed = (g[p.MATTED] < ONE) | (g[p.SEEN] < ONE)
        if is_changed or g[p.MAGNIFIED] > np.float32(rules.sharp):
            _add_more(s, at, count, g, rules)
    if g[p.BODY] > ZERO:
        _add_body(s, at, count, g)
    if not kind.is_surface:
        _multiply(s, at, count, g)
    return rest


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _member(depth, x, y, is_alike, gaps, end):
    """How much a sample belongs to the layer of a front, from which it is so far: see `rules`."""
    looks = is_alike * (x * x + y * y) * gaps[1]
    away = max(depth * depth * gaps[0], looks)
    t = min(max((end - away) / (end - ONE), ZERO), ONE)
    return t * t * (THREE - TWO * t)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _take(s, at, count, g, dx0, dy0, before, gaps, rules):
    """Takes from m.SHARE what belongs to the layer `before`."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    is_photo = ONE if g[p.PHOTO] > ZERO else ZERO
    end = np.float32(rules.fade * rules.fade)
    row = np.uint64(before + 1) * m.FRONT + at
    for k in range(count):
        dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
        depth = z + zx * dx + zy * dy - s[row + k]
        x = sx + axx * dx + axy * dy - s[row + m.F_X + k]
        y = sy + ayx * dx + ayy * dy - s[row + m.F_Y + k]
        member = _member(depth, x, y, is_photo * s[row + m.F_PHOTO + k], gaps, end)
        s[m.SHARE + at + k] = s[m.SHARE + at + k] * (ONE - member)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _add(s, at, count, g, dx0, dy0, layer, gaps, rules, kind):
    """Adds a Gaussian to the sums of the layer, as far as it belongs there.

    Gives what belongs to later layers, summed up.
    """
    rest = ZERO
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy = g[p.QXX], g[p.TILT], g[p.RYY]
    qxy = qxx * tilt
    weight, photo, both = g[p.WEIGHT], g[p.PHOTO], g[p.PHOTO] + g[p.BODY]
    tail, most, least = np.float32(kind.tail), np.float32(kind.most), np.float32(kind.least)
    end = np.float32(rules.fade * rules.fade)
    is_photo = ONE if photo > ZERO else ZERO
    is_first = ONE if layer == 0 else ZERO
    is_last = ONE if layer == LAYERS - 1 else ZERO
    for k in range(count):
        dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
        e = dx + tilt * dy
        depth = z + zx * dx + zy * dy
        x, y = sx + axx * dx + axy * dy, sy + ayx * dx + ayy * dy
        b = weight * bell(qxx * e * e + ryy * dy * dy)
        alpha = min(b - weight * tail, most)
        is_there = (alpha >= least) & (alpha > ZERO)
        alpha = alpha if is_there else ZERO
        b = b if is_there else ZERO
        front = s[m.F_DEPTH + at + k]
        member = _member(
            depth - front, x - s[m.F_X + at + k], y - s[m.F_Y + at + k],
            is_photo * s[m.F_PHOTO + at + k], gaps, end,
        )  # fmt: skip
        share = max(s[m.SHARE + at + k], is_first)
        member = share * max(member, is_last)
        member = member if front < FAR else ZERO
        later = (share - member) * alpha * both
        rest += later
        s[m.LEFT + at + k] += later
        alpha, b = member * alpha, member * b
        gx, gy = b * qxx * e, b * (qxy * e + ryy * dy)
        s[m.ALPHA + at + k] = alpha
        s[m.SLOPE_X + at + k] = gx
        s[m.SLOPE_Y + at + k] = gy
        s[m.TOTAL + at + k] += alpha * both
        s[m.GX + at + k] -= gx * both
        s[m.GY + at + k] -= gy * both
        s[m.DEPTH + at + k] += alpha * both * depth
        s[m.SHX + at + k] += alpha * photo * x
        s[m.SHY + at + k] += alpha * photo * y
    return rest


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _add_all(s, at, count, g, dx0, dy0, kind):
    """The same where all belongs to one layer."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy = g[p.QXX], g[p.TILT], g[p.RYY]
    qxy = qxx * tilt
    weight, photo, both = g[p.WEIGHT], g[p.PHOTO], g[p.PHOTO] + g[p.BODY]
    tail, most, least = np.float32(kind.tail), np.float32(kind.most), np.float32(kind.least)
    for k in range(count):
        dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
        e = dx + tilt * dy
        b = weight * bell(qxx * e * e + ryy * dy * dy)
        alpha = min(b - weight * tail, most)
        is_there = (alpha >= least) & (alpha > ZERO)
        alpha = alpha if is_there else ZERO
        b = b if is_there else ZERO
        gx, gy = b * qxx * e, b * (qxy * e + ryy * dy)
        s[m.ALPHA + at + k] = alpha
        s[m.SLOPE_X + at + k] = gx
        s[m.SLOPE_Y + at + k] = gy
        s[m.TOTAL + at + k] += alpha * both
        s[m.GX + at + k] -= gx * both
        s[m.GY + at + k] -= gy * both
        s[m.DEPTH + at + k] += alpha * both * (z + zx * dx + zy * dy)
        s[m.SHX + at + k] += alpha * photo * (sx + axx * dx + axy * dy)
        s[m.SHY + at + k] += alpha * photo * (sy + ayx * dx + ayy * dy)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _add_more(s, at, count, g, rules):
    """What is 0 for a part of the photo that is carried along as it was."""
    photo, unseen = g[p.PHOTO], (ONE - g[p.SEEN]) * g[p.PHOTO]
    magnified = max(g[p.MAGNIFIED] / np.float32(rules.sharp) - ONE, ZERO) * photo
    unmatted, solid = (ONE - g[p.MATTED]) * photo, (ONE - g[p.MATTED]) * g[p.SOLID] * photo
    for k in range(count):
        alpha = s[m.ALPHA + at + k]
        s[m.MAG + at + k] += alpha * magnified
        s[m.MATTES + at + k] += alpha * unmatted
        s[m.SOLIDS + at + k] += alpha * solid
        s[m.SEES + at + k] += alpha * unseen


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _add_body(s, at, count, g):
    """What shows its own colour."""
    body = g[p.BODY]
    red, green, blue = body * g[p.RED], body * g[p.GREEN], body * g[p.BLUE]
    for k in range(count):
        alpha = s[m.ALPHA + at + k]
        s[m.BODIED + at + k] += alpha * body
        s[m.BGX + at + k] -= s[m.SLOPE_X + at + k] * body
        s[m.BGY + at + k] -= s[m.SLOPE_Y + at + k] * body
        s[m.R + at + k] += alpha * red
        s[m.G + at + k] += alpha * green
        s[m.B + at + k] += alpha * blue


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _multiply(s, at, count, g):
    """What shines through, for assets whose coverage is 1 - prod(1 - alpha)."""
    body, both = g[p.BODY], g[p.PHOTO] + g[p.BODY]
    for k in range(count):
        alpha = s[m.ALPHA + at + k]
        s[m.CLEAR + at + k] *= max(ONE - alpha * both, ZERO)
        s[m.BODY_CLEAR + at + k] *= max(ONE - alpha * body, ZERO)
