"""Constraints on an object: surface points with targets, held control points, stiffer patches.

Each of them adds a few rows to a system whose inverse is known (`response.py`), so that a change
of the set costs the solution of a small system, not a factorisation (Woodbury's identity and a
Schur complement in one).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, vstack

from ..base.arrays import F64, I32, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from ..base.threads import FAST
from .binding import Binding
from .response import Response
from .skinning import coupling

STEEP = 1e6  # condition from which an inverse loses what a solution keeps
TIE = 1e-12  # x the softest constraint's own give: constraints that contradict each other average


@dataclass(frozen=True, eq=False)
class Constraints:
    """Surface points that must be somewhere, and control points that are held.

    Where they must be is said later, and as often as a pointer moves (`Targets`).
    """

    nodes: I32  # (H, K) control points of each surface point
    weights: F64  # (H, K) rows sum to 1
    arms: F64  # (H, K, 3) x0 - p_j, object frame at rest
    softness: F64  # (H,) give, in units of what one control point's links give; 0 = none
    held: I32  # (P,) control points
    turned: I32  # (T,) control points whose rotation is given

    @classmethod
    def on_nodes(cls, nodes: np.ndarray) -> Constraints:
        """Control points themselves."""
        count = len(nodes)
        return cls(
            np.asarray(nodes, np.int32)[:, None], np.ones((count, 1)), np.zeros((count, 1, 3)),
            np.zeros(count), np.empty(0, np.int32), np.empty(0, np.int32),
        )  # fmt: skip

    @cached_property
    def is_linear(self) -> bool:
        """Whether all of them are control points: no blending between rotations."""
        return not self.arms.any()

    @cached_property
    def blended(self) -> I32:
        """(B,) those that are no control points."""
        return np.flatnonzero(self.arms.any((1, 2))).astype(np.int32)

    @cached_property
    def _linear(self) -> F64:
        """(H, K, 3, 3) w_j times the identity."""
        return self.weights[..., None, None] * np.eye(3)

    @cached_property
    def _binding(self) -> Binding:
        return Binding(self.nodes, self.weights, np.zeros((*self.nodes.shape, 3)))

    def turned_arms(self, rotations: F64) -> F64:
        """R_j (x0 - p_j), (H, K, 3)."""
        out = np.empty(self.arms.shape)
        _turn(frozen(self.nodes), frozen(self.arms), frozen(rotations), out)
        return out

    def mean(self, values: F64) -> F64:
        """sum_j w_j of (H, K, 3): (H, 3)."""
        return (self.weights[:, None] @ values)[:, 0]

    def bends(self, rotations: F64) -> F64:
        """(H, K, 3, 3) by how much skinning's matrices differ from the linear blend's.

        Skinning blends rotations (`skinning.skin`): x' = x + sum_j A_j u_j, where a linear blend
        has w_j for A_j. Their sums over j are the same.
        """
        return coupling(self._binding, rotations) - self._linear

    def excess(self, bends: F64, turned: F64, positions: F64) -> F64:
        """Return how far (H, 3) the surface points are from the places of a linear blend.

        `turned` are `turned_arms`, (H, K, 3).
        """
        out = np.zeros((len(self.nodes), 3))
        _bend(frozen(self.nodes), frozen(bends), frozen(turned), frozen(positions), out)
        return out

    def placed(self, positions: F64, rotations: F64) -> F64:
        """Return the places (H, 3) of the surface points."""
        turned = self.turned_arms(rotations)
        linear = self.mean(positions[self.nodes] + turned)
        if self.is_linear:
            return linear
        return linear + self.excess(self.bends(rotations), turned, positions)

    def rows(self, count: int) -> Sparse:
        """(H + P, count) what each constraint is of the control points, to first order."""
        own, width = self.nodes.shape
        data = np.concatenate([self.weights.ravel(), np.ones(len(self.held))])
        nodes = np.concatenate([self.nodes.ravel(), self.held])
        rows = np.concatenate([np.repeat(np.arange(own), width), own + np.arange(len(self.held))])
        return csr_array((data, (rows, nodes)), shape=(own + len(self.held), count))


@dataclass(frozen=True, eq=False)
class Targets:
    """The places of the constraints."""

    points: F64  # (H, 3) of the surface points
    held: F64  # (P, 3) of the held control points
    turns: F64  # (T, 3, 3) of the turned ones


@dataclass(frozen=True, eq=False)
class StiffnessPatch:
    """Stiffness that is added to (or, the ground's, taken from) a few unknowns."""

    nodes: np.ndarray  # (P,) unknowns
    matrix: F64  # (P, P) symmetric


class HeldResponse:
    """K^-1 with a patch and constraints: one thin product more than K^-1 alone."""

    def __init__(
        self, response: Response, patch: StiffnessPatch, rows: Sparse, compliance: F64
    ) -> None:
        """`rows` (H, n) of the constraints, `compliance` (H,) what each gives to a unit force.

        Unknowns p with (K + E D E^T) p + C^T f = b and C p - S f = t. With B = [E^T; C] and
        G = K^-1 B^T: p = y - G blockdiag(D, 1) Z^-1 (B y - [0; t]), y = K^-1 b,
        Z = blockdiag(1, S) + B G blockdiag(D, 1).
        """
        self._response = response
        own, count = len(patch.nodes), rows.shape[0]
        select = _selection(patch.nodes, rows.shape[1])
        self._rows: Sparse = vstack([select, rows], format="csr")
        touched = np.unique(self._rows.indices)
        local = self._rows[:, touched]
        spread = (local @ response.columns(touched).T).T  # G, (n, P + H)
        system = local @ spread[touched]
        give = system.diagonal()[own:]
        self._answers = np.empty(spread.shape)  # G blockdiag(D, 1)
        self._answers[:, :own] = spread[:, :own] @ patch.matrix
        self._answers[:, own:] = spread[:, own:]
        system[:, :own] = system[:, :own] @ patch.matrix
        system[np.arange(own), np.arange(own)] += 1.0
        rest = own + np.arange(count)
        system[rest, rest] += compliance + TIE * float(np.abs(give).max(initial=0.0))
        self._inverse = np.linalg.inv(system)  # Z^-1
        if np.abs(self._inverse).max(initial=0.0) * np.abs(system).max(initial=0.0) > STEEP:
            # Constraints that say the same: what is large in Z^-1 cancels only if solved for.
            self._answers = np.ascontiguousarray(np.linalg.solve(system.T, self._answers.T).T)
            self._inverse = np.eye(len(system))
        self._own = own

    def solve(self, forces: F64, targets: F64) -> F64:
        """Unknowns (n, 3) under `forces` (n, 3), with the constraints at `targets` (H, 3)."""
        unknowns = np.array(self._response.solve(forces), order="C")
        rows = self._rows
        _hold(
            *frozen_rows(rows), self._own,
            frozen(targets), frozen(self._inverse), frozen(self._answers), unknowns,
        )  # fmt: skip
        return unknowns

    def follow(self, count: int) -> F64:
        """(n, count) how the unknowns move when one of the first `count` targets does."""
        return self._answers @ self._inverse[:, self._own : self._own + count]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _hold(starts, nodes, values, own, targets, inverse, answers, unknowns):
    """unknowns -= answers inverse (B unknowns - [0; targets])."""
    count = len(inverse)
    gaps, pulls = np.zeros((3, count)), np.empty((3, count))
    for k in range(count):
        for e in range(starts[k], starts[k + 1]):
            for a in range(3):
                gaps[a, k] += values[e] * unknowns[nodes[e], a]
        if k >= own:
            for a in range(3):
                gaps[a, k] -= targets[k - own, a]
    for k in range(count):
        x = y = z = 0.0
        for m in range(count):
            x += inverse[k, m] * gaps[0, m]
            y += inverse[k, m] * gaps[1, m]
            z += inverse[k, m] * gaps[2, m]
        pulls[0, k], pulls[1, k], pulls[2, k] = x, y, z
    for i in range(len(unknowns)):
        x = y = z = 0.0
        for m in range(count):
            x += answers[i, m] * pulls[0, m]
            y += answers[i, m] * pulls[1, m]
            z += answers[i, m] * pulls[2, m]
        unknowns[i, 0] -= x
        unknowns[i, 1] -= y
        unknowns[i, 2] -= z


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _turn(nodes, arms, rotations, out):
    for h in range(nodes.shape[0]):
        for k in range(nodes.shape[1]):
            j = nodes[h, k]
            x, y, z = arms[h, k, 0], arms[h, k, 1], arms[h, k, 2]
            for a in range(3):
                r = rotations[j, a]
                out[h, k, a] = r[0] * x + r[1] * y + r[2] * z


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _bend(nodes, bends, turned, positions, out):
    near = np.empty(3)
    for h in range(nodes.shape[0]):
        for k in range(nodes.shape[1]):
            for a in range(3):
                near[a] = turned[h, k, a] + positions[nodes[h, k], a] - positions[nodes[h, 0], a]
            for a in range(3):
                b = bends[h, k, a]
                out[h, a] += b[0] * near[0] + b[1] * near[1] + b[2] * near[2]


def followed(bends: F64, parting: F64) -> F64:
    """(3 B, 3 B) how the excess (B, 3) of all changes when it is taken from the targets.

    `bends` (B, K, 3, 3); `parting` (B, K, B) how a point's control points part when a target moves.
    """
    count = 3 * len(bends)
    out = np.empty((count, count))
    _follow(frozen(bends), frozen(parting), out)
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _follow(bends, parting, out):
    count, width = bends.shape[:2]
    for h in range(count):
        for g in range(count):
            for a in range(3):
                for b in range(3):
                    total = 1.0 if h == g and a == b else 0.0
                    for k in range(width):
                        total += bends[h, k, a, b] * parting[h, k, g]
                    out[3 * h + a, 3 * g + b] = total


def _selection(nodes: np.ndarray, width: int) -> Sparse:
    """(P, width) with a one in each row."""
    steps = np.arange(len(nodes) + 1)
    return csr_array((np.ones(len(nodes)), nodes, steps), shape=(len(nodes), width))
