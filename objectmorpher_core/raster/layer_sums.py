"""Sums of the Gaussians of a layer, pixel by pixel; step 4 of `reference`, compiled.

Each function takes one of them. `spans`: where the pixels that it touches begin in each of the
tile's strips, and how many they are; `dx`, `dy`: the way from its centre to the first pixel.
"""

from __future__ import annotations

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import rules as p
from . import tile_memory as m
from .intrinsics import lesser
from .rules import LAYERS, ONE, THREE, TWO, ZERO
from .tile_memory import bell


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _member(depth, x, y, is_alike, limits):
    """How much a sample belongs to the layer of a front, from which it is so far: see `rules`.

    `is_alike`: > 0 where both show the photo, or both an invented picture: see `_shows`.
    """
    looks = is_alike * (x * x + y * y) * limits.per_texture_gap
    away = max(depth * depth * limits.per_gap, looks)
    t = min(max((limits.end - away) * limits.fall, ZERO), ONE)
    return t * t * (THREE - TWO * t)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _shows(g):
    """1: the photo, -1: an invented picture, 0: neither. Of alike ones the product is positive."""
    if g[p.PHOTO] > ZERO:
        return ONE - TWO * g[p.ASIDE]
    return ZERO


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def take(s, spans, g, dx, dy, layer, limits):
    """Fills m.SHARE with what no layer before has taken of a Gaussian, where it can be seen."""
    for at, count in spans:
        for k in range(count):
            s[m.SHARE + at + k] = s[m.OPEN + at + k]
        for before in range(layer):
            _take_layer(s, at, count, g, dx, dy, before, limits)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _take_layer(s, at, count, g, dx0, dy0, before, limits):
    """Takes from m.SHARE what belongs to the layer `before`, on some rows of a strip."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    is_photo = _shows(g)
    row = np.uint64(before + 1) * m.FRONT + at
    for k in range(count):
        dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
        depth = z + zx * dx + zy * dy - s[row + k]
        x = sx + axx * dx + axy * dy - s[row + m.F_X + k]
        y = sy + ayx * dx + ayy * dy - s[row + m.F_Y + k]
        member = _member(depth, x, y, is_photo * s[row + m.F_PHOTO + k], limits)
        s[m.SHARE + at + k] = s[m.SHARE + at + k] * (ONE - member)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _alpha(weight, distance, limits):
    """A sample's alpha so far from the centre, 0 where it is not seen; and its bell there."""
    b = weight * bell(distance)
    alpha = min(b - weight * limits.tail, limits.most)
    is_there = (alpha >= limits.least) & (alpha > ZERO)
    return alpha if is_there else ZERO, b if is_there else ZERO


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _put(s, k, alpha, gx, gy, both, photo, depth, x, y):
    """Adds a sample to the sums of pixel k; `gx`, `gy`: how its alpha falls.

    `photo`: share of it that shows the photo itself; `add_aside` adds what is invented.
    """
    s[m.ALPHA + k] = alpha
    s[m.SLOPE_X + k] = gx
    s[m.SLOPE_Y + k] = gy
    s[m.TOTAL + k] += alpha * both
    s[m.GX + k] -= gx * both
    s[m.GY + k] -= gy * both
    s[m.DEPTH + k] += alpha * both * depth
    s[m.SHX + k] += alpha * photo * x
    s[m.SHY + k] += alpha * photo * y


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def add(s, spans, g, dx0, dy0, layer, limits):
    """Adds a Gaussian to the sums of the layer, as far as it belongs there.

    Gives what belongs to later layers, summed up.
    """
    rest = ZERO
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy = g[p.QXX], g[p.TILT], g[p.RYY]
    qxy = qxx * tilt
    weight, both = g[p.WEIGHT], g[p.PHOTO] + g[p.BODY]
    photo = (ONE - g[p.ASIDE]) * g[p.PHOTO]
    is_photo = _shows(g)
    is_first = ONE if layer == 0 else ZERO
    is_last = ONE if layer == LAYERS - 1 else ZERO
    for at, count in spans:
        for k in range(count):
            dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
            e = dx + tilt * dy
            depth = z + zx * dx + zy * dy
            x, y = sx + axx * dx + axy * dy, sy + ayx * dx + ayy * dy
            alpha, b = _alpha(weight, qxx * e * e + ryy * dy * dy, limits)
            front = s[m.F_DEPTH + at + k]
            member = _member(
                depth - front, x - s[m.F_X + at + k], y - s[m.F_Y + at + k],
                is_photo * s[m.F_PHOTO + at + k], limits,
            )  # fmt: skip
            share = max(s[m.SHARE + at + k], is_first)
            member = share * max(member, is_last)
            member = member if front < FAR else ZERO
            later = (share - member) * alpha * both
            rest += later
            s[m.LEFT + at + k] += later
            alpha, b = member * alpha, member * b
            gx, gy = b * qxx * e, b * (qxy * e + ryy * dy)
            _put(s, at + k, alpha, gx, gy, both, photo, depth, x, y)
    return rest


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def add_all(s, spans, g, dx0, dy0, limits):
    """Add all Gaussians where they belong to one layer."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy = g[p.QXX], g[p.TILT], g[p.RYY]
    qxy = qxx * tilt
    weight, both = g[p.WEIGHT], g[p.PHOTO] + g[p.BODY]
    photo = (ONE - g[p.ASIDE]) * g[p.PHOTO]
    for at, count in spans:
        for k in range(count):
            dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
            e = dx + tilt * dy
            alpha, b = _alpha(weight, qxx * e * e + ryy * dy * dy, limits)
            gx, gy = b * qxx * e, b * (qxy * e + ryy * dy)
            depth = z + zx * dx + zy * dy
            x, y = sx + axx * dx + axy * dy, sy + ayx * dx + ayy * dy
            _put(s, at + k, alpha, gx, gy, both, photo, depth, x, y)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def add_more(s, spans, g, limits):
    """Add a Gaussian's sums beyond those of the photo carried along as it was, which are 0."""
    photo, unseen = g[p.PHOTO], (ONE - g[p.SEEN]) * g[p.PHOTO]
    magnified = max(g[p.MAGNIFIED] / limits.sharp - ONE, ZERO) * photo
    unmatted, solid = (ONE - g[p.MATTED]) * photo, (ONE - g[p.MATTED]) * g[p.SOLID] * photo
    edged = solid if limits.is_edged else ZERO
    for at, count in spans:
        for k in range(count):
            alpha = s[m.ALPHA + at + k]
            s[m.MAG + at + k] += alpha * magnified
            s[m.MATTES + at + k] += alpha * unmatted
            s[m.SOLIDS + at + k] += alpha * solid
            s[m.SEES + at + k] += alpha * unseen
            s[m.BGX + at + k] -= s[m.SLOPE_X + at + k] * edged
            s[m.BGY + at + k] -= s[m.SLOPE_Y + at + k] * edged


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def add_aside(s, spans, g, dx0, dy0):
    """Add where in an invented picture a Gaussian looks."""
    photo, sx, sy = g[p.PHOTO], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    for at, count in spans:
        for k in range(count):
            dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
            shown = s[m.ALPHA + at + k] * photo
            s[m.SIDE + at + k] += shown
            s[m.SIDE_X + at + k] += shown * (sx + axx * dx + axy * dy)
            s[m.SIDE_Y + at + k] += shown * (sy + ayx * dx + ayy * dy)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def add_body(s, spans, g):
    """Add a Gaussian that shows its own colour."""
    body = g[p.BODY]
    red, green, blue = body * g[p.RED], body * g[p.GREEN], body * g[p.BLUE]
    for at, count in spans:
        for k in range(count):
            alpha = s[m.ALPHA + at + k]
            s[m.BODIED + at + k] += alpha * body
            s[m.BGX + at + k] -= s[m.SLOPE_X + at + k] * body
            s[m.BGY + at + k] -= s[m.SLOPE_Y + at + k] * body
            s[m.R + at + k] += alpha * red
            s[m.G + at + k] += alpha * green
            s[m.B + at + k] += alpha * blue


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def multiply(s, spans, g):
    """Multiply the light that shines through, for assets whose coverage is 1 - prod(1 - alpha)."""
    body, both = g[p.BODY], g[p.PHOTO] + g[p.BODY]
    for at, count in spans:
        for k in range(count):
            alpha = s[m.ALPHA + at + k]
            s[m.CLEAR + at + k] *= max(ONE - alpha * both, ZERO)
            s[m.BODY_CLEAR + at + k] *= max(ONE - alpha * body, ZERO)


# Where a layer begins: the sample nearest to the camera, pixel by pixel; step 4 of `reference`.

FAR = np.float32(3e38)  # a depth that nothing has


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def first_front(s, spans, g, dx0, dy0):
    """The nearest sample of each pixel so far."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy, limit = g[p.QXX], g[p.TILT], g[p.RYY], g[p.FRONT]
    is_photo = _shows(g)
    for at, count in spans:
        for k in range(count):
            dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
            e = dx + tilt * dy
            depth = z + zx * dx + zy * dy
            is_front = qxx * e * e + ryy * dy * dy <= limit
            x, y = sx + axx * dx + axy * dy, sy + ayx * dx + ayy * dy
            _choose_front(s, at + k, is_front, depth, x, y, is_photo)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def next_front(s, spans, g, dx0, dy0, limits):
    """Find the next front within the rest that earlier layers have left, m.SHARE."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy = g[p.QXX], g[p.TILT], g[p.RYY]
    is_photo = _shows(g)
    weight, both = g[p.WEIGHT], g[p.PHOTO] + g[p.BODY]
    tail, most, least = limits.tail, limits.most, limits.least
    least_front = limits.least_front
    for at, count in spans:
        for k in range(count):
            dx, dy = dx0 + s[m.STEP_X + at + k], dy0 + s[m.STEP_Y + at + k]
            e = dx + tilt * dy
            depth = z + zx * dx + zy * dy
            alpha = min(weight * (bell(qxx * e * e + ryy * dy * dy) - tail), most)
            is_enough = (alpha >= least) & (s[m.SHARE + at + k] * alpha * both >= least_front)
            x, y = sx + axx * dx + axy * dy, sy + ayx * dx + ayy * dy
            _choose_front(s, at + k, is_enough, depth, x, y, is_photo)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _choose_front(s, k, is_front, depth, x, y, is_photo):
    """Makes a sample the front of pixel k, where it is nearer.

    What is chosen is multiplied and added: stores that depend on a condition are slow.
    """
    before = s[m.F_DEPTH + k]
    nearer = ONE if is_front & (depth < before) else ZERO
    s[m.F_DEPTH + k] = lesser(before, depth if is_front else FAR)
    s[m.F_X + k] += nearer * (x - s[m.F_X + k])
    s[m.F_Y + k] += nearer * (y - s[m.F_Y + k])
    s[m.F_PHOTO + k] += nearer * (is_photo - s[m.F_PHOTO + k])
