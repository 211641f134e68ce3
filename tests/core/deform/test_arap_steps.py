"""The two steps of `arap.py`, each alone: what it minimises, and what it leaves as it was."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.arap import ArapSolver
from objectmorpher_core.deform.constraints import Constraints, Targets
from objectmorpher_core.deform.graph import build_graph
from tests import shapes

EXACT = 1e-9
BAR = shapes.even(shapes.bar(1500), 60)
SOLVER = ArapSolver(BAR, build_graph(BAR).weights)
NODES = np.array([3, 20, 41, 50], np.int32)
SOFT = np.array([0.5, 0.0, 3.0, 0.1])  # give of each
TURNED = np.array([20, 41], np.int32)


def _aimed(rng: np.random.Generator) -> F64:
    """With random targets; the given turns."""
    constraints = Constraints(
        NODES[:, None], np.ones((4, 1)), np.zeros((4, 1, 3)), SOFT, np.array([9], np.int32), TURNED
    )
    turns = shapes.rotations(2, int(rng.integers(999)))
    SOLVER.constrain(constraints)
    SOLVER.aim(Targets(BAR[NODES] + rng.normal(size=(4, 3)) * 0.2, BAR[[9]], turns))
    return turns


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_global_step_is_a_minimum_of_the_energy_with_what_soft_handles_add(seed):
    """The energy is a square one, so that central differences are its slopes exactly."""
    rng = np.random.default_rng(seed)
    _aimed(rng)
    rotations = shapes.rotations(len(BAR), seed)
    positions = SOLVER.positions(rotations)
    energy = SOLVER.energy(positions, rotations)
    for _ in range(5):
        way = rng.normal(size=BAR.shape)
        way[[20, 9]] = 0.0  # which are hard
        ahead, back = (SOLVER.energy(positions + s * way, rotations) for s in (1.0, -1.0))
        assert ahead > energy < back
        assert abs(ahead - back) < EXACT * (ahead + back)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_local_step_turns_all_but_what_is_turned_by_hand(seed):
    rng = np.random.default_rng(seed)
    turns = _aimed(rng)
    warm = SOLVER.turned(shapes.rotations(len(BAR), seed))
    np.testing.assert_array_equal(warm[TURNED], turns)
    rotations, energy = SOLVER.fit(SOLVER.positions(warm), warm)
    np.testing.assert_array_equal(rotations[TURNED], turns)
    others = np.delete(np.arange(len(BAR)), TURNED)
    assert (np.abs(rotations - warm)[others].max((1, 2)) > 1e-3).all()
    assert abs(energy - SOLVER.energy(SOLVER.positions(warm), rotations)) < EXACT * energy
