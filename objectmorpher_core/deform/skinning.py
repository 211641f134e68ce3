"""Skinning of surface points: blended dual quaternions, and the motion's Jacobian.

The paper (Eq. 5) blends the displaced points themselves; where control points turn against each
other, that mean lies inside the body, and a twisted limb grows thin. Blending the rigid motions
as dual quaternions (Kavan et al. 2008) keeps its volume. Control point j with weight w_j moves
the rest point x by u_j = R_j (x - p_j) + p'_j - x and turns it by the unit quaternion q_j:

    b = sum_j w_j q_j,  P = sum_j w_j u_j q_j (u_j as a pure quaternion),  n = |b|^2
    x' = x + vec(P b*) / n = x + sum_j A_j u_j
    A_j = w_j (s_j I - [v_j]x) / n  with  (s_j, v_j) = q_j b*,  so that sum_j A_j = I
    F = R_b + sum_j g_j (grad w_j)^T
    g_j = (vec(u_j q_j b* + P q_j*) - 2 (b . q_j) (x' - x)) / n

with R_b the turn of b / |b|. With fixed weights x' is the motion of b, whose derivative is R_b;
g_j is the derivative by w_j. The kernel works with y = x - centre, and without the displacement
that all control points share, which comes out of the blend as it went in. In

    u_j q_j = m_j + (0, 2 vec(q_j) x y),  m_j = ((R_j - I) (centre - p_j) + p'_j - p_j) q_j

only the last term knows the point, and it is linear in q_j: the sums over j are of q_j and m_j,
times the weights and their gradients. At rest each term is 0, however far the origin is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import F64, frozen
from ..base.kernel_files import numba
from ..base.rotations import quats_from_matrices
from ..base.threads import FAST, LEAST_ROWS, in_threads
from .binding import LANES, NEIGHBOURS, Binding
from .graph import ControlGraph
from .jacobians import LEAST_STRETCH, MOST_STRETCH, limit_row, margin

# The paper's own motion of the Gaussians: Eq. 5 as printed, for comparison with `skinning`.
#
# Line 1 blends the displaced points linearly. Lines 2 and 3 turn a Gaussian by the mean of its
# control points' quaternions and scale it by the mean of their stretches.


def skin_faithful(
    points: np.ndarray, binding: Binding, motion: Motion, graph: ControlGraph
) -> Skinned:
    """Rest points (N, 3) under paper Eq. 5; `linear` is a rotation times one scale.

    The signs of the quaternions are aligned before the mean. A control point's scale is the mean
    ratio of its links' lengths, posed to rest.
    """
    x = frozen(np.atleast_2d(points), np.float64)
    moved, linear = np.empty(x.shape), np.empty((len(x), 3, 3))
    inputs: tuple[Any, ...] = (
        x, frozen(binding.control_points), frozen(binding.weights), _nodes(motion, graph),
        moved, linear,
    )  # fmt: skip
    in_threads(lambda first, last: _skin_faithful(first, last, *inputs), len(x), least=LEAST_ROWS)
    return Skinned(moved, linear)


def _nodes(motion: Motion, graph: ControlGraph) -> F64:
    """(M, 20) of each control point R - I, p' - p, p, its quaternion and its stretch."""
    count = len(motion.points)
    turns = (motion.rotations - np.eye(3)).reshape(count, 9)
    rest = np.asarray(motion.rest, np.float64)
    quats = quats_from_matrices(motion.rotations)
    stretch = stretches(motion, graph)[:, None]
    return frozen(np.hstack([turns, motion.points - rest, rest, quats, stretch]))


def stretches(motion: Motion, graph: ControlGraph) -> F64:
    """(M,) mean ratio of the lengths of each control point's links, posed to rest; 1 without."""
    weights = graph.weights
    result = np.empty(len(motion.points))
    _stretch(
        frozen(weights.indptr, np.int32), frozen(weights.indices, np.int32),
        frozen(motion.rest, np.float64), frozen(motion.points, np.float64), result,
    )  # fmt: skip
    return result


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _stretch(starts, ends, rest, posed, out):
    """Links between coincident control points have no ratio and do not count."""
    for i in range(len(rest)):
        total, count = 0.0, 0
        for e in range(starts[i], starts[i + 1]):
            j = ends[e]
            before = after = 0.0
            for a in range(3):
                before += (rest[j, a] - rest[i, a]) ** 2
                after += (posed[j, a] - posed[i, a]) ** 2
            if before > 0.0:
                total += np.sqrt(after / before)
                count += 1
        out[i] = total / count if count else 1.0


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _skin_faithful(first, last, x, control_points, weights, nodes, moved, linear):
    """Rows first..last of `Skinned`."""
    for i in range(first, last):
        x0, x1, x2 = x[i, 0], x[i, 1], x[i, 2]
        d0 = d1 = d2 = q0 = q1 = q2 = q3 = scale = 0.0
        for c in range(control_points.shape[1]):
            j, w = control_points[i, c], weights[i, c]
            a, b, d = x0 - nodes[j, 12], x1 - nodes[j, 13], x2 - nodes[j, 14]
            # displacements, not positions: exact at rest, however far the origin is
            d0 += w * (nodes[j, 0] * a + nodes[j, 1] * b + nodes[j, 2] * d + nodes[j, 9])
            d1 += w * (nodes[j, 3] * a + nodes[j, 4] * b + nodes[j, 5] * d + nodes[j, 10])
            d2 += w * (nodes[j, 6] * a + nodes[j, 7] * b + nodes[j, 8] * d + nodes[j, 11])
            scale += w * nodes[j, 19]
            n = control_points[i, 0]
            u0, u1, u2, u3 = nodes[j, 15], nodes[j, 16], nodes[j, 17], nodes[j, 18]
            dot = u0 * nodes[n, 15] + u1 * nodes[n, 16] + u2 * nodes[n, 17] + u3 * nodes[n, 18]
            w = w if dot >= 0.0 else -w
            q0, q1, q2, q3 = q0 + w * u0, q1 + w * u1, q2 + w * u2, q3 + w * u3
        moved[i, 0], moved[i, 1], moved[i, 2] = x0 + d0, x1 + d1, x2 + d2
        s = 2.0 * scale / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        linear[i, 0, 0] = scale - s * (q2 * q2 + q3 * q3)
        linear[i, 0, 1] = s * (q1 * q2 - q0 * q3)
        linear[i, 0, 2] = s * (q1 * q3 + q0 * q2)
        linear[i, 1, 0] = s * (q1 * q2 + q0 * q3)
        linear[i, 1, 1] = scale - s * (q1 * q1 + q3 * q3)
        linear[i, 1, 2] = s * (q2 * q3 - q0 * q1)
        linear[i, 2, 0] = s * (q1 * q3 - q0 * q2)
        linear[i, 2, 1] = s * (q2 * q3 + q0 * q1)
        linear[i, 2, 2] = scale - s * (q1 * q1 + q2 * q2)


ZERO = (0.0, 0.0, 0.0, 0.0)

# A block of points in the kernel's working memory: a row a number, a column a point.
NODES = 0  # rows of q and m of each control point
SHARES = NODES + 8 * NEIGHBOURS  # of its weight and the weight's gradient
PLACE = SHARES + 4 * NEIGHBOURS  # of 2 y
SHIFT = PLACE + 3  # of x' - x
LINEAR = SHIFT + 3  # of F
MARGIN = LINEAR + 9  # see `jacobians.margin`
ROWS = MARGIN + 1


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of the control points."""

    rest: np.ndarray  # (M, 3) object frame
    points: F64  # (M, 3) posed
    rotations: F64  # (M, 3, 3)


@dataclass(frozen=True, eq=False)
class Skinned:
    """Points after the deformation."""

    points: F64  # (N, 3)
    linear: F64  # (N, 3, 3) Jacobian of the motion there: F


class SkinArrays(NamedTuple):
    """Points with what moves them, as kernels take them."""

    points: F64  # (N, 3) at rest, object frame
    control_points: np.ndarray  # (N, neighbours) u32
    shares: F64  # see `Binding.shares`
    nodes: F64  # (M, 8), see `nodes_of`
    frame: F64  # (2, 3), likewise


@dataclass(frozen=True, eq=False)
class Skin:
    """Points with what moves them: a motion that has not been carried out yet."""

    points: F64  # (N, 3) at rest, object frame
    binding: Binding
    motion: Motion

    def arrays(self) -> SkinArrays:
        """Return the input of `skin_block`."""
        points = frozen(np.atleast_2d(self.points), np.float64)
        control_points = frozen(self.binding.control_points.view(np.uint32))
        return SkinArrays(points, control_points, self.binding.shares, *nodes_of(self.motion))

    def run(self) -> Skinned:
        """The points after the motion, and its Jacobian."""
        count = len(np.atleast_2d(self.points))
        moved, linear = np.empty((count, 3)), np.empty((count, 3, 3))
        arrays = self.arrays()
        in_threads(
            lambda first, last: _skin(first, last, arrays, moved, linear),
            len(self.binding.shares), least=LEAST_ROWS // LANES,
        )  # fmt: skip
        return Skinned(moved, linear)


def skin(points: np.ndarray, binding: Binding, motion: Motion) -> Skinned:
    """Moves rest points (N, 3) with their control points.

    `linear` is the exact Jacobian of the motion, the change of the weights included, so that a
    stretched limb stretches its Gaussians and leaves no gaps. Only where the weights change
    steeply (`binding`), and where it exceeds the limits of `jacobians`, it is less.
    """
    return Skin(points, binding, motion).run()


def coupling(binding: Binding, rotations: F64) -> F64:
    """A (N, K, 3, 3): how the skinned points depend on their control points.

    x' = x + sum_j A_j u_j with u_j = R_j (x - p_j) + p'_j - x: linear in p' for fixed
    `rotations` (M, 3, 3), and sum_j A_j = I.
    """
    out = np.empty((*binding.weights.shape, 3, 3))
    _coupling(frozen(binding.control_points), frozen(binding.weights), frozen(rotations), out)
    return out


def nodes_of(motion: Motion) -> tuple[F64, F64]:
    """q_j and m_j of each control point (M, 8), and (2, 3): the centre, the mean displacement."""
    nodes, frame = np.empty((len(motion.points), 8)), np.empty((2, 3))
    _fill_nodes(
        frozen(motion.rest, np.float64), frozen(motion.points, np.float64),
        frozen(motion.rotations, np.float64), nodes, frame,
    )  # fmt: skip
    return frozen(nodes), frozen(frame)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _fill_nodes(rest, points, rotations, nodes, frame):
    count = len(rest)
    for a in range(3):
        centre = drift = 0.0
        for j in range(count):
            centre += rest[j, a]
            drift += points[j, a] - rest[j, a]
        frame[0, a], frame[1, a] = centre / count, drift / count
    shift = np.empty(3)
    for j in range(count):
        for a in range(3):  # how j moves the centre, beyond the mean displacement
            shift[a] = points[j, a] - rest[j, a] - frame[1, a]
            for b in range(3):
                turned = rotations[j, a, b] - (1.0 if a == b else 0.0)
                shift[a] += turned * (frame[0, b] - rest[j, b])
        q = _quat(rotations, j)
        m = _moment(shift[0], shift[1], shift[2], q)
        for a in range(4):
            nodes[j, a], nodes[j, 4 + a] = q[a], m[a]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _quat(r, j):
    """Unit quaternion wxyz of rotation j, by its largest component (Shepperd 1978)."""
    xx, yy, zz = r[j, 0, 0], r[j, 1, 1], r[j, 2, 2]
    a, b, c = r[j, 2, 1] - r[j, 1, 2], r[j, 0, 2] - r[j, 2, 0], r[j, 1, 0] - r[j, 0, 1]
    xy, xz, yz = r[j, 0, 1] + r[j, 1, 0], r[j, 0, 2] + r[j, 2, 0], r[j, 1, 2] + r[j, 2, 1]
    if xx + yy + zz > 0.0:
        q = (1.0 + xx + yy + zz, a, b, c)
    elif xx >= yy and xx >= zz:
        q = (a, 1.0 + xx - yy - zz, xy, xz)
    elif yy >= zz:
        q = (b, xy, 1.0 - xx + yy - zz, yz)
    else:
        q = (c, xz, yz, 1.0 - xx - yy + zz)
    scale = 1.0 / np.sqrt(_dot(q, q))
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _skin(first, last, skin, moved, linear):
    """Blocks first..last of the rows of `Skinned`."""
    s = np.ones(ROWS * LANES)
    left, right, one = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for block in range(first, last):
        start = block * LANES
        count = min(LANES, len(skin.points) - start)
        skin_block(block, count, skin, s, left, right, one)
        for lane in range(count):
            i, k = np.uint64(start + lane), np.uint64(lane)  # unsigned: no look at their signs
            for a in range(3):
                moved[i, a] = skin.points[i, a] + (
                    skin.frame[1, a] + s[np.uint64((SHIFT + a) * LANES) + k]
                )
                for b in range(3):
                    linear[i, a, b] = s[np.uint64((LINEAR + 3 * a + b) * LANES) + k]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def skin_block(block, count, skin, s, left, right, one):
    """Fills the rows SHIFT (without skin.frame[1]) and LINEAR of `s` for `count` points.

    `left`, `right`, `one` (3, 3) are room to work in.
    """
    start = block * LANES
    for m in range(4 * NEIGHBOURS * LANES):
        s[SHARES * LANES + m] = skin.shares[block, m]
    for lane in range(count):
        i, k = np.uint64(start + lane), np.uint64(lane)  # unsigned: no look at their signs
        for c in range(NEIGHBOURS):
            j = np.uint64(skin.control_points[i, c])
            for a in range(8):
                s[np.uint64((NODES + 8 * c + a) * LANES) + k] = skin.nodes[j, a]
        for a in range(3):
            s[np.uint64((PLACE + a) * LANES) + k] = 2.0 * (skin.points[i, a] - skin.frame[0, a])
    _blend(s)
    for k in range(count):
        if s[MARGIN * LANES + k] <= 0.0:
            for m in range(9):
                one[m // 3, m % 3] = s[(LINEAR + m) * LANES + k]
            limit_row(one, LEAST_STRETCH, MOST_STRETCH, left, right)
            for m in range(9):
                s[(LINEAR + m) * LANES + k] = one[m // 3, m % 3]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _blend(s):
    """x' - x and F of a block of points, see the top of this file.

    The loop is straight and touches one array only, so that it is compiled to vector
    instructions, four points at a time: a third of the time. That is why its parts are called
    once for each of the four control points, and not in a loop.

    |b| >= w of the nearest >= 1 / K, for all signs agree with its own: nothing divides by 0.
    """
    for k in range(LANES):
        nearest = _four(s, NODES, k)
        sums = (ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)
        sums = _accumulate(s, 0, k, nearest, sums)
        sums = _accumulate(s, 1, k, nearest, sums)
        sums = _accumulate(s, 2, k, nearest, sums)
        sums = _accumulate(s, 3, k, nearest, sums)
        b, b0, b1, b2, p, p0, p1, p2 = sums
        y = s[PLACE * LANES + k], s[(PLACE + 1) * LANES + k], s[(PLACE + 2) * LANES + k]
        p, p0, p1, p2 = _placed(p, b, y), _placed(p0, b0, y), _placed(p1, b1, y), _placed(p2, b2, y)
        scale = 1.0 / _dot(b, b)
        v = _vector(p, b)
        d = (v[0] * scale, v[1] * scale, v[2] * scale)
        r = _rotation(b, scale)
        f0, f1 = _column(b, p, d, b0, p0, scale), _column(b, p, d, b1, p1, scale)
        f2 = _column(b, p, d, b2, p2, scale)
        row0 = r[0] + f0[0], r[1] + f1[0], r[2] + f2[0]
        row1 = r[3] + f0[1], r[4] + f1[1], r[5] + f2[1]
        row2 = r[6] + f0[2], r[7] + f1[2], r[8] + f2[2]
        _put(s, SHIFT, k, d)
        _put(s, LINEAR, k, row0)
        _put(s, LINEAR + 3, k, row1)
        _put(s, LINEAR + 6, k, row2)
        s[MARGIN * LANES + k] = margin(row0, row1, row2, LEAST_STRETCH, MOST_STRETCH)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _four(s, row, k):
    """Four rows of the working memory, at point k of the block."""
    start = row * LANES + k
    return s[start], s[start + LANES], s[start + 2 * LANES], s[start + 3 * LANES]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _put(s, row, k, values):
    """Three rows of the working memory, at point k of the block."""
    start = row * LANES + k
    s[start], s[start + LANES], s[start + 2 * LANES] = values


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _accumulate(s, c, k, nearest, sums):
    """Adds control point c to sum w q, the columns of sum q (grad w)^T, and both for m."""
    b, b0, b1, b2, p, p0, p1, p2 = sums
    q, m = _four(s, NODES + 8 * c, k), _four(s, NODES + 8 * c + 4, k)
    w, g0, g1, g2 = _four(s, SHARES + 4 * c, k)
    sign = 1.0 if _dot(q, nearest) >= 0.0 else -1.0  # q and -q are the same turn
    w, g0, g1, g2 = sign * w, sign * g0, sign * g1, sign * g2
    b, b0, b1, b2 = _add(b, w, q), _add(b0, g0, q), _add(b1, g1, q), _add(b2, g2, q)
    return b, b0, b1, b2, _add(p, w, m), _add(p0, g0, m), _add(p1, g1, m), _add(p2, g2, m)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _placed(p, b, y):
    """p + (0, vec(b) x y): the sums of u q from those of m; `y` is the 2 y of above."""
    return (
        p[0],
        p[1] + b[2] * y[2] - b[3] * y[1],
        p[2] + b[3] * y[0] - b[1] * y[2],
        p[3] + b[1] * y[1] - b[2] * y[0],
    )


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _column(b, p, d, turns, shifts, scale):
    """A column of sum_j g_j (grad w_j)^T; `turns` and `shifts` (4,) are that of b's and of P's."""
    v, w = _vector(shifts, b), _vector(p, turns)
    s = 2.0 * _dot(b, turns)
    return (
        (v[0] + w[0] - s * d[0]) * scale,
        (v[1] + w[1] - s * d[1]) * scale,
        (v[2] + w[2] - s * d[2]) * scale,
    )


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _coupling(nodes, weights, rotations, out):
    for i in range(len(nodes)):
        q0 = _quat(rotations, nodes[i, 0])
        b = ZERO
        for c in range(nodes.shape[1]):
            b = _add(b, weights[i, c], _aligned(_quat(rotations, nodes[i, c]), q0))
        scale = 1.0 / _dot(b, b)
        for c in range(nodes.shape[1]):
            q = _aligned(_quat(rotations, nodes[i, c]), q0)
            w = weights[i, c] * scale
            x, y, z = _vector(q, b)
            s, x, y, z = w * _dot(q, b), w * x, w * y, w * z
            a = out[i, c]
            a[0, 0], a[0, 1], a[0, 2] = s, z, -y
            a[1, 0], a[1, 1], a[1, 2] = -z, s, x
            a[2, 0], a[2, 1], a[2, 2] = y, -x, s


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _aligned(q, reference):
    """q or -q, the same turn: the one nearer to `reference`."""
    sign = 1.0 if _dot(q, reference) >= 0.0 else -1.0
    return sign * q[0], sign * q[1], sign * q[2], sign * q[3]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _moment(x, y, z, q):
    """The quaternion product (0, u) q."""
    return (
        -x * q[1] - y * q[2] - z * q[3],
        x * q[0] + y * q[3] - z * q[2],
        y * q[0] + z * q[1] - x * q[3],
        z * q[0] + x * q[2] - y * q[1],
    )


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _vector(a, b):
    """Vector part of the quaternion product a b*, b* the conjugate."""
    return (
        a[1] * b[0] - a[0] * b[1] - a[2] * b[3] + a[3] * b[2],
        a[2] * b[0] - a[0] * b[2] - a[3] * b[1] + a[1] * b[3],
        a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1],
    )


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _add(total, w, q):
    """total + w q."""
    return total[0] + w * q[0], total[1] + w * q[1], total[2] + w * q[2], total[3] + w * q[3]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _rotation(q, scale):
    """The nine numbers of the rotation of q; `scale` is 1 / |q|^2."""
    w, x, y, z = q
    s = 2.0 * scale
    return (
        1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
        s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
        s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y),
    )  # fmt: skip
