"""The least strain with which a pose is a minimum's: against a dense solution of its equations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.sparse import csr_array

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.deform.links import Links, in_single
from objectmorpher_core.deform.prestress import full_prestress, least_prestress
from tests import shapes

COUNT = 8  # control points
F64_SUM = 1e-9
SOLVED = 1e-5  # x the largest strain: what conjugate gradients leave


def _links(rng: np.random.Generator) -> Links:
    """About two thirds of all pairs, connected."""
    weights = in_single(rng.uniform(0.3, 2.0, (COUNT, COUNT)))
    weights[rng.random((COUNT, COUNT)) < 0.3] = 0.0
    weights[np.arange(COUNT - 1), np.arange(1, COUNT)] = 1.0
    weights = np.triu(weights, 1)
    return Links.of(rng.normal(size=(COUNT, 3)), csr_array(weights + weights.T))


def _answer(links: Links, rows: F64, forces: F64) -> F64:
    """Positions (M, 3) under forces (M, 3), the constraints at 0."""
    laplacian = np.diag(links.totals[0]) - links.weights.toarray()
    system = np.block([[laplacian, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    return np.linalg.solve(system, np.vstack([forces, np.zeros((len(rows), 3))]))[:COUNT]


def _dense(links: Links, pose: tuple[F64, F64], is_given: Mask, rows: F64) -> F64:
    """The changes (E, 3) by both balances, written out link by link, of least weighted square."""
    (q, turns), points, weights = pose, links.points, links.weights.toarray()
    pairs = np.argwhere(weights)
    number = {(int(i), int(j)): e for e, (i, j) in enumerate(pairs)}
    forces, pulls = np.zeros((COUNT, 3, len(pairs), 3)), np.zeros((COUNT, 3))
    moments, turned = np.zeros((COUNT, 3, len(pairs), 3)), np.zeros((COUNT, 3))
    for (i, j), e in number.items():
        w, b, rest = weights[i, j], q[j] - q[i], points[j] - points[i]
        forces[i, :, e] += w * np.eye(3)
        forces[i, :, number[j, i]] -= w * np.eye(3)
        pulls[i] += w * (2 * b - turns[i] @ rest - turns[j] @ rest)
        moments[i, :, e] += w * np.cross(b, np.eye(3)).T
        turned[i] -= w * np.cross(b, turns[i] @ rest)
    free = null_space(rows).T  # of the forces, what no constraint bears
    left = np.tensordot(free, forces, 1), moments[~is_given]
    right = free @ pulls, turned[~is_given]
    matrix = np.concatenate([part.reshape(-1, 3 * len(pairs)) for part in left])
    roots = np.sqrt(np.repeat(links.weights.data, 3))
    goal = np.concatenate([part.ravel() for part in right])
    strain = np.linalg.lstsq(matrix / roots, goal)[0] / roots
    assert np.abs(matrix @ strain - goal).max() < F64_SUM, "both balances can be met"
    return (strain.reshape(-1, 1, 3) @ turns[pairs[:, 0]])[:, 0]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_it_is_the_least_that_keeps_forces_and_moments_in_balance(seed):
    rng = np.random.default_rng(seed)
    links = _links(rng)
    pose = links.points + 0.3 * rng.normal(size=(COUNT, 3)), shapes.rotations(COUNT, seed)
    is_given = rng.random(COUNT) < 0.3
    rows = np.zeros((2, COUNT))
    rows[0, 0], rows[1, 3:5] = 1.0, (0.25, 0.75)
    found = least_prestress(
        links, pose, is_given, csr_array(rows), lambda forces: _answer(links, rows, forces)
    )
    exact = _dense(links, pose, is_given, rows)
    assert np.abs(found - exact).max() < SOLVED * np.abs(exact).max()


def test_a_pose_that_is_strained_wholly_has_no_energy():
    rng = np.random.default_rng(0)
    links = _links(rng)
    pose = rng.normal(size=(COUNT, 3)), shapes.rotations(COUNT)
    strained = links.prestressed(full_prestress(links, pose))
    assert strained.energies(*pose).max() < F64_SUM < links.energies(*pose).min()


@pytest.mark.parametrize("seed", range(3))
def test_the_energy_of_strained_links_is_the_sum_of_the_control_points_shares(seed):
    rng = np.random.default_rng(seed)
    links = _links(rng)
    pose = rng.normal(size=(COUNT, 3)), shapes.rotations(COUNT, seed)
    for strained in (links, links.prestressed(rng.normal(size=(links.weights.nnz, 3)))):
        _, energy = strained.fit(*pose, np.ones(COUNT, bool))
        assert energy == pytest.approx(strained.energies(*pose).sum(), rel=F64_SUM)
