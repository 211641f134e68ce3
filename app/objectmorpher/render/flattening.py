"""The canvas put together by the processor: what the shaders do, where OpenGL is emulated.

A drag changes the picture of an object in every frame, and nothing else. Emulated, the shaders'
look-ups of all that lies under it take longer than everything else together; here they are made
once for a view, and the rest is vector code.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from objectmorpher_core.base.arrays import F32, U8, frozen
from objectmorpher_core.base.kernel_files import numba
from objectmorpher_core.base.threads import EXACT, in_threads

from ..canvas.blend import CELL
from ..canvas.layer import CanvasLayer

Bounds = tuple[float, float, float, float]

PARTS = 2  # pieces of the picture for each thread
ZERO, HALF, ONE, FULL = (np.float32(v) for v in (0, 0.5, 1, 255))
SHARES = ((np.arange(CELL) + 0.5) / CELL).astype(np.float32)  # of the next cell at a px after one
BYTE, EIGHT, SIXTEEN, TOP = (np.uint32(v) for v in (255, 8, 16, 24))
NOTHING, OPAQUE = np.uint32(0), np.uint32(255 << 24)


def flatten(
    photo: U8, back: U8, blend: F32, layers: tuple[CanvasLayer, ...], photo_box: Bounds
) -> U8:
    """(h, w, 4) of the canvas, upright.

    `photo`, `back` (h, w, 4): the photo and the edit's background as the view shows them; `blend`
    see `Scene`; `photo_box`: canvas px, beyond which there is no object.
    """
    out = np.empty(photo.shape[:2], "<u4")
    under, behind, blend = _packed_pixels(photo), _packed_pixels(back), frozen(blend)
    in_threads(lambda a, b: _mix(a, b, under, behind, blend, out), len(out), PARTS)
    for layer in layers:
        _add(layer, under, _full(blend) if layer.is_weighed else blend, photo_box, out)
    return out.view(np.uint8).reshape(*out.shape, 4)


def _full(blend: F32) -> F32:
    """Everywhere the edit: for what has its share of it already."""
    return frozen(np.ones_like(blend))


def rehearse() -> None:
    """Loads the kernels, or compiles them the first time, before somebody waits for them."""
    some, blend = np.zeros((CELL, CELL, 4), np.uint8), np.ones((1, 1), np.float32)
    box = (0.0, 0.0, float(CELL), float(CELL))
    layers = CanvasLayer(box, some), CanvasLayer(box, some, is_coarse=True)
    flatten(some, some, blend, layers, box)


def _add(
    layer: CanvasLayer, photo: np.ndarray, blend: F32, photo_box: Bounds, out: np.ndarray
) -> None:
    """Draws a layer over what is there; where the `photo` is shown, it shows that, too."""
    low = [max(a, b, 0.0) for a, b in zip(layer.box[:2], photo_box[:2], strict=True)]
    size = out.shape[1], out.shape[0]
    high = [min(a, b, c) for a, b, c in zip(layer.box[2:], photo_box[2:], size, strict=True)]
    # A pixel is covered where its centre is.
    x0, y0, x1, y1 = (math.ceil(v - 0.5) for v in (*low, *high))
    if x1 <= x0 or y1 <= y0:
        return
    pixels = _packed_pixels(layer.pixels)
    gain = tuple(np.float32(g) for g in layer.gain)
    inputs: tuple[Any, ...]
    if layer.is_coarse:
        x, x_share = _places(x0, x1, layer.box[0], layer.box[2], pixels.shape[1])
        y, y_share = _places(y0, y1, layer.box[1], layer.box[3], pixels.shape[0])
        inputs = (x0, y0, pixels, x, x_share, y, y_share, gain, photo, blend, out)
        in_threads(lambda a, b: _add_coarse(a, b, *inputs), y1 - y0, PARTS)
    else:
        left, top = x0 - round(layer.box[0]), y0 - round(layer.box[1])
        inputs = (x0, y0, pixels, left, top, x1 - x0, gain, photo, blend, out)
        in_threads(lambda a, b: _add_exact(a, b, *inputs), y1 - y0, PARTS)


def _packed_pixels(rgba: U8) -> np.ndarray:
    """(h, w) u32, read-only as all that a kernel reads."""
    return frozen(np.ascontiguousarray(rgba).view("<u4")[..., 0])


def _places(
    first: int, last: int, low: float, high: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Which of `count` px between low and high is at each canvas px, and the next one's share."""
    at = (np.arange(first, last) + 0.5 - low) / (high - low) * count - 0.5
    index = np.floor(at).clip(0, count - 1)
    return index.astype(np.int64), (at - index).clip(0, 1).astype(np.float32)


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _blend_row(blend, y, cells, row):
    """The blend at the canvas px (0.., y), bilinear between the centres of the cells.

    `row` begins with the half of a cell that is beside the canvas: px 0 is at CELL // 2.
    """
    rows, columns = blend.shape
    v = (np.float32(y) + HALF) / np.float32(CELL) - HALF
    i = min(max(int(math.floor(v)), 0), rows - 1)
    below, t = min(i + 1, rows - 1), min(max(v - np.float32(i), ZERO), ONE)
    for j in range(columns):
        cells[1 + j] = blend[i, j] + t * (blend[below, j] - blend[i, j])
    cells[0], cells[columns + 1] = cells[1], cells[columns]
    for j in range(columns + 1):
        left, more = cells[j], cells[j + 1] - cells[j]
        for k in range(CELL):
            row[CELL * j + k] = left + SHARES[k] * more


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _room(blend):
    """Memory for a row of cells, and for a row of pixels, see `_blend_row`."""
    count = blend.shape[1] + 1
    return np.empty(count + 1, np.float32), np.empty(CELL * count, np.float32)


# What follows has no branches: at a share of 0 and of 1, and where a layer is empty or opaque, the
# arithmetic gives the very bytes; and vector code takes less time than a look at each pixel.


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _mix(first, last, photo, back, blend, out):
    """Rows first..last of the background: the photo, and where the edit is shown what is behind."""
    width = out.shape[1]
    cells, row = _room(blend)
    for y in range(first, last):
        _blend_row(blend, y, cells, row)
        share, above, below, to = row[CELL // 2 :], photo[y], back[y], out[y]
        for x in range(np.uint64(width)):
            a, b, e = above[x], below[x], share[x]
            to[x] = _packed(
                _red(a) + e * (_red(b) - _red(a)),
                _green(a) + e * (_green(b) - _green(a)),
                _blue(a) + e * (_blue(b) - _blue(a)),
            )


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _add_exact(first, last, left, top, pixels, skipped, above, width, gain, photo, blend, out):
    """Rows first..last of a layer that is px for px, without its first columns and rows."""
    cells, row = _room(blend)
    for line in range(first, last):
        y = top + line
        _blend_row(blend, y, cells, row)
        share, to, under = row[CELL // 2 + left :], out[y, left:], photo[y, left:]
        layer = pixels[above + line, skipped:]
        for x in range(np.uint64(width)):
            p = layer[x]
            colour = _red(p), _green(p), _blue(p), _alpha(p)
            to[x] = _covered(to[x], colour, gain, share[x], under[x])


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _add_coarse(
    first, last, left, top, pixels, xs, x_shares, ys, y_shares, gain, photo, blend, out
):
    """Rows first..last of a layer with fewer px than its box, bilinear."""
    cells, row = _room(blend)
    most_x, most_y = pixels.shape[1] - 1, pixels.shape[0] - 1
    for line in range(first, last):
        y = top + line
        _blend_row(blend, y, cells, row)
        share, to, under = row[CELL // 2 + left :], out[y, left:], photo[y, left:]
        i, t = ys[line], y_shares[line]
        below = min(i + 1, most_y)
        for x in range(len(xs)):
            if share[x] == ZERO:
                continue
            j, s = xs[x], x_shares[x]
            right = min(j + 1, most_x)
            a, b, c, d = pixels[i, j], pixels[i, right], pixels[below, j], pixels[below, right]
            colour = (
                _between(_red(a), _red(b), _red(c), _red(d), s, t),
                _between(_green(a), _green(b), _green(c), _green(d), s, t),
                _between(_blue(a), _blue(b), _blue(c), _blue(d), s, t),
                _between(_alpha(a), _alpha(b), _alpha(c), _alpha(d), s, t),
            )
            to[x] = _covered(to[x], colour, gain, share[x], under[x])


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _covered(p, colour, gain, share, photo):
    """The pixel `p` under a premultiplied colour in its light (light.glsl, layer.frag).

    Only a `share` of it has that colour, the rest the photo's: what lies between is not seen.
    """
    r, g, b, a = colour
    r, g, b = min(r * gain[0], a), min(g * gain[1], a), min(b * gain[2], a)
    rest, still = ONE - a / FULL, (ONE - share) * a / FULL
    return _packed(
        rest * _red(p) + share * r + still * _red(photo),
        rest * _green(p) + share * g + still * _green(photo),
        rest * _blue(p) + share * b + still * _blue(photo),
    )


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _between(a, b, c, d, s, t):
    upper = a + s * (b - a)
    return upper + t * (c + s * (d - c) - upper)


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _red(p):
    return np.float32(np.int32(p & BYTE))


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _green(p):
    return np.float32(np.int32(p >> EIGHT & BYTE))


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _blue(p):
    return np.float32(np.int32(p >> SIXTEEN & BYTE))


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _alpha(p):
    return np.float32(np.int32(p >> TOP))


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def _packed(r, g, b):
    """Bytes of values in [0, 255], opaque."""
    red, green, blue = np.int32(r + HALF), np.int32(g + HALF), np.int32(b + HALF)
    return np.uint32(red | green << 8 | blue << 16 | np.int32(-16777216))
