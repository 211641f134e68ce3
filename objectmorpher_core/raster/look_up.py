"""The photo at the pixels of a tile: step 5 of `reference`, compiled."""

from __future__ import annotations

import math

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import EXACT
from . import tile_memory as m
from .intrinsics import sixteen_texels
from .rules import HALF, ONE, TWO, ZERO
from .sampling import C15, C25, add_halved, sample

HIGHEST = np.float32(1e6)  # px: what looks farther away looks at nothing


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def look_up(
    s, left, top, columns, first, last, view, photo, texels, shapes, crop_left, crop_top
):  # fmt: skip
    """Fills T_R to T_A and WITHIN where IS_PHOTO is 1, 0 elsewhere; on the rows first..last.

    The tile's first pixel is (left, top) of the view; it has so many columns.
    """
    ratio = photo[0] / view[0]
    x0 = (left + 0.5 - view[1]) * ratio + photo[1]  # of the photo
    y0 = (top + 0.5 - view[2]) * ratio + photo[2]
    # where the crop's pixel indices are counted from: near the tile, so that 32 bits suffice
    near_x, near_y = math.floor(x0 - crop_left - 0.5), math.floor(y0 - crop_top - 0.5)
    photo_x, photo_y = crop_left + near_x + 0.5, crop_top + near_y + 0.5
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
