"""Groups of control points that move as one rigid body: one unknown position and rotation each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from ..base.arrays import F64, I32, Sparse
from .links import Links
from .rotation_fit import fit_rotations

GRASP = 1e4  # x the weight of a body's links: several handles inside it say how it is turned


@dataclass(frozen=True, eq=False)
class Pivot:
    """The point that a body turns about, and how its handles want it turned."""

    rest: F64  # (3,)
    now: F64  # (3,)
    goal: F64  # (3, 3) sum of targets x points^T about them; a single handle says nothing


class Bodies:
    """Which unknown each control point belongs to, and where it is in its body.

    A control point of a body is at c + R a, with c the body's centre and a its place in it; one
    that belongs to no body is its own centre.
    """

    def __init__(self, points: F64, groups: tuple[I32, ...]) -> None:
        """`points` (M, 3) rest; `groups` of control points, disjoint."""
        first = np.arange(len(points))
        for group in groups:
            first[group] = group[0]
        self.unknown = np.unique(first, return_inverse=True)[1]  # (M,)
        self.groups = groups
        self.points = points
        self.arms = np.zeros_like(points)  # (M, 3)
        for group in groups:
            self.arms[group] = points[group] - points[group].mean(0)
        count, unknowns = len(points), int(self.unknown.max()) + 1
        steps = np.arange(count + 1)
        self.members = csr_array((np.ones(count), self.unknown, steps), shape=(count, unknowns))

    def without_inner(self, weights: Sparse) -> Sparse:
        """The links less those inside a body, which never change."""
        rows = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
        is_outer = self.unknown[rows] != self.unknown[weights.indices]
        pairs = rows[is_outer], weights.indices[is_outer]
        return csr_array((weights.data[is_outer], pairs), shape=weights.shape)

    def turned(self, rotations: F64) -> F64:
        """R a of each control point, (M, 3)."""
        return (rotations @ self.arms[..., None])[..., 0]

    def settled(self, positions: F64, rotations: F64, pivots: tuple[Pivot, ...]) -> F64:
        """`positions` (M, 3) with each body made rigid about its pivot."""
        settled = positions.copy()
        for group, pivot in zip(self.groups, pivots, strict=True):
            arms = self.points[group] - pivot.rest
            settled[group] = pivot.now + arms @ rotations[group[0]].T
        return settled

    def pivot(self, group: I32, positions: F64, handles: tuple[F64, F64]) -> Pivot:
        """Return the body's pivot: the handles inside it, or else its centre."""
        points, targets = handles
        if len(points) == 0:
            return Pivot(self.points[group].mean(0), positions[group].mean(0), np.zeros((3, 3)))
        rest, now = points.mean(0), targets.mean(0)
        return Pivot(rest, now, (targets - now).T @ (points - rest))

    def spread(self, rotations: F64, given: np.ndarray) -> F64:
        """`rotations` (M, 3, 3) in which each body has one: a `given` member's, or the first's."""
        rotations = rotations.copy()
        for group in self.groups:
            leaders = group[np.isin(group, given)]
            rotations[group] = rotations[leaders[0] if len(leaders) else group[0]]
        return rotations

    def fit(self, links: Links, pose: tuple[F64, F64], group: I32, pivot: Pivot) -> F64:
        """The body's rotation (3, 3) that minimises Eq. 2 while all else stays.

        Its links' other ends j are at q_j, and turn with R_j. The body's own view of link ij is
        q_j - c = R (p_j - p_c), the other end's is q_j - c - R_j (p_j - p_i) = R (p_i - p_c).
        Where the links are at rest changed, p_j - p_c is so by d_ij, and p_j - p_i by -d_ji.
        """
        (q, r), starts = pose, links.weights.indptr
        own = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in group])
        i = np.repeat(group, np.diff(starts)[group])
        j, w = links.weights.indices[own], links.weights.data[own, None]
        seen, there, back = q[j] - pivot.now, self.points[j], self.points[j] - self.points[i]
        if len(links.changes):
            there, back = there + links.changes[own], back - links.returning[own]
        turned = (r[j] @ back[..., None])[..., 0]
        goal = (w * seen).T @ (there - pivot.rest)
        goal += (w * (seen - turned)).T @ (self.points[i] - pivot.rest)
        goal += GRASP * (float(w.sum()) or 1.0) * pivot.goal
        fitted = r[group[0]].reshape(9, 1).copy()
        fit_rotations(np.ascontiguousarray(goal.reshape(9, 1)), fitted)
        return fitted.reshape(3, 3)
