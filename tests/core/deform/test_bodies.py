"""Rigid bodies: groups of control points that keep their shape, whatever else bends."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.arap import ArapSolver, Minimum, minimise
from objectmorpher_core.deform.constraints import Constraints, Targets
from objectmorpher_core.deform.graph import build_graph
from tests import shapes

EXACT = 1e-9
BAR = shapes.even(shapes.bar(3000), 150)
MIDDLE = np.flatnonzero(np.abs(BAR[:, 0]) < 0.15).astype(np.int32)
LEFT, RIGHT = np.flatnonzero(BAR[:, 0] < -0.4), np.flatnonzero(BAR[:, 0] > 0.4)


def _bent(groups: tuple[np.ndarray, ...], turn: float = 1.2, iterations: int = 200) -> Minimum:
    """The bar with its left end held and its right end turned about z."""
    solver = ArapSolver(BAR, build_graph(BAR).weights, groups)
    c, s = np.cos(turn), np.sin(turn)
    r = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    nodes = np.concatenate([LEFT, RIGHT])
    targets = np.concatenate([BAR[LEFT], BAR[RIGHT] @ r.T + [-0.2, 0.2, 0.0]])
    solver.constrain(Constraints.on_nodes(nodes))
    solver.aim(Targets(targets, np.empty((0, 3)), np.empty((0, 3, 3))))
    return minimise(solver, np.tile(np.eye(3), (len(BAR), 1, 1)), iterations, tolerance=1e-6)


def _distances(points: F64) -> F64:
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def test_a_body_keeps_its_shape_exactly_while_the_rest_bends():
    free, stiff = _bent(()), _bent((MIDDLE,))
    rest = _distances(BAR[MIDDLE])
    assert np.abs(_distances(free.positions[MIDDLE]) - rest).max() > 1e-3
    assert np.abs(_distances(stiff.positions[MIDDLE]) - rest).max() < EXACT
    turns = stiff.rotations[MIDDLE]
    assert np.abs(turns - turns[0]).max() < EXACT
    moved = BAR[MIDDLE] @ turns[0].T
    assert np.ptp(stiff.positions[MIDDLE] - moved, axis=0).max() < EXACT


def test_a_body_turns_with_what_it_hangs_on():
    own, free = _bent((MIDDLE,)).rotations[MIDDLE[0]], _bent(()).rotations[MIDDLE]
    angles = np.arctan2(free[:, 1, 0], free[:, 0, 0])
    assert np.arctan2(own[1, 0], own[0, 0]) == pytest.approx(angles.mean(), abs=0.05)


def test_the_energy_never_rises_with_a_body():
    energies = _bent((MIDDLE,)).energies
    assert (np.diff(energies) <= 1e-9 * energies[0]).all()


def test_the_minimum_with_a_body_is_where_small_changes_do_not_lower_it():
    """A little stiffer than free: a body only takes freedom away."""
    assert _bent(()).energies[-1] < _bent((MIDDLE,)).energies[-1]


def test_bodies_that_are_the_ends_change_nothing_but_their_own_shape():
    stiff = _bent((LEFT.astype(np.int32), RIGHT.astype(np.int32)))
    assert np.abs(stiff.positions[LEFT] - BAR[LEFT]).max() < 1e-6
    free = _bent(())
    assert np.abs(stiff.positions - free.positions).max() < 0.02


def test_two_handles_turn_the_body_that_they_are_in():
    body = np.arange(len(BAR), dtype=np.int32)
    solver = ArapSolver(BAR, build_graph(BAR).weights, (body,))
    r = shapes.rotation(4)
    nodes = np.array([LEFT[0], RIGHT[0], RIGHT[1], MIDDLE[0]])
    solver.constrain(Constraints.on_nodes(nodes))
    solver.aim(Targets(BAR[nodes] @ r.T + 0.3, np.empty((0, 3)), np.empty((0, 3, 3))))
    found = minimise(solver, np.tile(np.eye(3), (len(BAR), 1, 1)), 100, tolerance=1e-8)
    assert np.abs(found.positions - BAR @ r.T - 0.3).max() < 1e-6


def test_a_body_of_two_parts_joins_them():
    part = shapes.even(shapes.ball(3000), 60)
    points = np.concatenate([part, part + [1.2, 0, 0]])
    body = np.array([0, 1, 2, 3, 60, 61, 62, 63], np.int32)
    solver = ArapSolver(points, build_graph(points).weights, (body,))
    assert len(np.unique(solver.components)) == 1
    nodes = np.array([10, 20, 30, 40])
    solver.constrain(Constraints.on_nodes(nodes))
    moved = points @ shapes.rotation(1).T + [0.1, 0.2, 0.3]
    solver.aim(Targets(moved[nodes], np.empty((0, 3)), np.empty((0, 3, 3))))
    found = minimise(solver, np.tile(np.eye(3), (120, 1, 1)), 400, tolerance=1e-7)
    assert np.abs(found.positions - moved).max() < 1e-4
