"""How near the minimum the default solve is, counted in iterations; times are the bench's."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.arap import ArapSolver, iterate, minimise
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_research.bench.bodies import five_limbs, limb_handles
from objectmorpher_research.bench.deform import BEND

COLD, WARM = 9, 5  # iterations that fit into a frame of 10 ms here, with room


@pytest.fixture(scope="module")
def deformer() -> Deformer:
    return Deformer(five_limbs(12_000, 512), DeformSettings())


def _solver(deformer: Deformer, degrees: float) -> ArapSolver:
    deformer.prepare(limb_handles(deformer.lifted, degrees))
    return deformer._solver


def _still(deformer: Deformer) -> F64:
    return deformer.rest().rotations


def test_a_limb_bent_by_a_right_angle_from_cold_is_within_one_percent(deformer):
    solver = _solver(deformer, BEND)
    plain = iterate(solver, _still(deformer), 2000).energies
    fast = minimise(solver, _still(deformer), COLD).energies
    assert fast[-1] <= 1.01 * plain[-1]
    assert plain[COLD] > 1.01 * plain[-1], "plain iteration is not there yet"
    assert plain[2] > 1.3 * plain[-1], "and three iterations are far from it"


def test_every_step_of_a_drag_is_within_one_percent(deformer):
    rotations = converged = _still(deformer)
    for step in range(1, 61):
        solver = _solver(deformer, BEND * step / 60)
        frame = minimise(solver, rotations, WARM)
        rotations = frame.rotations
        best = minimise(solver, converged, 300, tolerance=1e-7)
        converged = best.rotations
        assert frame.energies[-1] <= 1.01 * best.energies[-1], step


def test_two_thousand_control_points_converge_as_well(deformer):
    large = Deformer(five_limbs(12_000, 2048), DeformSettings())
    solver = _solver(large, BEND)
    best = minimise(solver, _still(large), 400, tolerance=1e-6).energies[-1]
    fast = minimise(solver, _still(large), 2 * COLD).energies
    assert fast[-1] <= 1.01 * best


def test_a_change_of_the_handles_costs_a_fraction_of_the_solver(deformer):
    """No factorisation: a ratio in this very run, of medians."""
    from time import perf_counter

    points, weights = deformer.points, deformer._solver.weights
    handles = limb_handles(deformer.lifted, BEND)
    build, change = [], []
    for k in range(12):
        start = perf_counter()
        ArapSolver(points, weights)
        build.append(perf_counter() - start)
        start = perf_counter()
        deformer.prepare(handles[: -1 - k % 2])
        change.append(perf_counter() - start)
    assert np.median(change) < 0.5 * np.median(build)
