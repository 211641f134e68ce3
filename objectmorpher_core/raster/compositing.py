"""A tile's sums become pixels: steps 5 to 7 of `reference`, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.arrays import F32, F64
from ..base.kernel_files import numba
from ..base.threads import EXACT, FAST
from . import tile_memory as m
from .intrinsics import sixteen_texels
from .rules import HALF, INFINITE, ONE, THREE, TWO, ZERO, coverage, ramp
from .sampling import C15, C25, add_halved, sample

# The photo at the pixels of a tile: step 5 of `reference`, compiled.

HIGHEST = np.float32(1e6)  # px: what looks farther away looks at nothing


class PhotoLookup(NamedTuple):
    """The photo that a picture's pixels look at, and the two cameras."""

    screen: F64  # focal length, cx, cy, width, height of the view, px
    photo: F64  # the same of the photo
    texels: F32  # see `TextureLevels`
    shapes: np.ndarray
    left: float  # px in the photo, corner of the texels
    top: float


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def look_up(s, left, top, columns, first, last, lookup):
    """Fills T_R to T_A and WITHIN where IS_PHOTO is 1, 0 elsewhere; on the rows first..last.

    The tile's first pixel is (left, top) of the view; it has so many columns.
    """
    photo, texels, shapes = lookup.photo, lookup.texels, lookup.shapes
    ratio = photo[0] / lookup.screen[0]
    x0 = (left + 0.5 - lookup.screen[1]) * ratio + photo[1]  # of the photo
    y0 = (top + 0.5 - lookup.screen[2]) * ratio + photo[2]
    # where the crop's pixel indices are counted from: near the tile, so that 32 bits suffice
    near_x, near_y = math.floor(x0 - lookup.left - 0.5), math.floor(y0 - lookup.top - 0.5)
    photo_x, photo_y = lookup.left + near_x + 0.5, lookup.top + near_y + 0.5
    for strip in range(m.STRIPS):
        start, end = m.strip_pixels(strip, first, last)
        _prepare(
            s, start, end, np.float32(x0 - photo_x), np.float32(y0 - photo_y), np.float32(ratio),
            np.float32(photo_x), np.float32(photo_y), np.float32(photo[3]), np.float32(photo[4]),
        )  # fmt: skip
    height, width = shapes[0, 0], shapes[0, 1]
    stride = np.uint64(4 * width)
    for y in range(first, last):
        for x in range(columns):
            k = m.pixel_index(x, y)
            if s[m.IS_PHOTO + k] == ZERO:
                s[m.T_R + k] = s[m.T_G + k] = s[m.T_B + k] = s[m.T_A + k] = ZERO
                continue
            column, row = int(s[m.COLUMN + k]) + near_x, int(s[m.LINE + k]) + near_y
            is_inside = (column >= 1) & (row >= 1) & (column < width - 2) & (row < height - 2)
            if is_inside and s[m.MAG + k] < TWO:  # most often so
                at = np.uint64(4 * ((row - 1) * width + column - 1))
                wx = s[m.WX0 + k], s[m.WX1 + k], s[m.WX2 + k], s[m.WX3 + k]
                wy = s[m.WY0 + k], s[m.WY1 + k], s[m.WY2 + k], s[m.WY3 + k]
                texel = sixteen_texels(texels, at, stride, wx, wy)
                if s[m.MAG + k] > ONE and len(shapes) > 1:
                    i, j = column + s[m.TX + k], row + s[m.TY + k]
                    texel = add_halved(texel, texels, shapes, i, j, s[m.MAG + k])
            else:
                u, v = column + 0.5 + s[m.TX + k], row + 0.5 + s[m.TY + k]
                texel = sample(texels, shapes, u, v, s[m.MAG + k])
            s[m.T_R + k], s[m.T_G + k], s[m.T_B + k], s[m.T_A + k] = texel


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _prepare(s, start, end, x0, y0, ratio, photo_x, photo_y, width, height):
    """Pixel index, place within the pixel and weights of the four texels on either axis.

    `x0`, `y0`: the first pixel's own place; `photo_x`, `photo_y`: photo px where that is 0.
    """
    for k in range(start, end):
        x = x0 + ratio * s[m.STEP_X + k] + s[m.SHX + k]
        y = y0 + ratio * s[m.STEP_Y + k] + s[m.SHY + k]
        x, y = min(max(x, -HIGHEST), HIGHEST), min(max(y, -HIGHEST), HIGHEST)
        u, v = x + photo_x, y + photo_y
        is_within = (u > ZERO) & (v > ZERO) & (u < width) & (v < height)
        s[m.WITHIN + k] = ONE if is_within else ZERO  # elsewhere the photo is made up
        column, line = np.float32(np.int32(x)), np.float32(np.int32(y))
        column = column - (ONE if column > x else ZERO)
        line = line - (ONE if line > y else ZERO)
        s[m.COLUMN + k], s[m.LINE + k] = column, line
        x, y = x - column, y - line
        s[m.TX + k], s[m.TY + k] = x, y
        s[m.WX0 + k] = ((-HALF * x + ONE) * x - HALF) * x
        s[m.WX1 + k] = (C15 * x - C25) * x * x + ONE
        s[m.WX2 + k] = ((-C15 * x + TWO) * x + HALF) * x
        s[m.WX3 + k] = (HALF * x - HALF) * x * x
        s[m.WY0 + k] = ((-HALF * y + ONE) * y - HALF) * y
        s[m.WY1 + k] = (C15 * y - C25) * y * y + ONE
        s[m.WY2 + k] = ((-C15 * y + TWO) * y + HALF) * y
        s[m.WY3 + k] = (HALF * y - HALF) * y * y


TINY = np.float32(1e-30)
LEAST_PHOTO = np.float32(1e-6)  # share of a layer's alpha, below which it shows no photo


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def composite_layer(
    s, layer, left, top, columns, first, last, lookup, rules, kind, has_sides
):  # fmt: skip
    """Puts the layer behind what is there already, on the rows first..last of the tile.

    `has_sides`: some of it shows invented pictures.

    Returns the first row, and the last + 1, in which a further layer may be seen.
    """
    edged = ONE if kind.is_edged else ZERO
    closing = (
        edged / np.float32(rules.closing_share), np.float32(rules.closed_start),
        ONE / np.float32(rules.closed_end - rules.closed_start),
    )  # fmt: skip
    for strip in range(m.STRIPS):
        start, end = m.strip_pixels(strip, first, last)
        _settle(s, start, end, edged)
    look_up(s, left, top, columns, first, last, lookup)
    if has_sides:
        for strip in range(m.STRIPS):
            _set_aside(s, *m.strip_pixels(strip, first, last))
        look_up(s, left, top, columns, first, last, lookup)
        for strip in range(m.STRIPS):
            _mix_sides(s, *m.strip_pixels(strip, first, last), closing)
    visible, opaque = np.float32(rules.visible), np.float32(rules.opaque)
    for strip in range(m.STRIPS):
        start, end = m.strip_pixels(strip, first, last)
        if kind.is_surface:
            _cover(s, start, end, m.TOTAL, m.GX, m.GY, m.CLEAR, rules)
            bodied = m.BODY_CLEAR if kind.is_edged else m.BODIED
            _cover(s, start, end, bodied, m.BGX, m.BGY, m.BODY_CLEAR, rules)
        if layer == 0:
            _put_first(s, start, end, visible, opaque, closing)
        else:
            _put_behind(s, start, end, rules, closing)
    least = np.float32(rules.least_front)
    begin, end = last, first
    for y in range(first, last):
        more = ZERO
        for strip in range(m.STRIPS):
            at = m.pixel_index(strip * m.STRIP, y)
            for k in range(at, at + np.uint64(m.STRIP)):
                more += ONE if s[m.OPEN + k] * s[m.LEFT + k] >= least else ZERO
        if more > ZERO:
            begin, end = min(begin, y), y + 1
    return begin, end


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _settle(s, start, end, edged):
    """What the sums say of the photo, for a share of the layer that is 1.

    BODY_CLEAR holds the sum of all that ends with the surface; `edged` 1: also of the photo.
    """
    for k in range(start, end):
        total = s[m.TOTAL + k]
        shown = max(total - s[m.BODIED + k], ZERO)
        is_photo = shown > LEAST_PHOTO * total
        inverse = ONE / max(shown, TINY)
        inverse = inverse if is_photo else ZERO
        own = max(shown - s[m.SIDE + k], ZERO)  # that is no invented picture
        is_own = own > LEAST_PHOTO * total
        looks = ONE / max(own, TINY)
        looks = looks if is_own else ZERO
        s[m.IS_PHOTO + k] = ONE if is_own else ZERO
        s[m.SHX + k] *= looks
        s[m.SHY + k] *= looks
        s[m.SIDE + k] *= inverse
        s[m.MAG + k] = ONE + s[m.MAG + k] * inverse
        s[m.MATTES + k] = max(ONE - s[m.MATTES + k] * inverse, ZERO)  # not below 0 by rounding
        s[m.BODY_CLEAR + k] += edged * (s[m.BODIED + k] + s[m.SOLIDS + k] - s[m.BODY_CLEAR + k])
        s[m.SOLIDS + k] *= inverse
        s[m.SEES + k] = max(ONE - s[m.SEES + k] * inverse, ZERO)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _set_aside(s, start, end):
    """Keeps what was found of the photo, and has the invented pictures looked up next.

    SIDE is their share, SIDE_X and SIDE_Y where they are looked at; both are straight afterwards.
    """
    for k in range(start, end):
        shown = max(s[m.TOTAL + k] - s[m.BODIED + k], ZERO)
        share = s[m.SIDE + k]
        is_there = share > LEAST_PHOTO
        inverse = ONE / max(share * shown, TINY)
        inverse = inverse if is_there else ZERO
        s[m.P_R + k], s[m.P_G + k] = s[m.T_R + k], s[m.T_G + k]
        s[m.P_B + k], s[m.P_A + k] = s[m.T_B + k], s[m.T_A + k]
        s[m.P_WITHIN + k], s[m.P_SHOWN + k] = s[m.WITHIN + k], s[m.IS_PHOTO + k]
        x, y = s[m.SHX + k], s[m.SHY + k]
        s[m.SHX + k], s[m.SHY + k] = s[m.SIDE_X + k] * inverse, s[m.SIDE_Y + k] * inverse
        s[m.SIDE_X + k], s[m.SIDE_Y + k] = x, y
        s[m.IS_PHOTO + k] = ONE if is_there else ZERO


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _mix_sides(s, start, end, closing):
    """Mixes what both have shown; where the photo is shown at all, it says where a pixel looks.

    The photo counts as far as the matte has something of it, invented pictures are whole.
    """
    for k in range(start, end):
        own, is_there = s[m.P_SHOWN + k], s[m.IS_PHOTO + k]
        side = s[m.SIDE + k] * is_there
        matte = _matte(s[m.P_A + k], s[m.MATTES + k], s[m.SOLIDS + k], closing)
        share = min(side / max(matte, TINY), ONE)
        share = share if own > ZERO else is_there
        rest = own * (ONE - share)
        s[m.SEES + k] *= min((ONE - share) / max(ONE - side, LEAST_PHOTO), ONE)
        s[m.T_R + k] = share * s[m.T_R + k] + rest * s[m.P_R + k]
        s[m.T_G + k] = share * s[m.T_G + k] + rest * s[m.P_G + k]
        s[m.T_B + k] = share * s[m.T_B + k] + rest * s[m.P_B + k]
        s[m.T_A + k] = s[m.P_A + k]
        s[m.SHX + k] += own * (s[m.SIDE_X + k] - s[m.SHX + k])
        s[m.SHY + k] += own * (s[m.SIDE_Y + k] - s[m.SHY + k])
        s[m.WITHIN + k] = own * s[m.P_WITHIN + k]
        s[m.IS_PHOTO + k] = max(own, is_there)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _matte(alpha, matted, solids, closing):
    """Return a pixel's matte where that of the photo has this `alpha`, see `Rules.closing_end`.

    `matted`, `solids`: the shares of what shows the photo that keep its matte, and that are whole.
    """
    matte = alpha * matted + solids
    turned = min(max(ONE - matted - solids, ZERO) * closing[0], ONE)
    t = min(max((alpha - closing[1]) * closing[2], ZERO), ONE)
    return matte + (ONE - matte) * turned * t * t * (THREE - TWO * t)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _cover(s, start, end, total, across, down, clear, rules):
    """1 - coverage, see `rules.coverage`, into the row `clear`."""
    for k in range(start, end):
        gx, gy = s[across + k], s[down + k]
        s[clear + k] = ONE - coverage(s[total + k], math.sqrt(gx * gx + gy * gy), rules)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _put_first(s, start, end, visible, opaque, closing):
    """The first layer: nothing is in front of it."""
    for k in range(start, end):
        total, body, is_photo = s[m.TOTAL + k], s[m.BODIED + k], s[m.IS_PHOTO + k]
        photo = max(total - body, ZERO) * is_photo
        matte = _matte(s[m.T_A + k], s[m.MATTES + k], s[m.SOLIDS + k], closing) * is_photo
        whole, solid = ONE - s[m.CLEAR + k], ONE - s[m.BODY_CLEAR + k]
        alpha = matte * whole + (ONE - matte) * solid
        alpha = alpha if total > ZERO else ZERO
        x, y = s[m.SHX + k], s[m.SHY + k]
        s[m.LAST_WHOLE + k] = whole
        s[m.LAST_X + k] = x
        s[m.LAST_Y + k] = y
        s[m.LAST_SHARE + k] = max(ONE - s[m.SIDE + k], ZERO) * photo / max(total, TINY)
        shown = photo * matte
        scale = alpha / max(shown + body, TINY)
        depth = s[m.DEPTH + k] / max(total, TINY)
        s[m.O_DEPTH + k] = depth if alpha > visible else INFINITE
        s[m.O_X + k] = x if alpha > visible else ZERO
        s[m.O_Y + k] = y if alpha > visible else ZERO
        s[m.O_R + k] = scale * (shown * s[m.T_R + k] + s[m.R + k])
        s[m.O_G + k] = scale * (shown * s[m.T_G + k] + s[m.G + k])
        s[m.O_B + k] = scale * (shown * s[m.T_B + k] + s[m.B + k])
        s[m.O_PHOTO + k] = scale * shown * s[m.SEES + k] * s[m.WITHIN + k]
        s[m.O_A + k] = alpha
        s[m.OPEN + k] = ZERO if alpha > opaque else ONE


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _put_behind(s, start, end, rules, closing):
    """A later layer. Where it does not show, 0 is added: stores on a condition are slow."""
    near, far = np.float32(rules.same_point), np.float32(rules.apart)
    visible, opaque = np.float32(rules.visible), np.float32(rules.opaque)
    for k in range(start, end):
        total, body, is_photo = s[m.TOTAL + k], s[m.BODIED + k], s[m.IS_PHOTO + k]
        shows = ONE if total * s[m.OPEN + k] > ZERO else ZERO
        photo, total = max(total - body, ZERO) * is_photo, max(total, TINY)
        matte = _matte(s[m.T_A + k], s[m.MATTES + k], s[m.SOLIDS + k], closing) * is_photo
        whole, solid = ONE - s[m.CLEAR + k], ONE - s[m.BODY_CLEAR + k]
        alpha = shows * (matte * whole + (ONE - matte) * solid)
        x, y = s[m.SHX + k], s[m.SHY + k]
        ex, ey = x - s[m.LAST_X + k], y - s[m.LAST_Y + k]
        share, last_share = max(ONE - s[m.SIDE + k], ZERO) * photo / total, s[m.LAST_SHARE + k]
        same = np.float32(ramp(math.sqrt(ex * ex + ey * ey), far, near)) * share * last_share
        before, last_whole, last_through = s[m.O_A + k], s[m.LAST_WHOLE + k], s[m.LAST_THROUGH + k]
        clear = ONE - before
        apart = clear * alpha
        split = last_through * (ONE - last_whole) * alpha
        through = shows * min(apart + same * (split - apart), clear)
        s[m.LAST_THROUGH + k] += shows * (ONE - same) * (clear - last_through)
        both = ONE - (ONE - same * last_whole) * (ONE - whole)
        s[m.LAST_WHOLE + k] += shows * (both - last_whole)
        s[m.LAST_X + k] += shows * ex
        s[m.LAST_Y + k] += shows * ey
        s[m.LAST_SHARE + k] += shows * (share - last_share)
        shown = photo * matte
        scale = through / max(shown + body, TINY)
        is_first = (alpha > visible) & (s[m.O_DEPTH + k] == INFINITE)
        is_seen = is_first | ((before < HALF) & (before + through >= HALF))
        seen = ONE if is_seen else ZERO
        if is_seen:  # 0 times infinite is no number
            s[m.O_DEPTH + k] = s[m.DEPTH + k] / total
        s[m.O_X + k] += seen * (x - s[m.O_X + k])
        s[m.O_Y + k] += seen * (y - s[m.O_Y + k])
        s[m.O_R + k] += scale * (shown * s[m.T_R + k] + s[m.R + k])
        s[m.O_G + k] += scale * (shown * s[m.T_G + k] + s[m.G + k])
        s[m.O_B + k] += scale * (shown * s[m.T_B + k] + s[m.B + k])
        s[m.O_PHOTO + k] += scale * shown * s[m.SEES + k] * s[m.WITHIN + k]
        s[m.O_A + k] = before + through
        s[m.OPEN + k] *= ONE if before + through <= opaque else ZERO
