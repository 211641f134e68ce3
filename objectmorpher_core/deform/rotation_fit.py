"""Nearest rotations to many 3x3 matrices from a warm start, compiled: Newton's method on rotations.

A step of 32 fits is one straight loop over arrays of their components, so that four of them are
computed at once.
"""

from __future__ import annotations

import numpy as np

from ..base.kernel_files import numba
from ..base.threads import FAST

BLOCK = 32  # fits that are made together
STEPS = 40  # at most; one or two from a warm start
TOLERANCE = 1e-6  # rad^2, of the last turns together; what is left is the turn's square, 1e-6 rad
DAMPING = 1e-9  # x the matrix's size: a turn that changes nothing is not made
AFAR = 0.02  # x the matrix's size: what keeps the system positive definite away from the maximum
LONGEST = 1.0  # rad, of one turn


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def fit_rotations(a, r):
    """Improve r (9, N) to the rotations that maximise the traces of r^T a, `a` (9, N).

    A product of rotations never becomes a mirror image. A thin bar's twist, which its matrix
    hardly tells, is found as quickly as its axis. From afar the second derivative is pushed to
    be positive definite, so that each turn still goes uphill.
    """
    f = np.empty(18 * BLOCK)
    for first in range(0, a.shape[1], BLOCK):
        count = min(BLOCK, a.shape[1] - first)
        for k in range(9):
            for i in range(BLOCK):  # what is too many repeats the last
                j = first + min(i, count - 1)
                f[BLOCK * k + i], f[BLOCK * (9 + k) + i] = a[k, j], r[k, j]
        for _ in range(STEPS):
            if _newton_step(f) < TOLERANCE:
                break
        for k in range(9):
            for i in range(count):
                r[k, first + i] = f[BLOCK * (9 + k) + i]
    _orthonormalise(r)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _newton_step(f):
    """Turns each r of a block once; the sum of the turns' squared lengths, rad^2.

    The matrices' 9 x 32 numbers, then the rotations', are in one flat array at fixed distances:
    only so the compiler sees that they do not overlap, and computes four at once.
    """
    total = 0.0
    for i in range(BLOCK):
        a00, a01, a02 = f[i], f[32 + i], f[64 + i]
        a10, a11, a12 = f[96 + i], f[128 + i], f[160 + i]
        a20, a21, a22 = f[192 + i], f[224 + i], f[256 + i]
        r00, r01, r02 = f[288 + i], f[320 + i], f[352 + i]
        r10, r11, r12 = f[384 + i], f[416 + i], f[448 + i]
        r20, r21, r22 = f[480 + i], f[512 + i], f[544 + i]
        # B = a r^T; the torque sum_k r_k x a_k over the columns is twice B's axial vector
        b00, b01 = a00 * r00 + a01 * r01 + a02 * r02, a00 * r10 + a01 * r11 + a02 * r12
        b02, b10 = a00 * r20 + a01 * r21 + a02 * r22, a10 * r00 + a11 * r01 + a12 * r02
        b11, b12 = a10 * r10 + a11 * r11 + a12 * r12, a10 * r20 + a11 * r21 + a12 * r22
        b20, b21 = a20 * r00 + a21 * r01 + a22 * r02, a20 * r10 + a21 * r11 + a22 * r12
        b22 = a20 * r20 + a21 * r21 + a22 * r22
        tx, ty, tz = b21 - b12, b02 - b20, b10 - b01
        size = (
            abs(a00) + abs(a01) + abs(a02) + abs(a10) + abs(a11) + abs(a12)
            + abs(a20) + abs(a21) + abs(a22) + 1e-300
        )  # fmt: skip
        # minus the second derivative: tr(B) 1 - sym(B), positive definite near the maximum
        xx, yy, zz = b11 + b22, b00 + b22, b00 + b11
        xy, xz, yz = -0.5 * (b01 + b10), -0.5 * (b02 + b20), -0.5 * (b12 + b21)
        least = min(
            min(xx - abs(xy) - abs(xz), yy - abs(xy) - abs(yz)), zz - abs(xz) - abs(yz)
        )  # Gershgorin's bound on its eigenvalues
        det = xx * (yy * zz - yz * yz) - xy * (xy * zz - xz * yz) + xz * (xy * yz - xz * yy)
        push = DAMPING * size
        is_definite = (xx > 0.0) & (xx * yy > xy * xy) & (det > push * xx * yy)
        push = push if is_definite | (least > push) else AFAR * size - least
        xx, yy, zz = xx + push, yy + push, zz + push
        c0, c1, c2 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        d1, d2, d3 = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
        scale = 1.0 / (xx * c0 + xy * c1 + xz * c2 + 1e-300)
        ox = scale * (c0 * tx + c1 * ty + c2 * tz)
        oy = scale * (c1 * tx + d1 * ty + d2 * tz)
        oz = scale * (c2 * tx + d2 * ty + d3 * tz)
        square = ox * ox + oy * oy + oz * oz
        total += square
        scale = 0.5 * min(1.0, LONGEST / np.sqrt(square + 1e-300))
        # The turn whose Gibbs vector, axis x tan(angle / 2), is g: for each column v of r
        # v + 2 / (1 + g.g) (g x v + g x (g x v)). No sine, and 0 turns nothing.
        gx, gy, gz = scale * ox, scale * oy, scale * oz
        share = 2.0 / (1.0 + gx * gx + gy * gy + gz * gz)
        u, v, w = gy * r20 - gz * r10, gz * r00 - gx * r20, gx * r10 - gy * r00
        f[288 + i] = r00 + share * (u + gy * w - gz * v)
        f[384 + i] = r10 + share * (v + gz * u - gx * w)
        f[480 + i] = r20 + share * (w + gx * v - gy * u)
        u, v, w = gy * r21 - gz * r11, gz * r01 - gx * r21, gx * r11 - gy * r01
        f[320 + i] = r01 + share * (u + gy * w - gz * v)
        f[416 + i] = r11 + share * (v + gz * u - gx * w)
        f[512 + i] = r21 + share * (w + gx * v - gy * u)
        u, v, w = gy * r22 - gz * r12, gz * r02 - gx * r22, gx * r12 - gy * r02
        f[352 + i] = r02 + share * (u + gy * w - gz * v)
        f[448 + i] = r12 + share * (v + gz * u - gx * w)
        f[544 + i] = r22 + share * (w + gx * v - gy * u)
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _orthonormalise(r):
    """Gram-Schmidt on the columns: takes away the rounding of a long chain of turns."""
    for i in range(r.shape[1]):
        a0, a1, a2 = r[0, i], r[3, i], r[6, i]
        b0, b1, b2 = r[1, i], r[4, i], r[7, i]
        scale = 1.0 / np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        a0, a1, a2 = a0 * scale, a1 * scale, a2 * scale
        dot = a0 * b0 + a1 * b1 + a2 * b2
        b0, b1, b2 = b0 - dot * a0, b1 - dot * a1, b2 - dot * a2
        scale = 1.0 / np.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
        b0, b1, b2 = b0 * scale, b1 * scale, b2 * scale
        r[0, i], r[3, i], r[6, i] = a0, a1, a2
        r[1, i], r[4, i], r[7, i] = b0, b1, b2
        r[2, i], r[5, i], r[8, i] = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
