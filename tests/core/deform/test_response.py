"""The inverse of the grounded Laplacian: dense and sparse are one, and constraints add to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.constraints import HeldResponse, StiffnessPatch
from objectmorpher_core.deform.response import (
    DenseResponse,
    SparseResponse,
    build_response,
    product,
)

EXACT = 1e-9  # of a system of this size, condition about 1e4
KINDS = pytest.mark.parametrize("kind", [DenseResponse, SparseResponse])


def _laplacian(count: int = 90, seed: int = 0) -> F64:
    """Of random links, about ten a control point, connected."""
    rng = np.random.default_rng(seed)
    weights = np.where(rng.random((count, count)) < 0.06, rng.random((count, count)), 0.0)
    weights[np.arange(count - 1), np.arange(1, count)] = 0.5
    weights = weights + weights.T
    np.fill_diagonal(weights, 0.0)
    return np.diag(weights.sum(1)) - weights


def _grounded(laplacian: F64) -> F64:
    matrix = laplacian.copy()
    matrix[0, 0] += 1.0
    return matrix


@KINDS
def test_it_solves_the_system(kind):
    matrix = _grounded(_laplacian())
    response = kind(csr_array(matrix))
    forces = np.random.default_rng(1).normal(size=(90, 3))
    assert np.abs(matrix @ response.solve(forces) - forces).max() < EXACT


@KINDS
def test_its_columns_are_those_of_the_inverse(kind):
    matrix = _grounded(_laplacian())
    nodes = np.array([5, 2, 88, 5, 41])
    response = kind(csr_array(matrix))
    for _ in range(2):  # the sparse one remembers them
        gap = response.columns(nodes) - np.linalg.inv(matrix)[:, nodes]
        assert np.abs(gap).max() < EXACT
    assert response.columns(nodes[:0]).shape == (90, 0)


def test_few_unknowns_are_dense_and_many_sparse():
    assert isinstance(build_response(csr_array(_grounded(_laplacian(40)))), DenseResponse)
    count = 1600
    path = np.full(count - 1, -1.0)
    chain = np.diag(np.full(count, 2.0)) + np.diag(path, 1) + np.diag(path, -1)
    assert isinstance(build_response(csr_array(chain)), SparseResponse)


@pytest.mark.parametrize("rows", [1, 2, 7, 8])
def test_the_thin_product_is_a_product(rows):
    rng = np.random.default_rng(2)
    matrix, columns = rng.normal(size=(rows, 13)), rng.normal(size=(13, 3))
    assert np.abs(product(matrix, columns) - matrix @ columns).max() < 1e-12


def _held(laplacian: F64, rows: F64, compliance: F64, added: F64) -> HeldResponse:
    """Constraints `rows` on the object whose stiffness is `laplacian` + `added`."""
    nodes = np.union1d(np.flatnonzero(added.any(1)), [0])
    patch = added[np.ix_(nodes, nodes)].copy()
    patch[0, 0] -= 1.0  # takes the ground back
    response = DenseResponse(csr_array(_grounded(laplacian)))
    return HeldResponse(response, StiffnessPatch(nodes, patch), csr_array(rows), compliance)


def _saddle(matrix: F64, rows: F64, compliance: F64, forces: F64, targets: F64) -> F64:
    """The slow twin: the system with Lagrange multipliers, solved whole."""
    m, h = len(matrix), len(rows)
    system = np.zeros((m + h, m + h))
    system[:m, :m], system[:m, m:], system[m:, :m] = matrix, rows.T, rows
    system[m:, m:] = -np.diag(compliance)
    return np.linalg.solve(system, np.concatenate([forces, targets]))[:m]


@pytest.mark.parametrize("softness", [0.0, 0.3])
def test_patch_and_constraints_equal_the_whole_system(softness):
    rng = np.random.default_rng(3)
    laplacian = _laplacian()
    own = _laplacian(12, seed=5)
    added = np.zeros((90, 90))
    added[20:32, 20:32] = own
    rows = np.zeros((4, 90))
    rows[0, 25] = rows[1, 70] = 1.0
    rows[2, [3, 4, 5, 6]] = 0.25
    rows[3, 0] = 1.0  # the ground itself
    compliance = np.array([0.0, softness, softness, 0.0])
    forces, targets = rng.normal(size=(90, 3)), rng.normal(size=(4, 3))
    held = _held(laplacian, rows, compliance, added)
    slow = _saddle(laplacian + added, rows, compliance, forces, targets)
    assert np.abs(held.solve(forces, targets) - slow).max() < EXACT
    moves = rng.normal(size=(4, 3))
    shifted = held.solve(forces, targets + moves) - held.solve(forces, targets)
    assert np.abs(held.follow(4) @ moves - shifted).max() < EXACT


def test_constraints_that_contradict_each_other_meet_in_the_middle():
    rows = np.zeros((3, 90))
    rows[[0, 1], 40] = 1.0
    rows[2, 7] = 1.0
    held = _held(_laplacian(), rows, np.zeros(3), np.zeros((90, 90)))
    targets = np.array([[0.0, 0, 0], [2.0, 0, 0], [0, 0, 0]])
    found = held.solve(np.zeros((90, 3)), targets)
    assert np.abs(found[40] - [1.0, 0, 0]).max() < 1e-3
    assert np.abs(found[7]).max() < EXACT


def test_a_singular_matrix_is_pushed_off_singular():
    response = DenseResponse(csr_array(_laplacian()))
    forces = np.zeros((90, 3))
    forces[3], forces[4] = 1.0, -1.0
    found = response.solve(forces)
    assert np.isfinite(found).all()
    assert np.abs(_laplacian() @ found - forces).max() < 1e-4


@KINDS
def test_what_hangs_on_nothing_still_resists_every_force(kind):
    """Rounding leaves such a matrix singular: the smallest push makes it positive, not negative."""
    count = 30
    links = np.full(count - 1, -1.0)
    path = np.diag(links, 1) + np.diag(links, -1)
    response = kind(csr_array(path - np.diag(path.sum(1))))
    forces = np.ones((count, 3))
    moves = response.solve(forces)
    assert np.isfinite(moves).all()
    assert (moves > 0).all()
    assert (response.columns(np.arange(count)).diagonal() > 0).all()
