"""Limits on the stretch of the Jacobians F of a motion."""

from __future__ import annotations

import math

from ..base.kernel_files import numba
from ..base.threads import FAST

# Five times its length a Gaussian still looks like the surface it lies on; what is stretched
# farther comes from two neighbours that went different ways, and would be drawn as a needle
# across the picture. A fifth is the inverse: below it a Gaussian is a speck that flickers.
LEAST_STRETCH, MOST_STRETCH = 0.2, 5.0
SWEEPS = 30  # of the Jacobi iteration, at most; six are enough
ORTHOGONAL = 1e-15  # cosine of two columns that need no further turn
VANISHED = 1e-9  # x largest stretch: a direction so much shorter has no axis of its own


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def margin(row0, row1, row2, least, most):
    """> 0 if the stretches of the matrix of these rows are in [least, most] for certain.

    With s1 >= s2 >= s3: s1^2 <= |F|^2, and s3 = det F / (s1 s2) >= 2 det F / |F|^2.
    """
    x, y, z = row0
    u, v, w = row1
    a, b, c = row2
    square = x * x + y * y + z * z + u * u + v * v + w * w + a * a + b * b + c * c
    det = x * (v * c - w * b) - y * (u * c - w * a) + z * (u * b - v * a)
    return min(most * most - square, 2.0 * det - least * square)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def limit_row(f, least, most, left, right):
    """Brings the stretches (singular values) of `f` (3, 3) into [least, most], in place.

    The rotations on both sides of them stay. A mirror image becomes the nearest matrix that is
    none. `left` and `right` (3, 3) are room to work in.
    """
    s0, s1, s2 = _decompose(f, left, right)
    if least <= s2 and s0 <= most:
        return  # as it was, to the last digit
    s0, s1, s2 = min(max(s0, least), most), min(max(s1, least), most), min(max(s2, least), most)
    for a in range(3):
        for b in range(3):
            first_two = s0 * left[a, 0] * right[b, 0] + s1 * left[a, 1] * right[b, 1]
            f[a, b] = first_two + s2 * left[a, 2] * right[b, 2]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _decompose(f, left, right):
    """`f` (3, 3) = left diag(s) right^T with rotations left and right; s0 >= s1 >= |s2|.

    One-sided Jacobi iteration: the columns of f V are turned in pairs until they are orthogonal
    to each other (Hestenes 1958). Both factors are rotations, so s2 has the determinant's sign.
    """
    for a in range(3):
        for b in range(3):
            left[a, b] = f[a, b]
            right[a, b] = 1.0 if a == b else 0.0
    for _ in range(SWEEPS):
        turned = _turn_pair(left, right, 0, 1)
        turned = _turn_pair(left, right, 0, 2) or turned
        turned = _turn_pair(left, right, 1, 2) or turned
        if not turned:
            break
    for j, k in ((0, 1), (1, 2), (0, 1)):
        if _length(left, j) < _length(left, k):
            for a in range(3):  # one of the two changes its sign: V stays a rotation
                left[a, j], left[a, k] = left[a, k], -left[a, j]
                right[a, j], right[a, k] = right[a, k], -right[a, j]
    s0, s1 = _length(left, 0), _length(left, 1)
    _complete(left, s0, s1)
    s2 = 0.0  # the third stretch is measured along the third axis: signed
    for a in range(3):
        for b in range(3):
            s2 += left[a, 2] * f[a, b] * right[b, 2]
    return s0, s1, s2


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _turn_pair(columns, turns, j, k):
    """Turns columns j and k of both until those of `columns` are orthogonal; whether it had to."""
    alpha = beta = gamma = 0.0
    for a in range(3):
        alpha += columns[a, j] * columns[a, j]
        beta += columns[a, k] * columns[a, k]
        gamma += columns[a, j] * columns[a, k]
    if abs(gamma) <= ORTHOGONAL * math.sqrt(alpha * beta):
        return False
    zeta = (beta - alpha) / (2.0 * gamma)
    t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
    c = 1.0 / math.sqrt(1.0 + t * t)
    s = c * t
    for a in range(3):
        x, y = columns[a, j], columns[a, k]
        columns[a, j], columns[a, k] = c * x - s * y, s * x + c * y
        x, y = turns[a, j], turns[a, k]
        turns[a, j], turns[a, k] = c * x - s * y, s * x + c * y
    return True


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _length(columns, k):
    return math.sqrt(columns[0, k] ** 2 + columns[1, k] ** 2 + columns[2, k] ** 2)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _complete(u, s0, s1):
    """Makes a rotation of the columns `u`, which are orthogonal and s0 >= s1 >= ... long.

    A direction that has vanished is replaced by any that is orthogonal to the longer ones.
    """
    for a in range(3):
        u[a, 0] = u[a, 0] / s0 if s0 > 0.0 else (1.0 if a == 0 else 0.0)
    if s1 <= VANISHED * s0:
        least = 0
        for a in range(1, 3):
            least = a if abs(u[a, 0]) < abs(u[least, 0]) else least
        for a in range(3):
            u[a, 1] = (1.0 if a == least else 0.0) - u[least, 0] * u[a, 0]
        s1 = _length(u, 1)
    for a in range(3):
        u[a, 1] /= s1
    u[0, 2] = u[1, 0] * u[2, 1] - u[2, 0] * u[1, 1]
    u[1, 2] = u[2, 0] * u[0, 1] - u[0, 0] * u[2, 1]
    u[2, 2] = u[0, 0] * u[1, 1] - u[1, 0] * u[0, 1]
