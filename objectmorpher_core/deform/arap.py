"""As-rigid-as-possible solve on the control points (paper Eq. 2-4; Sorkine & Alexa 2007)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from ..base.arrays import F64, I32, Sparse
from .anderson import Anderson, solve_small
from .constraints import Constraints, HeldResponse, StiffnessPatch, Targets, followed
from .links import Links, in_single
from .prestress import full_prestress, least_prestress
from .response import build_response, product
from .rotation_fit import fit_rotations

TOLERANCE = 1e-4  # see `minimise`
NOISE = 1e-14  # x the weights' squares: what rounding may add to the energy
SLACK = 1e-9  # x the energy: what a step may seem to rise by without being taken back
FITTING = 1e-3  # of a rotation's entries: what a fit may change in a pose that is to stay
LAST = 0.7  # x an iteration: what the plain step at the end takes
SKINNED_SLACK = 1e-5  # the same where a handle's arms turn: the local step does not see them


# Groups of control points that move as one rigid body: one unknown position and rotation each.

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


class ArapSolver:
    """Local-global minimisation of Eq. 2 under constraints.

    The constructor factors for the links; `constrain` prepares a set of handles; `aim` gives
    their targets; `positions` and `fit` are the two steps.
    """

    def __init__(self, points: np.ndarray, weights: Sparse, groups: tuple[I32, ...] = ()) -> None:
        """`points` (M, 3) rest control points, `weights` (M, M) symmetric, no diagonal.

        `groups` of control points move as one rigid body each; they are disjoint.
        """
        assert abs(weights - weights.T).max() == 0, "Eq. 3 needs symmetric weights"
        self.points = points.astype(np.float64)
        self.scale = float(np.abs(self.points - self.points.mean(0)).max()) or 1.0
        self._bodies = Bodies(self.points, groups) if groups else None
        weights = csr_array(weights).astype(np.float64)
        if self._bodies:
            weights = self._bodies.without_inner(weights)
        weights.data = in_single(weights.data)
        self.weights = weights
        self._base = self._links = Links.of(self.points, weights)
        matrix = self._merged(csr_array(diags_array(self._base.totals[0]) - weights))
        self._typical = float(matrix.diagonal().mean()) or 1.0
        components = connected_components(matrix, directed=False)[1]
        # One unknown of each component is tied to the ground, which `constrain` takes back.
        self._grounds = np.unique(components, return_index=True)[1]
        ties = np.zeros(len(components))
        ties[self._grounds] = self._typical
        self._response = build_response(csr_array(matrix + diags_array(ties)))
        self.components = components[self._unknown]  # (M,) bodies included
        self.constrain(Constraints.on_nodes(np.empty(0, np.int32)))
        self.aim(Targets(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3, 3))))

    def constrain(self, constraints: Constraints, stiffened: F64 | None = None) -> None:
        """Prepares for these constraints; `aim` must follow.

        `stiffened`: other weights for the links, in the order of `weights.data` and symmetric.
        Control points of components without a constraint are not free: they stay at rest.
        """
        self._constraints = constraints
        held = np.concatenate([constraints.nodes.ravel(), constraints.held])
        touched = np.unique(self.components[held])
        self.is_free = np.isin(self.components, touched)  # (M,)
        self._still = np.flatnonzero(~self.is_free)
        self._is_given = np.zeros(len(self.points), bool)
        self._is_given[constraints.turned] = True
        for group in self._bodies.groups if self._bodies else ():
            self._is_given[group] = True  # fitted as one
        same = stiffened is None
        self._links = self._base if same else self._base.reweighted(in_single(stiffened))
        self._rows = constraints.rows(len(self.points))
        rows = self._rows @ self._bodies.members if self._bodies else self._rows
        give = np.concatenate([constraints.softness, np.zeros(len(constraints.held))])
        patch = self._patch(self._grounds[touched])
        self._held = HeldResponse(self._response, patch, csr_array(rows), give / self._typical)
        nodes, blended = constraints.nodes[constraints.blended], constraints.blended
        follow = self._held.follow(len(constraints.nodes))[self._unknown]  # (M, H)
        self._follow = follow[:, blended]  # (M, B) of the handles whose arms turn
        self._parting = self._follow[nodes] - self._follow[nodes[:, :1]]  # (B, K, B)

    def rest_in(self, positions: F64, rotations: F64) -> None:
        """Strains the object so that it stays in this pose, which meets the targets it aims at.

        Until the next `constrain`. The least strain will not do in a pose that is crushed so far
        that its rotations are no fit: then less and less of the pose itself is strained. With
        rigid bodies nothing of it is.
        """
        pose = positions, rotations
        links, full = self._links, full_prestress(self._links, pose)
        if self._bodies:
            self._links = links.prestressed(full)
            return
        least = self._least_prestress(links, pose)
        for share in (0.0, 0.5):
            self._links = links.prestressed(least + share * (full - least))
            fitted = self._links.fit(positions, rotations, self._is_given)[0]
            if np.abs(fitted - rotations).max() < FITTING:
                return
        self._links = links.prestressed(full)

    def _least_prestress(self, links: Links, pose: tuple[F64, F64]) -> F64:
        """See `least_prestress`; soft constraints bear nothing."""
        still, soft = np.zeros((self._rows.shape[0], 3)), self._constraints.softness
        is_hard = np.concatenate([soft == 0, np.ones(len(self._constraints.held), bool)])
        return least_prestress(
            links, pose, self._is_given, csr_array(self._rows[is_hard]),
            lambda forces: self._held.solve(forces, still),
        )  # fmt: skip

    def aim(self, targets: Targets) -> None:
        """Gives the constraints other targets: nothing is factored for that."""
        self._targets = targets

    def turned(self, rotations: F64) -> F64:
        """`rotations` (M, 3, 3), with the given ones in their places."""
        turned = self._constraints.turned
        if len(turned):
            rotations = rotations.copy()
            rotations[turned] = self._targets.turns
        return self._bodies.spread(rotations, turned) if self._bodies else rotations

    def positions(self, rotations: F64) -> F64:
        """Global step: control points (M, 3) that minimise Eq. 2 for fixed rotations."""
        constraints, forces = self._constraints, self._links.right_side(rotations)
        turned, fixed = None, self._targets.points
        if not constraints.is_linear:
            turned = constraints.turned_arms(rotations)
            fixed = fixed - constraints.mean(turned)
        targets = np.concatenate([fixed, self._targets.held])
        if self._bodies:
            arms = self._bodies.turned(rotations)
            weights, degree = self._links.weights, self._links.totals[0]
            forces = self._bodies.members.T @ (forces + weights @ arms - degree[:, None] * arms)
            targets = targets - self._rows @ arms
            positions = self._held.solve(forces, targets)[self._unknown] + arms
        else:
            positions = self._held.solve(forces, targets)
        if turned is not None:
            self._unbend(positions, turned, constraints.bends(rotations))
        if len(self._still):
            positions[self._still] = self.points[self._still]
        return positions

    def fit(self, positions: F64, warm: F64) -> tuple[F64, float]:
        """Local step: rotations (M, 3, 3), det = +1, for fixed positions; and the energy."""
        rotations, energy = self._links.fit(positions, warm, self._is_given)
        if self._bodies:
            pivots = self._fit_bodies(positions, rotations)
            settled = self._bodies.settled(positions, rotations, pivots)
            return rotations, self.energy(settled, rotations)
        return rotations, energy + self._give(positions, rotations)

    def energy(self, positions: F64, rotations: F64) -> float:
        """Eq. 2, and what soft constraints add to it, object units squared."""
        energies = self._links.energies(positions, rotations)
        return float(energies.sum()) + self._give(positions, rotations)

    def is_higher(self, energy: float, before: float) -> bool:
        """Whether an energy is above the one `before`, by more than comes of rounding."""
        slack = SLACK if self._constraints.is_linear else SKINNED_SLACK
        return energy > before * (1 + slack) + NOISE * float(self._links.totals[4].sum())

    @property
    def _unknown(self) -> np.ndarray:
        """(M,) the unknown of each control point."""
        return self._bodies.unknown if self._bodies else np.arange(len(self.points))

    def _unbend(self, positions: F64, turned: F64, bends: F64) -> None:
        """Moves `positions` so that the surface points, as they are skinned, are at the targets.

        The global step met them for a linear blend. For fixed rotations the excess over it, e,
        is linear in the positions, and these follow the targets linearly: one small system.
        """
        blended = self._constraints.blended  # the others have none
        excess = self._constraints.excess(bends, turned, positions)[blended]
        system = followed(bends[blended], self._parting)
        excess = solve_small(system, excess.ravel()).reshape(-1, 3)
        positions -= product(self._follow, excess)

    def _fit_bodies(self, positions: F64, rotations: F64) -> tuple[Pivot, ...]:
        """Fits the bodies' `rotations`, in place; what they turn about."""
        assert self._bodies is not None
        nodes, pivots = self._constraints.nodes, []
        points = self.points[nodes[:, 0]] + self._constraints.arms[:, 0]
        for group in self._bodies.groups:
            inside = np.isin(nodes, group).all(1)
            handles = points[inside], self._targets.points[inside]
            pivot = self._bodies.pivot(group, positions, handles)
            pivots.append(pivot)
            if not np.isin(group, self._constraints.turned).any():
                pose = positions, rotations
                rotations[group] = self._bodies.fit(self._links, pose, group, pivot)
        return tuple(pivots)

    def _give(self, positions: F64, rotations: F64) -> float:
        """Energy of the soft constraints' springs; Eq. 2 counts each link twice, so do they."""
        soft = np.flatnonzero(self._constraints.softness)
        if len(soft) == 0:
            return 0.0
        gaps = self._targets.points - self._constraints.placed(positions, rotations)
        squares = (gaps[soft] ** 2).sum(1) / self._constraints.softness[soft]
        return 2.0 * self._typical * float(squares.sum())

    def _merged(self, matrix: Sparse) -> Sparse:
        """A matrix of the control points as one of the unknowns."""
        if self._bodies is None:
            return matrix
        members = self._bodies.members
        return csr_array(members.T @ matrix @ members)

    def _patch(self, grounds: np.ndarray) -> StiffnessPatch:
        """The Laplacian of the weights that were added, less the ties to the ground."""
        base, data = self.weights, self._links.weights.data
        changed = np.flatnonzero(data != base.data)
        rows = self._unknown[np.searchsorted(base.indptr, changed, side="right") - 1]
        ends = self._unknown[base.indices[changed]]
        nodes = np.union1d(ends, grounds)  # symmetric: each end is another's other end
        matrix = np.zeros((len(nodes), len(nodes)))
        pairs = np.searchsorted(nodes, rows), np.searchsorted(nodes, ends)
        np.subtract.at(matrix, pairs, data[changed] - base.data[changed])
        np.fill_diagonal(matrix, matrix.diagonal() - matrix.sum(1))
        tied = np.searchsorted(nodes, grounds)
        matrix[tied, tied] -= self._typical
        return StiffnessPatch(nodes, matrix)


@dataclass(frozen=True, eq=False)
class Minimum:
    """The end of the iteration."""

    positions: F64  # (M, 3)
    rotations: F64  # (M, 3, 3)
    energies: tuple[float, ...]  # after each iteration


def iterate(solver: ArapSolver, rotations: F64, iterations: int) -> Minimum:
    """Plain local-global iterations from `rotations` (M, 3, 3): the paper's, and the twin."""
    rotations = solver.turned(rotations)
    positions, energies = solver.points, []
    for _ in range(iterations):
        positions = solver.positions(rotations)
        rotations, energy = solver.fit(positions, rotations)
        energies.append(energy)
    return Minimum(positions, rotations, tuple(energies))


def minimise(
    solver: ArapSolver,
    rotations: F64,
    iterations: int,
    tolerance: float = TOLERANCE,
    seconds: float = np.inf,
    history: Anderson | None = None,
) -> Minimum:
    """Local-global iteration with Anderson acceleration from warm `rotations` (M, 3, 3).

    The fixed-point map is rotations -> positions -> rotations; the acceleration extrapolates
    the positions and falls back to the plain step whenever the energy would rise, so the energy
    never rises. Ends after `iterations` or when the positions moved by less than `tolerance` x
    the object's size times 0.01, and begins no iteration that would end after `seconds`, judged
    by the longest so far. `history`: what the acceleration learnt of the same constraints with
    other targets; it is learnt anew where there is none.
    """
    begun = time.perf_counter()
    end, longest = begun + seconds, 0.0
    limit = tolerance * 0.01 * solver.scale
    if history is None:
        history = Anderson(solver.points.size)
    else:
        history.resume()
    rotations = solver.turned(rotations)
    positions = solver.positions(rotations)
    rotations, energy = solver.fit(positions, rotations)
    energies = [energy]
    for _ in range(iterations - 1):
        now = time.perf_counter()
        begun, longest = now, max(longest, now - begun)
        if now + (1 + LAST) * longest > end:
            break
        plain = solver.positions(rotations)
        residual = plain - positions
        if np.abs(residual).max() < limit:
            break
        trial = history.mix(plain, residual)
        trial_rotations, energy = solver.fit(trial, rotations)
        if trial is not plain and solver.is_higher(energy, energies[-1]):
            history.forget()
            trial = plain
            trial_rotations, energy = solver.fit(trial, rotations)
        positions, rotations = trial, trial_rotations
        energies.append(energy)
    # One plain step last: the constraints depend on the rotations and are then met exactly.
    positions = solver.positions(rotations)
    return Minimum(positions, rotations, (*energies, solver.energy(positions, rotations)))
