"""A tile's sums become pixels: steps 5 to 7 of `reference`, compiled."""

from __future__ import annotations

import math

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import tile_memory as m
from .look_up import look_up
from .rules import HALF, INFINITE, ONE, ZERO, coverage, ramp

TINY = np.float32(1e-30)
LEAST_PHOTO = np.float32(1e-6)  # share of a layer's alpha, below which it shows no photo


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def composite_layer(
    s, layer, left, top, columns, first, last, view, photo, texels, shapes, crop_left, crop_top,
    rules, kind, has_sides,
):  # fmt: skip
    """Puts the layer behind what is there already, on the rows first..last of the tile.

    `has_sides`: some of it shows invented pictures.

    Returns the first row, and the last + 1, in which a further layer may be seen.
    """
    edged = ONE if kind.is_edged else ZERO
    for strip in range(m.STRIPS):
        start, end = m.strip_pixels(strip, first, last)
        _settle(s, start, end, edged)
    look_up(s, left, top, columns, first, last, view, photo, texels, shapes, crop_left, crop_top)
    if has_sides:
        for strip in range(m.STRIPS):
            _set_aside(s, *m.strip_pixels(strip, first, last))
        look_up(
            s, left, top, columns, first, last, view, photo, texels, shapes, crop_left, crop_top
        )
        for strip in range(m.STRIPS):
            _mix_sides(s, *m.strip_pixels(strip, first, last))
    visible, opaque = np.float32(rules.visible), np.float32(rules.opaque)
    for strip in range(m.STRIPS):
        start, end = m.strip_pixels(strip, first, last)
        if kind.is_surface:
            _cover(s, start, end, m.TOTAL, m.GX, m.GY, m.CLEAR, rules)
            bodied = m.BODY_CLEAR if kind.is_edged else m.BODIED
            _cover(s, start, end, bodied, m.BGX, m.BGY, m.BODY_CLEAR, rules)
        if layer == 0:
            _put_first(s, start, end, visible, opaque)
        else:
            _put_behind(s, start, end, rules)
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
def _mix_sides(s, start, end):
    """Mixes what both have shown; where the photo is shown at all, it says where a pixel looks.

    The photo counts as far as the matte has something of it, invented pictures are whole.
    """
    for k in range(start, end):
        own, is_there = s[m.P_SHOWN + k], s[m.IS_PHOTO + k]
        side = s[m.SIDE + k] * is_there
        matte = s[m.P_A + k] * s[m.MATTES + k] + s[m.SOLIDS + k]
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
def _cover(s, start, end, total, across, down, clear, rules):
    """1 - coverage, see `rules.coverage`, into the row `clear`."""
    for k in range(start, end):
        gx, gy = s[across + k], s[down + k]
        s[clear + k] = ONE - coverage(s[total + k], math.sqrt(gx * gx + gy * gy), rules)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def _put_first(s, start, end, visible, opaque):
    """The first layer: nothing is in front of it."""
    for k in range(start, end):
        total, body, is_photo = s[m.TOTAL + k], s[m.BODIED + k], s[m.IS_PHOTO + k]
        photo = max(total - body, ZERO) * is_photo
        matte = (s[m.T_A + k] * s[m.MATTES + k] + s[m.SOLIDS + k]) * is_photo
        whole, solid = ONE - s[m.CLEAR + k], ONE - s[m.BODY_CLEAR + k]
        alpha = matte * whole + (ONE - matte) * solid
        alpha = alpha if total > ZERO else ZERO
        x, y = s[m.SHX + k], s[m.SHY + k]
        s[m.LAST_WHOLE + k] = whole
        s[m.LAST_X + k] = x
        s[m.LAST_Y + k] = y
        s[m.LAST_SHARE + k] = photo / max(total, TINY)
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
def _put_behind(s, start, end, rules):
    """A later layer. Where it does not show, 0 is added: stores on a condition are slow."""
    near, far = np.float32(rules.same_point), np.float32(rules.apart)
    visible, opaque = np.float32(rules.visible), np.float32(rules.opaque)
    for k in range(start, end):
        total, body, is_photo = s[m.TOTAL + k], s[m.BODIED + k], s[m.IS_PHOTO + k]
        shows = ONE if total * s[m.OPEN + k] > ZERO else ZERO
        photo, total = max(total - body, ZERO) * is_photo, max(total, TINY)
        matte = (s[m.T_A + k] * s[m.MATTES + k] + s[m.SOLIDS + k]) * is_photo
        whole, solid = ONE - s[m.CLEAR + k], ONE - s[m.BODY_CLEAR + k]
        alpha = shows * (matte * whole + (ONE - matte) * solid)
        x, y = s[m.SHX + k], s[m.SHY + k]
        ex, ey = x - s[m.LAST_X + k], y - s[m.LAST_Y + k]
        share, last_share = photo / total, s[m.LAST_SHARE + k]
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
