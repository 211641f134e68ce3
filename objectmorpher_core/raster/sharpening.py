"""A coarse picture of an object made sharp: a draft of what `surface` draws.

Where an object shows the photo, the map of where its pixels look is smooth. Drawn with few pixels,
it is interpolated to the view's own, and the photo is looked up through it at full resolution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..base.arrays import F32, I32, U8
from ..base.kernel_files import numba
from ..base.threads import EXACT, in_threads
from .intrinsics import between, bytes_over, four_texels
from .reference import Picture3D
from .rules import HALF, ONE, TWO, ZERO
from .texture import TextureLevels

Box = tuple[int, int, int, int]

R, G, B, A, SHARE, SX, SY, SEEN = range(8)  # columns of a coarse pixel
LEAST_ALPHA = np.float32(0.02)  # with which a pixel's map counts
INNER = np.float32(0.97)  # alpha inside the object
LEAST_SHOWN = np.float32(1e-3)  # alpha, of which a share is known
MOST_SLOPE = 6.0  # change of the map, x the step of a coarse px: with more it is torn there
ROUNDS = 2  # px by which the map is continued, so that it can be interpolated at the edge
PARTS = 4  # pieces of the picture for each thread
FULL = np.float32(255.0)
WHOLE = np.float32(0.999)  # share of the photo: with less the coarse colours are seen
A_ON, SHARE_ON, SX_ON, SY_ON = (np.uint64(c) for c in (A, SHARE, SX, SY))
FOUR, EIGHT = np.uint64(4), np.uint64(8)


def sharpen(
    picture: Picture3D,
    texture: TextureLevels,
    factor: int,
    box: Box,
    corner: tuple[float, float],
    zoom: float,
    *,
    is_marked: bool = True,
) -> tuple[U8, U8 | None]:
    """The part `box` (x0, y0, x1, y1 px) of a view: (h, w, 4) premultiplied; (h, w) invented.

    The photo is looked up bilinearly, in the halved copy that is nearest to the view's scale.

    `picture` is the part of the view that begins at the box's corner, with `factor` x `factor` of
    its px in one. `corner`: photo px at the view's left top; `zoom`: view px per photo px. What is
    invented is the share of a pixel that shows the object, but nothing of the photo; None unless
    `is_marked`.
    """
    coarse, ends = _packed(picture, MOST_SLOPE * factor / zoom)
    height, width = box[3] - box[1], box[2] - box[0]
    rgba = np.zeros((height, width), "<i4")
    invented = np.zeros((height, width) if is_marked else (1, 0), np.uint8)
    level = round(math.log2(max(1 / zoom, 1.0)))
    level = min(level, len(texture.shapes) - 1)
    scale = 2.0**-level
    # Texels at the box's first px, and per view px.
    left = scale * (corner[0] + (box[0] + 0.5) / zoom - texture.left) - 0.5
    top = scale * (corner[1] + (box[1] + 0.5) / zoom - texture.top) - 0.5
    u = (np.arange(width) + 0.5) / factor - 0.5  # where each px is among the coarse ones
    pixels = np.floor(u).clip(0, coarse.shape[1] - 1)
    own = CoarseRows(
        coarse.reshape(len(coarse), -1), ends,
        (8 * pixels).astype(np.uint64), (u - pixels).clip(0, 1).astype(np.float32),
    )  # fmt: skip
    fine = FineTexels(
        np.float32(factor), np.float32(left), np.float32(top), np.float32(scale / zoom),
        np.float32(scale), texture.texels, texture.shapes[level],
    )  # fmt: skip
    in_threads(
        lambda first, last: _sharpen(first, last, own, fine, rgba, invented, is_marked),
        height, PARTS,
    )  # fmt: skip
    return rgba.view(np.uint8).reshape(height, width, 4), invented if is_marked else None


class CoarseRows(NamedTuple):
    """A coarse picture, and where a view's columns lie in it, as the kernel takes them."""

    numbers: F32  # (rows, 8 x columns), see `_packed`
    ends: I32  # likewise
    pixels: np.ndarray  # u64, of each column of the view the coarse px before it, x 8, ...
    shares: F32  # ... and how much it takes of the next


class FineTexels(NamedTuple):
    """The copy of the photo that is looked up, as the kernel takes it."""

    factor: np.float32  # px of the view in a coarse one
    left: np.float32  # texels at the box's first px
    top: np.float32
    step: np.float32  # texels per px of the view
    scale: np.float32  # texels per px of the photo
    texels: F32
    shape: np.ndarray  # height, width and first texel


def _packed(picture: Picture3D, limit: float) -> tuple[F32, I32]:
    """(h, w, 8) columns as above, the map continued around the object, and (h, 2) its ends.

    Those are of each row the first px that shows something, and the one after the last. Where the
    map changes by more than `limit` photo px from one px to the next, the photo meets an invented
    picture: no look-up between both makes sense, and the coarse colours are shown.
    """
    coarse = np.empty((*picture.alpha.shape, 8), np.float32)
    ends = np.empty((len(coarse), 2), np.int32)
    _pack(picture.color, picture.alpha, picture.from_photo, picture.shift, coarse, ends)
    _leave_out_tears(coarse, ends, np.float32(limit * limit))
    _continue(coarse, ends)
    return coarse, ends


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _pack(color, alpha, from_photo, shift, coarse, ends):
    for y in range(alpha.shape[0]):
        ends[y, 0], ends[y, 1] = alpha.shape[1], 0
        for x in range(alpha.shape[1]):
            p, a = coarse[y, x], alpha[y, x]
            p[R], p[G], p[B], p[A] = color[y, x, 0], color[y, x, 1], color[y, x, 2], a
            p[SHARE] = min(max(from_photo[y, x] / max(a, LEAST_SHOWN), ZERO), ONE)
            p[SX], p[SY] = shift[y, x, 0], shift[y, x, 1]
            p[SEEN] = ONE if a > LEAST_ALPHA and from_photo[y, x] > ZERO else ZERO
            if a > ZERO:
                ends[y, 0], ends[y, 1] = min(ends[y, 0], x), x + 1


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _leave_out_tears(coarse, ends, limit):
    """Takes the map from both px between which it changes by more than the root of `limit`."""
    height = len(coarse)
    for y in range(height):
        for x in range(ends[y, 0], ends[y, 1]):
            p = coarse[y, x]
            if p[SEEN] == ZERO:
                continue
            for k in range(2):  # to the right, and below
                i, j = min(y + k, height - 1), x + 1 - k
                if j < ends[y, 1] and coarse[i, j, SEEN] > ZERO:
                    dx, dy = coarse[i, j, SX] - p[SX], coarse[i, j, SY] - p[SY]
                    if dx * dx + dy * dy > limit:
                        p[SEEN], coarse[i, j, SEEN] = TWO, TWO
    for y in range(height):
        for x in range(ends[y, 0], ends[y, 1]):
            if coarse[y, x, SEEN] == TWO:
                coarse[y, x, SEEN], coarse[y, x, SHARE] = ZERO, ZERO


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _continue(coarse, ends):
    """Gives each pixel around the seen ones the mean map of its seen neighbours."""
    height, width = coarse.shape[:2]
    for round in range(ROUNDS):
        done = np.float32(1 + round)  # a pixel of this round is no neighbour in it
        for y in range(height):
            above, below = max(y - round - 1, 0), min(y + round + 2, height)
            start, end = ends[above:below, 0].min(), ends[above:below, 1].max()
            for x in range(max(start - round - 1, 0), min(end + round + 1, width)):
                if coarse[y, x, SEEN] > ZERO:
                    continue
                count, sx, sy = ZERO, ZERO, ZERO
                for i in range(max(y - 1, 0), min(y + 2, height)):
                    for j in range(max(x - 1, 0), min(x + 2, width)):
                        if ZERO < coarse[i, j, SEEN] <= done:
                            count += ONE
                            sx += coarse[i, j, SX]
                            sy += coarse[i, j, SY]
                if count > ZERO:
                    coarse[y, x, SX], coarse[y, x, SY] = sx / count, sy / count
                    coarse[y, x, SEEN] = done + ONE


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=EXACT)
def _sharpen(first, last, own, fine, rgba, invented, is_marked):
    """Rows first..last of `rgba` and `invented`, all 0 before."""
    coarse, ends, factor = own.numbers, own.ends, fine.factor
    rows, numbers = coarse.shape
    row = np.empty(numbers, np.float32)
    for y in range(first, last):
        v = (np.float32(y) + HALF) / factor - HALF
        i = min(max(int(math.floor(v)), 0), rows - 1)
        t, below = min(max(v - np.float32(i), ZERO), ONE), min(i + 1, rows - 1)
        start, end = min(ends[i, 0], ends[below, 0]), max(ends[i, 1], ends[below, 1])
        for c in range(8 * max(start - 2, 0), min(8 * (end + 2), numbers)):
            row[c] = coarse[i, c] + t * (coarse[below, c] - coarse[i, c])
        start, end = int(factor) * (start - 1), int(factor) * (end + 1)
        _sharpen_row(
            max(start, 0), min(end, rgba.shape[1]), row, own.pixels, own.shares, fine,
            fine.top + np.float32(y) * fine.step, fine.texels, rgba[y],
            invented[y if is_marked else 0], is_marked,
        )  # fmt: skip


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _sharpen_row(
    start, end, row, pixels, shares, fine, here, texels, to, invented, is_marked
):  # fmt: skip
    """The px start..end of a row of the view; `row`: the coarse px there, `here`: its texel's row.

    Between two coarse px inside the object the photo alone is seen, unless it is transparent.
    """
    left, step, scale, most = fine.left, fine.step, fine.scale, np.uint64(len(row) - 8)
    down, across, first_texel = fine.shape
    stride, first = np.uint64(4 * across), np.uint64(4 * first_texel)
    right, bottom = np.float32(across - 1), np.float32(down - 1)
    wide, half = np.int64(fine.factor), np.int64(fine.factor) // 2
    stop = half if start < half else start + (half - start) % wide
    while start < end:
        stop = min(stop, end)
        one = pixels[start]
        two = min(one + EIGHT, most)
        count, x0 = np.uint64(stop - start), np.uint64(start)
        start, stop = stop, stop + wide
        a, b = row[one + A_ON], row[two + A_ON]
        if a <= ZERO and b <= ZERO:
            continue
        sx, sy = row[one + SX_ON], row[one + SY_ON]
        dx, dy = scale * (row[two + SX_ON] - sx), scale * (row[two + SY_ON] - sy)
        u0, v0 = left + scale * sx, here + scale * sy
        is_inner = (min(a, b) > INNER) & (min(row[one + SHARE_ON], row[two + SHARE_ON]) > WHOLE)
        for k in range(count):
            x = x0 + k
            t = shares[x]
            u, v = u0 + np.float32(np.int32(x)) * step + t * dx, v0 + t * dy
            is_there = (u >= ZERO) & (u < right) & (v >= ZERO) & (v < bottom)
            column, line = np.int32(u), np.int32(v)
            at = first + stride * np.uint64(np.uint32(line)) + FOUR * np.uint64(np.uint32(column))
            share_x, share_y = u - np.float32(column), v - np.float32(line)
            if is_inner and is_there:
                texel = four_texels(texels, at, stride, share_x, share_y)
                if texel[3] >= ONE:
                    to[x] = bytes_over((texel[0], texel[1], texel[2], ONE), ONE, texel, ZERO)
                    continue
            r, g, b, a, share, _, _, _ = between(row, one, two, t)
            if is_marked:
                invented[x] = np.uint8(np.int32((ONE - share) * a * FULL + HALF))
            texel, alpha, rest = (ZERO, ZERO, ZERO, ZERO), ZERO, ONE - share
            if share > ZERO and is_there:
                texel = four_texels(texels, at, stride, share_x, share_y)
                alpha = texel[3] * min(TWO * a, ONE) * share
            if a > INNER:  # no edge of the cut-out: what is not found there has its coarse colour
                rest = ONE - alpha
            over = texel[0], texel[1], texel[2], ONE
            to[x] = bytes_over(over, alpha, (r, g, b, a), rest)
