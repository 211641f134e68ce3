"""A tile's working memory: where each quantity lies, shared by the kernels that draw in it.

A row of numbers per quantity, one for each pixel of the tile. Pixels lie strip by strip: eight
columns of the tile, row by row. The rows named here are those of a surface's tiles, 16 x 16 px in
two strips; the functions serve tiles of any height.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import EXACT, FAST
from . import rules as p
from .binning import TILE
from .rules import HALF, LAYERS, ONE, ZERO

PIXELS = TILE * TILE
STRIP = 8  # px, columns that lie side by side
STRIPS = TILE // STRIP
# Indices are unsigned: a signed one is looked at for its sign, and the loop is no vector code.
ALL = np.uint64(PIXELS)
FULL = np.float32(255)
BITS = np.uint32(8), np.uint32(16), np.uint32(24)  # where the bytes of a number begin


def _rows(first: int, count: int) -> tuple[np.uint64, ...]:
    """Where so many rows begin, from row `first` on."""
    return tuple(np.uint64(row * PIXELS) for row in range(first, first + count))


# The front of the layer that is being drawn, and after it those of the layers before.
F_DEPTH, F_X, F_Y, F_PHOTO, FRONT = _rows(0, 5)
SUMS = 4 * LAYERS

# The sums of the layer that is being drawn; see `reference.Sums`. MAG, MATTES and SEES hold what
# is missing to 1 or goes beyond it: nothing where the photo is carried along as it was.
(
    TOTAL, BODIED, GX, GY, BGX, BGY, DEPTH, SHX, SHY, MAG, SEES, MATTES, SOLIDS, R, G, B,
    LEFT,  # what belongs to later layers
    SIDE, SIDE_X, SIDE_Y,  # what shows invented pictures, and where in them
    CLEAR, BODY_CLEAR,
) = _rows(SUMS, 22)  # fmt: skip
RESULTS = SUMS + 22

# What has been composited, and what the next layer has to know of it.
(
    O_R, O_G, O_B, O_A, O_DEPTH, O_PHOTO, O_X, O_Y, LAST_X, LAST_Y, LAST_THROUGH, LAST_WHOLE,
    LAST_SHARE, OPEN,  # 1 where it is not opaque yet
) = _rows(RESULTS, 14)  # fmt: skip
OUTPUTS = 8  # the first of them: colour, alpha, depth, from_photo, shift
ROOM = RESULTS + 14

# Room to work in: what the photo shows; whether it does, and whether within the photo; what no
# layer before has taken of a sample; its alpha and gradient; the pixel's column and row; where it
# looks in the photo, and the weights of the texels there.
T_R, T_G, T_B, T_A, IS_PHOTO, WITHIN, SHARE, ALPHA, SLOPE_X, SLOPE_Y, STEP_X, STEP_Y = _rows(
    ROOM, 12
)
COLUMN, LINE, TX, TY, WX0, WX1, WX2, WX3, WY0, WY1, WY2, WY3 = _rows(ROOM + 12, 12)
# The photo's texels and whether it is shown, while those of the invented pictures are looked up.
P_R, P_G, P_B, P_A, P_WITHIN, P_SHOWN = _rows(ROOM + 24, 6)
ROWS = ROOM + 30


@numba.njit(nogil=True)
def pixel_index(x, y, tall=TILE):
    """Return the index, in a row of the memory, of column x and row y of a tile so tall."""
    return np.uint64(x // STRIP * (STRIP * tall) + y * STRIP + x % STRIP)


@numba.njit(nogil=True)
def strip_pixels(strip, first, last):
    """The pixels of the rows first..last of a strip: the first and the last + 1."""
    start = strip * (STRIP * TILE)
    return np.uint64(start + first * STRIP), np.uint64(start + last * STRIP)


@numba.njit(nogil=True)
def number_pixels(s, step_x, step_y, pixels, tall=TILE):
    """Writes the column and the row of each pixel of the tile to two rows of the memory."""
    for k in range(np.uint64(pixels)):
        i = int(k)
        s[step_x + k] = np.float32(i // (STRIP * tall) * STRIP + i % STRIP)
        s[step_y + k] = np.float32(i // STRIP % tall)


@numba.njit(nogil=True)
def clear_tile(out, rgba, column, row, columns, rows):
    """Clear the tile at (column, row) of a picture: in `out` or in `rgba`."""
    for y in range(row, row + rows):
        for x in range(column, column + columns):
            if len(rgba) > 0:
                rgba[y, x] = np.uint32(0)
            else:
                for c in range(OUTPUTS):
                    out[y, x, c] = np.inf if c == 4 else 0.0  # the depth


@numba.njit(nogil=True, fastmath=EXACT)
def write_rgba(s, first, packed, rgba, column, row, columns, rows, tall=TILE):
    """Premultiplied colour and alpha: four rows from `first` on, as numbers of four bytes.

    `packed` (pixels of a tile,) u32 is room to work in.
    """
    pixels = np.uint64(len(packed))
    for k in range(pixels):
        at = first + k
        red, green, blue = s[at], s[at + pixels], s[at + pixels + pixels]
        packed[k] = (
            _byte(red) | _byte(green) << BITS[0] | _byte(blue) << BITS[1]
            | _byte(s[at + pixels + pixels + pixels]) << BITS[2]
        )  # fmt: skip
    for y in range(rows):
        for x in range(columns):
            rgba[row + y, column + x] = packed[pixel_index(x, y, tall)]


@numba.njit(nogil=True, fastmath=EXACT)
def _byte(share):
    return np.uint32(np.int32(min(max(share * FULL + HALF, ZERO), FULL)))


# A Gaussian on a tile: its values, and the pixels where it has any.

STRIP_END = np.float32(STRIP - 1)
# exp(-t), 0 <= t <= 0.7: interpolated at Chebyshev points, right to 1e-7
E0, E1, E2, E3, E4, E5 = (
    np.float32(v)
    for v in (0.99999994, -0.99999389, 0.49989734, -0.16603126, 0.03986404, -0.00589814)
)
SIXTEENTH = np.float32(1 / 16)
LIMIT = np.float32(0.7)
ALMOST = np.float32(0.999)  # of a row: to begin with the next one, however it is rounded


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def bell(q):
    """exp(-q / 2) for 0 <= q <= 11.2, and beyond as there."""
    t = min(q * SIXTEENTH, LIMIT)
    e = E0 + t * (E1 + t * (E2 + t * (E3 + t * (E4 + t * E5))))
    e = e * e
    e = e * e
    return e * e


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def strip_rows(g, cut, dx, dy, strip, rows):
    """First and last + 1 of the `rows` that the ellipse q <= cut touches in a strip of a tile.

    `g` is a projected Gaussian; `dx`, `dy` are the way from its centre to the tile's first pixel.
    """
    ex, ey = g[p.EX], math.sqrt(cut / g[p.RYY])
    if cut < g[p.CUT]:
        ex *= math.sqrt(cut / g[p.CUT])
    dx += np.float32(strip * STRIP)
    if max(dx, -ex) > min(dx + STRIP_END, ex):
        return 0, 0
    start, end = rows_of(g[p.TILT], ex, ey, dx, dy, np.float32(rows))
    return int(start), int(end)


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def rows_of(tilt, ex, ey, dx, dy, rows):
    """Return the rows of any strip, to be cut off to integers; start >= end for none.

    `ex`, `ey`: half the size of the ellipse's box; `dx`, `dy`: way to the strip's first pixel.
    """
    left, right = max(dx, -ex), min(dx + STRIP_END, ex)
    # at dx its rows are lean dx / ex +- reach sqrt(1 - (dx / ex)^2)
    turned = ey / ex
    lean = -tilt * turned * ey
    reach = math.sqrt(max(ey * ey - lean * lean, ZERO))
    lowest = lean / turned
    x = min(max(-lowest, left), right) / ex
    low = lean * x - reach * math.sqrt(max(ONE - x * x, ZERO))
    x = min(max(lowest, left), right) / ex
    high = lean * x + reach * math.sqrt(max(ONE - x * x, ZERO))
    start = max(low - dy + ALMOST, ZERO)
    return start, min(max(high - dy + ONE, ZERO), rows) if left <= right else ZERO
