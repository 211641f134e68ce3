"""The paper's own motion of the Gaussians: Eq. 5 as printed, for comparison with `skinning`.

Line 1 blends the displaced points linearly. Lines 2 and 3 turn a Gaussian by the mean of its
control points' quaternions and scale it by the mean of their stretches.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64, frozen
from ..base.kernel_files import numba
from ..base.rotations import quats_from_matrices
from ..base.threads import FAST, LEAST_ROWS, in_threads
from .binding import Binding
from .graph import ControlGraph
from .skinning import Motion, Skinned


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
    in_threads(lambda first, last: _skin(first, last, *inputs), len(x), least=LEAST_ROWS)
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
def _skin(first, last, x, control_points, weights, nodes, moved, linear):
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
