"""As-rigid-as-possible: what the minimum must be, whatever way it is found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from objectmorpher_core.base.arrays import F64 as Array
from objectmorpher_core.deform.anderson import WINDOW, Anderson
from objectmorpher_core.deform.arap import ArapSolver, minimise
from objectmorpher_core.deform.constraints import Constraints, Targets
from objectmorpher_core.deform.graph import build_graph
from objectmorpher_core.deform.rotation_fit import fit_rotations
from tests import shapes

F64 = 1e-9  # of an object of size 1, after a few hundred sums of float64
EXACT = 1e-12  # a linear system of this size met by its own solution
FITTED = 1e-6  # a rotation fit ends when its last turn was below 1e-6 rad
RIGID = 1e-9  # measured: 4e-15 after 100 iterations, a thin bar's twist included
SCREEN = 1e-5  # of the object's size: what the default stopping rule leaves (measured: 5e-6)
BALL = shapes.even(shapes.ball(3000), 120)
BAR = shapes.even(shapes.bar(3000), 150)


def _solver(points: Array, weights: Array | None = None) -> ArapSolver:
    return ArapSolver(
        points, build_graph(points).weights if weights is None else csr_array(weights)
    )


def _fit_rotations(matrices: Array, warm: Array) -> Array:
    """The local step's rotation fit, for each 3x3 matrix (N, 3, 3)."""
    count = len(matrices)
    fitted = np.array(warm.reshape(count, 9).T, order="C")
    fit_rotations(np.ascontiguousarray(matrices.reshape(count, 9).T), fitted)
    return fitted.T.reshape(count, 3, 3)


def _hold(solver: ArapSolver, nodes: np.ndarray, targets: Array) -> None:
    """Control points `nodes` must be at `targets`."""
    solver.constrain(Constraints.on_nodes(nodes))
    solver.aim(Targets(targets, np.empty((0, 3)), np.empty((0, 3, 3))))


def _identity(solver: ArapSolver) -> Array:
    return np.tile(np.eye(3), (len(solver.points), 1, 1))


def _bent_bar(points: Array, angle: float = 1.2) -> tuple[np.ndarray, Array]:
    """One end of a bar held, the other end turned about z and lifted."""
    left = np.flatnonzero(points[:, 0] < -0.4)
    right = np.flatnonzero(points[:, 0] > 0.4)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    targets = np.concatenate([points[left], points[right] @ turn.T + [-0.2, 0.3, 0.1]])
    return np.concatenate([left, right]), targets


# ---- the slow twin: the paper's sums, written as loops ---------------------------------------


def _slow_energy(p: Array, w: Array, posed: Array, rotations: Array) -> float:
    """Eq. 2."""
    total = 0.0
    for i in range(len(p)):
        for j in range(len(p)):
            gap = (posed[i] - posed[j]) - rotations[i] @ (p[i] - p[j])
            total += w[i, j] * gap @ gap
    return total


def _slow_positions(p: Array, w: Array, rotations: Array, nodes: np.ndarray, at: Array) -> Array:
    """Eq. 3 with Lagrange multipliers for the handles."""
    m, h = len(p), len(nodes)
    system, right = np.zeros((m + h, m + h)), np.zeros((m + h, 3))
    for i in range(m):
        for j in range(m):
            system[i, i] += w[i, j]
            system[i, j] -= w[i, j]
            right[i] += 0.5 * w[i, j] * (rotations[i] + rotations[j]) @ (p[i] - p[j])
    for k, node in enumerate(nodes):
        system[m + k, node] = system[node, m + k] = 1.0
        right[m + k] = at[k]
    return np.linalg.solve(system, right)[:m]


def _slow_rotations(p: Array, w: Array, posed: Array) -> Array:
    """Eq. 4: SVD of S_i, the weakest axis flipped where it would mirror."""
    result = np.empty((len(p), 3, 3))
    for i in range(len(p)):
        s = np.zeros((3, 3))
        for j in range(len(p)):
            s += w[i, j] * np.outer(p[i] - p[j], posed[i] - posed[j])
        u, _, vt = np.linalg.svd(s)
        flip = np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)])
        result[i] = vt.T @ flip @ u.T
    return result


def _fitted(solver: ArapSolver, posed: Array, rotations: Array) -> Array:
    """The rotation fit, gone on with until it is done: one call makes 40 turns at most."""
    for _ in range(30):
        rotations = solver.fit(posed, rotations)[0]
    return rotations


def _seven() -> tuple[Array, Array, np.ndarray, Array]:
    """Seven points in general position, weights, two handles and their targets."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(7, 3)) * 0.3
    weights = rng.random((7, 7))
    weights = weights + weights.T
    np.fill_diagonal(weights, 0)
    weights[1, 5] = weights[5, 1] = 0.0
    weights = weights.astype(np.float32).astype(np.float64)  # the solver keeps 24 bits of them
    nodes = np.array([0, 3, 6])
    return points, weights, nodes, points[nodes] + rng.normal(size=(3, 3)) * 0.2


def test_energy_and_both_steps_equal_plain_loops_on_seven_points():
    points, weights, nodes, targets = _seven()
    solver = _solver(points, weights)
    _hold(solver, nodes, targets)
    rotations = shapes.rotations(7, seed=2)
    posed = solver.positions(rotations)
    assert np.abs(posed - _slow_positions(points, weights, rotations, nodes, targets)).max() < F64
    fitted = _fitted(solver, posed, _identity(solver))
    assert np.abs(fitted - _slow_rotations(points, weights, posed)).max() < FITTED
    slow = _slow_energy(points, weights, posed, rotations)
    assert solver.energy(posed, rotations) == pytest.approx(slow, rel=F64)


def test_the_minimum_equals_a_thousand_plain_iterations():
    points, weights, nodes, targets = _seven()
    solver = _solver(points, weights)
    _hold(solver, nodes, targets)
    found = minimise(solver, _identity(solver), 500, tolerance=1e-9)
    rotations = _identity(solver)
    for _ in range(1000):
        posed = _slow_positions(points, weights, rotations, nodes, targets)
        rotations = _slow_rotations(points, weights, posed)
    slow = _slow_energy(points, weights, posed, rotations)
    assert found.energies[-1] == pytest.approx(slow, rel=1e-6)  # both converge linearly
    assert np.abs(found.positions - posed).max() < 1e-4


# ---- properties -----------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.3, 1.5, 3.0])
@pytest.mark.parametrize("points", [BALL, BAR], ids=["ball", "bar"])
def test_rigidly_moved_handles_give_exactly_that_motion(points, turn):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    k = np.cross(np.eye(3), axis)
    r = np.eye(3) - np.sin(turn) * k + (1 - np.cos(turn)) * k @ k
    solver = _solver(points)
    nodes = np.arange(0, len(points), 10)
    moved = points @ r.T + [0.4, -0.2, 0.7]
    _hold(solver, nodes, moved[nodes])
    found = minimise(solver, _identity(solver), 100, tolerance=0.0)
    assert found.energies[-1] < F64
    assert np.abs(found.positions - moved).max() < RIGID
    assert np.abs(found.rotations - r).max() < RIGID
    quick = minimise(solver, _identity(solver), 200)
    assert quick.energies[-1] < 1e-8
    assert np.abs(quick.positions - moved).max() < SCREEN


def test_handles_that_stay_leave_everything_at_rest():
    points = shapes.even(shapes.horseshoe(3000), 150)
    solver = _solver(points)
    nodes = np.array([0, 50, 149])
    _hold(solver, nodes, points[nodes])
    found = minimise(solver, _identity(solver), 50)
    assert found.energies[-1] < F64
    assert np.abs(found.positions - points).max() < EXACT * 10
    assert np.abs(found.rotations - np.eye(3)).max() < F64


def test_handles_are_met_exactly_in_every_global_step():
    points = BAR
    solver = _solver(points)
    nodes, targets = _bent_bar(points)
    _hold(solver, nodes, targets)
    for rotations in (_identity(solver), shapes.rotations(150)):
        assert np.abs(solver.positions(rotations)[nodes] - targets).max() < F64


def _surface_handles(solver: ArapSolver, fixed: Array, softness: float = 0.0) -> Constraints:
    """Three handles between four control points each, at `fixed` (3, 3)."""
    gaps = np.linalg.norm(BAR[:, None] - BAR[[0, 60, 140]], axis=2)
    nodes = np.argsort(gaps, axis=0)[:4].T.astype(np.int32)
    weights, arms = np.full((3, 4), 0.25), BAR[nodes].mean(1, keepdims=True) - BAR[nodes]
    none = np.empty(0, np.int32)
    constraints = Constraints(nodes, weights, arms, np.full(3, softness), none, none)
    solver.constrain(constraints)
    solver.aim(Targets(fixed, np.empty((0, 3)), np.empty((0, 3, 3))))
    return constraints


def test_a_handle_between_control_points_is_met_exactly():
    """As it is skinned: the blend of its control points' rotations is not linear."""
    solver = _solver(BAR)
    fixed = np.random.default_rng(1).normal(size=(3, 3)) * 0.4
    constraints = _surface_handles(solver, fixed)
    found = minimise(solver, _identity(solver), 60)
    assert np.abs(constraints.bends(found.rotations)).max() > 1e-6
    placed = constraints.placed(found.positions, found.rotations)
    assert np.abs(placed - fixed).max() < F64


def test_a_soft_handle_gives_way_the_more_the_softer_it_is():
    solver = _solver(BAR)
    fixed = BAR[[0, 60, 140]] + [[0, 0, 0], [0, 0.3, 0], [0, 0, 0]]
    misses = []
    for softness in (0.0, 0.1, 10.0, 1000.0):
        constraints = _surface_handles(solver, fixed, softness)
        found = minimise(solver, _identity(solver), 200)
        # the fit does not see the handles' arms: where all but nothing moves, it may rise a little
        assert (np.diff(found.energies) <= 1e-5 * found.energies[0]).all()
        gaps = fixed - constraints.placed(found.positions, found.rotations)
        misses.append(np.linalg.norm(gaps, axis=1).max())
    assert misses[0] < F64
    assert (np.diff(misses) > 0).all()


@pytest.mark.parametrize("angle", [0.4, 1.2, 2.4])
def test_the_energy_never_rises(angle):
    points = BAR
    solver = _solver(points)
    _hold(solver, *_bent_bar(points, angle))
    energies = minimise(solver, _identity(solver), 100, tolerance=0.0).energies
    assert (np.diff(energies) <= 1e-9 * energies[0]).all()


@pytest.mark.parametrize("size", [2, 5, WINDOW])
def test_acceleration_solves_a_linear_iteration_in_hardly_more_steps_than_it_has_numbers(size):
    """By itself it would need hundreds."""
    own = np.linspace(-0.5, 0.99, size)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(size, size)))[0]
    history, x, goal = Anderson(size), np.zeros(size), turn.sum(0)
    for _ in range(size + 3):
        value = goal + turn @ (own * (turn.T @ (x - goal)))
        x = history.mix(value, value - x)
    assert np.abs(x - goal).max() < F64 * np.abs(goal).max()


def test_what_frames_of_a_drag_have_learnt_makes_the_next_ones_better():
    """Few iterations a frame: a slender object lags behind its handle, and less with a history."""
    angles, ends = np.linspace(0.06, 1.2, 20), []
    for history in (None, Anderson(BAR.size)):
        solver = _solver(BAR)
        rotations = _identity(solver)
        for angle in angles:
            _hold(solver, *_bent_bar(BAR, angle))
            frame = minimise(solver, rotations, 5, tolerance=0.0, history=history)
            rotations = frame.rotations
        ends.append(frame.energies[-1])
    best = minimise(solver, rotations, 2000, tolerance=1e-6).energies[-1]
    assert best <= ends[1] < best + 0.1 * (ends[0] - best)


def test_acceleration_ends_no_higher_than_plain_iteration():
    points = BAR
    solver = _solver(points)
    _hold(solver, *_bent_bar(points))
    fast = minimise(solver, _identity(solver), 40, tolerance=0.0).energies[-1]
    rotations = _identity(solver)
    for _ in range(40):
        posed = solver.positions(rotations)
        rotations = solver.fit(posed, rotations)[0]
    assert fast <= solver.energy(posed, rotations) * (1 + F64)


def test_one_percent_of_the_minimum_is_reached_within_forty_iterations():
    points = BAR
    solver = _solver(points)
    _hold(solver, *_bent_bar(points))
    best = minimise(solver, _identity(solver), 1000, tolerance=0.0).energies[-1]
    assert minimise(solver, _identity(solver), 40).energies[-1] <= 1.01 * best


@pytest.mark.parametrize("thickness", [0.0, 1e-3])
def test_rotations_of_a_thin_sheet_are_never_mirror_images(thickness):
    points = shapes.sheet(thickness=thickness)
    solver = _solver(points)
    nodes, targets = _bent_bar(points, 2.0)
    _hold(solver, nodes, targets)
    rotations = minimise(solver, _identity(solver), 30).rotations
    assert np.abs(np.linalg.det(rotations) - 1).max() < F64
    assert np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max() < F64


@pytest.mark.parametrize("strengths", [(1, 0.9, 0.8), (1, 0.8, 0.02), (1, 0.05, 0.03)])
def test_fitted_rotations_are_as_good_as_the_svd_from_any_start(strengths):
    """A body, a sheet and a thin bar: the objective is the trace, its best value from the SVD."""
    count = 200
    left, right = shapes.rotations(count, 1), shapes.rotations(count, 2)
    matrices = left @ np.diag(strengths) @ right.transpose(0, 2, 1)
    fitted = shapes.rotations(count, 3)
    before = np.trace(fitted.transpose(0, 2, 1) @ matrices, axis1=1, axis2=2)
    once = _fit_rotations(matrices, fitted)
    reached = np.trace(once.transpose(0, 2, 1) @ matrices, axis1=1, axis2=2)
    assert (reached >= before - F64).all()
    assert (sum(strengths) - reached).max() < FITTED
    near = left @ right.transpose(0, 2, 1)  # a warm start
    assert np.abs(_fit_rotations(matrices, near) - near).max() < FITTED


def test_a_fit_from_a_bad_start_is_still_a_rotation():
    solver = _solver(BALL)
    posed = BALL * [1.0, -1.0, 1.0]  # a mirror image, which no rotation fits
    fitted = solver.fit(posed, shapes.rotations(len(BALL)))[0]
    assert np.abs(np.linalg.det(fitted) - 1).max() < F64


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_size_of_the_object_does_not_matter(scale):
    points = BAR
    found = []
    for size in (1.0, scale):
        solver = _solver(points * size)
        nodes, targets = _bent_bar(points)
        _hold(solver, nodes, targets * size)
        found.append(minimise(solver, _identity(solver), 100).positions / size)
    assert np.abs(found[0] - found[1]).max() < 1e-6  # the stopping rule may differ by a step


def test_a_rigid_motion_of_everything_moves_the_result_with_it():
    points = BAR
    r, t = shapes.rotation(5), np.array([3.0, -1.0, 2.0])
    nodes, targets = _bent_bar(points)
    found = []
    for p, goal in ((points, targets), (points @ r.T + t, targets @ r.T + t)):
        solver = _solver(p, build_graph(points).weights)
        _hold(solver, nodes, goal)
        found.append(minimise(solver, _identity(solver), 200, tolerance=1e-8).positions)
    assert np.abs(found[0] @ r.T + t - found[1]).max() < 1e-6  # both are near one minimum


def test_coincident_points_do_not_make_the_system_singular():
    points = np.concatenate([BALL, BALL[:20]])
    solver = _solver(points)
    nodes = np.array([0, 41, 77, 125])
    _hold(solver, nodes, points[nodes] + [0.1, 0.0, 0.0])
    found = minimise(solver, _identity(solver), 50)
    assert np.isfinite(found.positions).all()
    assert np.abs(found.positions - points - [0.1, 0, 0]).max() < F64


def test_a_part_without_a_constraint_stays_and_takes_no_part():
    part = shapes.even(shapes.ball(3000), 40)
    points = np.concatenate([part, part + [4.0, 0, 0]])
    solver = _solver(points)
    nodes = np.array([0, 10, 20])
    _hold(solver, nodes, points[nodes] + [0.0, 0.3, 0.0])
    assert np.array_equal(solver.is_free, np.arange(80) < 40)
    found = minimise(solver, _identity(solver), 50)
    assert np.abs(found.positions[40:] - points[40:]).max() < EXACT
    assert np.abs(found.positions[:40] - points[:40] - [0, 0.3, 0]).max() < F64


def test_asymmetric_weights_are_our_mistake():
    points = shapes.ball(10)
    weights = np.triu(np.ones((10, 10)), 1)
    with pytest.raises(AssertionError, match="symmetric"):
        ArapSolver(points, weights)
