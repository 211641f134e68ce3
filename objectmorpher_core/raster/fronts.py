"""Where a layer begins: the sample nearest to the camera, pixel by pixel; step 4 of `reference`."""

from __future__ import annotations

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST
from . import columns as p
from . import tile_memory as m
from .bell import bell
from .intrinsics import lesser
from .singles import ONE, ZERO

FAR = np.float32(3e38)  # a depth that nothing has


@numba.njit(nogil=True, error_model="numpy", fastmath=FAST)
def first_front(s, spans, g, dx0, dy0):
    """The nearest sample of each pixel so far."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy, limit = g[p.QXX], g[p.TILT], g[p.RYY], g[p.FRONT]
    is_photo = ONE if g[p.PHOTO] > ZERO else ZERO
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
    """The same among what the layers before have left, m.SHARE."""
    z, zx, zy, sx, sy = g[p.Z], g[p.ZX], g[p.ZY], g[p.SX], g[p.SY]
    axx, axy, ayx, ayy = g[p.AXX], g[p.AXY], g[p.AYX], g[p.AYY]
    qxx, tilt, ryy = g[p.QXX], g[p.TILT], g[p.RYY]
    is_photo = ONE if g[p.PHOTO] > ZERO else ZERO
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
