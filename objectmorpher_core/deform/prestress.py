"""Strain put into an object at rest, so that a given pose is one in which it stays.

Eq. 2 with rest links e_ij + d_ij for e_ij. A pose (q, R) is a minimum's where, with
b_ij = q_j - q_i and D_ij = R_i d_ij, every free control point is in balance of forces and of
moments:

    sum_j w (D_ij - D_ji) = sum_j w (2 b_ij - R_i e_ij + R_j e_ji)
    sum_j w b_ij x D_ij   = - sum_j w b_ij x R_i e_ij

Of all D the one with the smallest sum of w |D|^2 is taken, so that the object keeps as much of its
own shape as it can; a pose that is a minimum already needs none. It is
D_ij = x_j - x_i - m_i x b_ij: the moments give m, and conjugate gradients, preconditioned by the
solver's own inverse, give x, which is 0 under the constraints.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..base.arrays import F64, Mask, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from ..base.threads import FAST
from .links import Links

Answer = Callable[[F64], F64]

STEPS = 200  # at most; 20 to 40 are usual
CLOSE = 1e-6  # x the first residual
NOTHING = 1e-10  # x the object's size: a strain as small as this is none
TIE = 1e-12  # constraints that say the same share the force
DULL = 1e-9  # x its size: what a control point whose links are all in one line resists a turn


def full_prestress(links: Links, pose: tuple[F64, F64]) -> F64:
    """Changes (E, 3) with which nothing of `pose` (q (M, 3), R (M, 3, 3)) is strained."""
    starts, seen, edges = _links_of(links, pose[0])
    return (seen[:, None] @ pose[1][starts])[:, 0] - edges


def least_prestress(
    links: Links, pose: tuple[F64, F64], is_given: Mask, rows: Sparse, answer: Answer
) -> F64:
    """The smallest changes (E, 3) with which `pose` (q (M, 3), R (M, 3, 3)) is a minimum's.

    `is_given` (M,) where the rotation is given: no balance of moments is needed there. Constraints
    with `rows` (C, M) bear any force; `answer`: the positions (M, 3) that answer to forces (M, 3)
    while they hold still.
    """
    q, rotations = pose
    starts, seen, edges = _links_of(links, q)
    turned = (rotations[starts] @ edges[..., None])[..., 0]
    w = links.weights.data[:, None]
    moments = _summed(starts, w * np.cross(seen, turned), len(q))
    inertia = _inertia(starts, w, seen, len(q))
    inertia[is_given] = 0.0
    body = _Body(links.weights, links.totals[0], q, inertia)
    first = body.turns(moments)
    forces = links.right_side(rotations) - body.pulled(q)
    least = NOTHING**2 * float(links.totals[4].sum())
    without_reaction = _Reactions(rows).removed
    x = _solved(body, -forces - body.bent(first), (without_reaction, answer), least)
    m = first + body.turns(body.moments(x))
    ends = links.weights.indices
    strain = x[ends] - x[starts] - np.cross(m[starts], seen)
    return (strain[:, None] @ rotations[starts])[:, 0]


def _links_of(links: Links, q: F64) -> tuple[np.ndarray, F64, F64]:
    """Of each link its start (E,), and the way to its end (E, 3) in the pose and at rest."""
    starts = np.repeat(np.arange(len(q)), np.diff(links.weights.indptr))
    ends = links.weights.indices
    return starts, q[ends] - q[starts], links.points[ends] - links.points[starts]


def _summed(starts: np.ndarray, values: F64, count: int) -> F64:
    """(count, 3) sums of (E, 3) over the links of each control point."""
    sums = [np.bincount(starts, values[:, a], count) for a in range(3)]
    return np.column_stack(sums).astype(np.float64, copy=False)


def _inertia(starts: np.ndarray, w: F64, seen: F64, count: int) -> F64:
    """(count, 3, 3) inverses of sum_j w (|b|^2 - b b^T)."""
    products = (w * seen)[:, :, None] * seen[:, None]
    sums = np.column_stack(
        [np.bincount(starts, products[:, a, b], count) for a in range(3) for b in range(3)]
    ).reshape(-1, 3, 3)
    size = np.trace(sums, axis1=1, axis2=2)[:, None, None]
    return np.linalg.inv((size * (1.0 + DULL) + 1e-300) * np.eye(3) - sums)


class _Body:
    """The object about its pose, to first order: how it answers to moves x with free turns m."""

    def __init__(self, weights: Sparse, degree: F64, q: F64, inertia: F64) -> None:
        self._rows, self._degree, self._weights = frozen_rows(weights), degree, weights
        self._q, self._inertia = frozen(q), inertia

    def turns(self, moments: F64) -> F64:
        """m (M, 3) of moments (M, 3)."""
        return (self._inertia @ moments[..., None])[..., 0]

    def pulled(self, x: F64) -> F64:
        """sum_j w (x_i - x_j), (M, 3)."""
        return self._degree[:, None] * x - self._weights @ x

    def moments(self, x: F64) -> F64:
        """sum_j w b_ij x (x_j - x_i), (M, 3)."""
        out = np.empty(x.shape)
        _moments(*self._rows, self._q, frozen(x), out)
        return out

    def bent(self, m: F64) -> F64:
        """sum_j w (m_i + m_j) x b_ij / 2, (M, 3)."""
        out = np.empty(m.shape)
        _bend(*self._rows, self._q, frozen(m), out)
        return out

    def answered(self, x: F64) -> F64:
        """The forces (M, 3) that moves x (M, 3) need."""
        return self.pulled(x) + self.bent(self.turns(self.moments(x)))


class _Reactions:
    """The forces that constraints bear."""

    def __init__(self, rows: Sparse) -> None:
        """`rows` (C, M) of the constraints."""
        self._rows = rows
        own = (rows @ rows.T).toarray()
        self._factor = cho_factor(own + TIE * np.eye(len(own))) if len(own) else None

    def removed(self, forces: F64) -> F64:
        """`forces` (M, 3) less what the constraints bear: it would drown the rest in rounding."""
        if self._factor is None:
            return forces
        return forces - self._rows.T @ cho_solve(self._factor, self._rows @ forces)


def _solved(body: _Body, right: F64, solves: tuple[Answer, Answer], least: float) -> F64:
    """Projected conjugate gradients from 0 (Gould, Hribar & Nocedal 2001).

    `solves`: what is left of forces when the constraints bear theirs, and the preconditioner.
    """
    project, answer = solves
    x, residual = np.zeros(right.shape), project(right)
    z = answer(residual)
    way, size = z, float((residual * z).sum())
    limit = max(CLOSE**2 * size, least)
    for _ in range(STEPS):
        if size <= limit:
            break
        image = body.answered(way)
        resistance = float((way * image).sum())
        if resistance <= 0.0:  # a motion of the whole: nothing resists it, and nothing asks for it
            break
        step = size / resistance
        x, residual = x + step * way, project(residual - step * image)
        z = answer(residual)
        before, size = size, float((residual * z).sum())
        way = z + (size / before) * way
    return x


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _moments(starts, ends, weights, q, x, out):
    for i in range(len(starts) - 1):
        s0 = s1 = s2 = 0.0
        for e in range(starts[i], starts[i + 1]):
            j, w = ends[e], weights[e]
            b0, b1, b2 = q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]
            x0, x1, x2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            s0 += w * (b1 * x2 - b2 * x1)
            s1 += w * (b2 * x0 - b0 * x2)
            s2 += w * (b0 * x1 - b1 * x0)
        out[i, 0], out[i, 1], out[i, 2] = s0, s1, s2


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _bend(starts, ends, weights, q, m, out):
    for i in range(len(starts) - 1):
        s0 = s1 = s2 = 0.0
        for e in range(starts[i], starts[i + 1]):
            j, w = ends[e], 0.5 * weights[e]
            b0, b1, b2 = q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]
            m0, m1, m2 = m[i, 0] + m[j, 0], m[i, 1] + m[j, 1], m[i, 2] + m[j, 2]
            s0 += w * (m1 * b2 - m2 * b1)
            s1 += w * (m2 * b0 - m0 * b2)
            s2 += w * (m0 * b1 - m1 * b0)
        out[i, 0], out[i, 1], out[i, 2] = s0, s1, s2
