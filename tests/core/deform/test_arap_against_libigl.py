"""On a triangle mesh with the same weights, libigl ends in the same place."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from objectmorpher_core.deform.arap import ArapSolver, minimise
from objectmorpher_core.deform.constraints import Constraints, Targets
from objectmorpher_research.bench.bodies import even_sphere

igl = pytest.importorskip("igl", reason="libigl is a peer for measurements, not a dependency")


def test_energy_and_positions_equal_libigls_on_a_sphere():
    points, faces = even_sphere(642)
    cotangents = csr_array(igl.cotmatrix(points, faces))
    cotangents.setdiag(0.0)
    cotangents.eliminate_zeros()
    assert cotangents.data.min() > 0, "evenly spread: every weight is positive"
    solver = ArapSolver(points, csr_array(0.5 * (cotangents + cotangents.T)))
    order = np.argsort(points[:, 2])
    held = np.concatenate([order[:12], order[-12:]]).astype(np.int32)
    targets = points[held] + np.where(points[held, 2:] > 0, [[0.6, 0.1, 0.3]], 0.0)
    still = np.tile(np.eye(3), (len(points), 1, 1))

    data = igl.ARAPData()
    data.energy = igl.ARAP_ENERGY_TYPE_SPOKES
    data.max_iter = 1000
    igl.arap_precomputation(points, faces, 3, held, data)
    theirs = igl.arap_solve(targets, data, points.copy())

    solver.constrain(Constraints.on_nodes(held))
    solver.aim(Targets(targets, np.empty((0, 3)), np.empty((0, 3, 3))))
    ours = minimise(solver, still, 1000, tolerance=1e-6)
    rotations = still
    for _ in range(20):
        rotations, energy = solver.fit(theirs, rotations)
    assert ours.energies[-1] == pytest.approx(energy, rel=1e-6)
    # the weights are rounded to 24 bits here, and libigl fits its rotations in float32
    assert np.abs(ours.positions - theirs).max() < 1e-4
