"""Looking up the photo, compiled: `texture.sample_texture` for one point at a time."""

from __future__ import annotations

import math

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import EXACT
from .intrinsics import sixteen_texels
from .rules import HALF, ONE, TWO, ZERO

C15, C25 = np.float32(1.5), np.float32(2.5)
ONE_ON, TWO_ON, THREE_ON = np.uint64(1), np.uint64(2), np.uint64(3)
# log2(1 + t) / t, 0 <= t <= 1: interpolated at Chebyshev points, right to 5e-5
L0, L1, L2, L3, L4 = (
    np.float32(v) for v in (1.442603894, -0.716714663, 0.440599033, -0.225103025, 0.058664940)
)


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def sample(texels, shapes, u, v, magnified):
    """Straight colour and alpha (4 x f32) at crop px (u, v), for so many px per view px.

    `texels` (4 T,) f32, `shapes` (levels, 3) see `TextureLevels`.
    """
    if magnified <= ONE:
        return _cubic(texels, shapes, u, v)
    last = len(shapes) - 1
    lod = min(math.log2(magnified), float(last))
    lower = int(lod)
    mix = np.float32(lod - lower)
    a = _cubic(texels, shapes, u, v) if lower == 0 else _linear(texels, shapes, lower, u, v)
    if mix == ZERO:
        return a
    b = _linear(texels, shapes, lower + 1, u, v)
    return (
        a[0] + mix * (b[0] - a[0]),
        a[1] + mix * (b[1] - a[1]),
        a[2] + mix * (b[2] - a[2]),
        a[3] + mix * (b[3] - a[3]),
    )


@numba.njit(inline="always", error_model="numpy", fastmath=EXACT)
def add_halved(r, texels, shapes, x, y, magnified):
    """The full-size value `r` mixed with the halved level for 1 < `magnified` < 2.

    At the pixel index (x, y), at least one pixel inside the crop.
    """
    t = magnified - ONE
    mix = t * (L0 + t * (L1 + t * (L2 + t * (L3 + t * L4))))
    width = shapes[1, 1]
    x, y = 0.5 * x - 0.25, 0.5 * y - 0.25
    column, row = int(x), int(y)
    s, t = np.float32(x - column), np.float32(y - row)
    a = np.uint64(4 * (shapes[1, 2] + row * width + column))
    b = a + np.uint64(4 * width)
    w3 = mix * s * t
    w1, w2 = mix * s - w3, mix * t - w3
    w0, rest = mix - mix * s - w2, ONE - mix
    c, d = a + np.uint64(4), b + np.uint64(4)
    return (
        rest * r[0] + w0 * texels[a] + w1 * texels[c] + w2 * texels[b] + w3 * texels[d],
        rest * r[1] + w0 * texels[a + ONE_ON] + w1 * texels[c + ONE_ON]
        + w2 * texels[b + ONE_ON] + w3 * texels[d + ONE_ON],
        rest * r[2] + w0 * texels[a + TWO_ON] + w1 * texels[c + TWO_ON]
        + w2 * texels[b + TWO_ON] + w3 * texels[d + TWO_ON],
        rest * r[3] + w0 * texels[a + THREE_ON] + w1 * texels[c + THREE_ON]
        + w2 * texels[b + THREE_ON] + w3 * texels[d + THREE_ON],
    )  # fmt: skip


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _cubic(texels, shapes, u, v):
    """The full-size level, Catmull-Rom: gives a pixel's own value at its centre."""
    height, width = shapes[0, 0], shapes[0, 1]
    j, i = math.floor(u - 0.5), math.floor(v - 0.5)
    wx, wy = _cubic_weights(np.float32(u - 0.5 - j)), _cubic_weights(np.float32(v - 0.5 - i))
    column, row = int(j), int(i)
    if 1 <= column < width - 2 and 1 <= row < height - 2:
        first = np.uint64(4 * ((row - 1) * width + column - 1))
        return sixteen_texels(texels, first, np.uint64(4 * width), wx, wy)
    r = (ZERO, ZERO, ZERO, ZERO)
    for a in range(4):
        y = row + a - 1
        for b in range(4):
            r = _add(r, texels, 0, height, width, y, column + b - 1, wy[a] * wx[b])
    return _clipped(r)


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _clipped(r):
    return (
        min(max(r[0], ZERO), ONE), min(max(r[1], ZERO), ONE),
        min(max(r[2], ZERO), ONE), min(max(r[3], ZERO), ONE),
    )  # fmt: skip


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _add(r, texels, first, height, width, y, x, w):
    """r + w times a texel of a level; outside it that at the border, without alpha."""
    at = 4 * (first + min(max(y, 0), height - 1) * width + min(max(x, 0), width - 1))
    inside = w if 0 <= y < height and 0 <= x < width else ZERO
    return (
        r[0] + w * texels[at], r[1] + w * texels[at + 1],
        r[2] + w * texels[at + 2], r[3] + inside * texels[at + 3],
    )  # fmt: skip


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _linear(texels, shapes, level, u, v):
    """A halved level, bilinear."""
    height, width, first = shapes[level, 0], shapes[level, 1], shapes[level, 2]
    scale = 1.0 / (1 << level)
    x, y = u * scale - 0.5, v * scale - 0.5
    j, i = math.floor(x), math.floor(y)
    s, t = np.float32(x - j), np.float32(y - i)
    column, row = int(j), int(i)
    r = (ZERO, ZERO, ZERO, ZERO)
    for a in range(2):
        w = t if a else ONE - t
        for b in range(2):
            share = w * (s if b else ONE - s)
            r = _add(r, texels, first, height, width, row + a, column + b, share)
    return r


@numba.njit(nogil=True, error_model="numpy", fastmath=EXACT)
def _cubic_weights(t):
    return (
        ((-HALF * t + ONE) * t - HALF) * t,
        (C15 * t - C25) * t * t + ONE,
        ((-C15 * t + TWO) * t + HALF) * t,
        (HALF * t - HALF) * t * t,
    )
