"""The compiled steps of the constraints, against the same in numpy."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.deform.constraints import Constraints, followed

F64 = 1e-12
POINTS, HELD, NEAR = 20, 5, 4


def made(rng: np.random.Generator) -> Constraints:
    weights = rng.random((HELD, NEAR))
    none = np.empty(0, np.int32)
    return Constraints(
        rng.integers(0, POINTS, (HELD, NEAR)).astype(np.int32),
        weights / weights.sum(1, keepdims=True), rng.normal(size=(HELD, NEAR, 3)),
        np.zeros(HELD), none, none,
    )  # fmt: skip


def test_arms_are_turned_as_products_of_matrices_turn_them():
    rng = np.random.default_rng(0)
    constraints, rotations = made(rng), rng.normal(size=(POINTS, 3, 3))
    plain = (rotations[constraints.nodes] @ constraints.arms[..., None])[..., 0]
    assert np.allclose(constraints.turned_arms(rotations), plain, atol=F64)


def test_the_excess_is_the_sum_over_the_control_points():
    rng = np.random.default_rng(1)
    constraints, positions = made(rng), rng.normal(size=(POINTS, 3))
    bends, turned = rng.normal(size=(HELD, NEAR, 3, 3)), rng.normal(size=(HELD, NEAR, 3))
    nodes = constraints.nodes
    near = turned + positions[nodes] - positions[nodes[:, :1]]
    plain = (bends @ near[..., None])[..., 0].sum(1)
    assert np.allclose(constraints.excess(bends, turned, positions), plain, atol=F64)


def test_what_follows_the_targets_is_one_system():
    rng = np.random.default_rng(2)
    bends, parting = rng.normal(size=(HELD, NEAR, 3, 3)), rng.normal(size=(HELD, NEAR, HELD))
    plain = np.einsum("hkab,hkg->hagb", bends, parting).reshape(3 * HELD, 3 * HELD)
    assert np.allclose(followed(bends, parting), plain + np.eye(3 * HELD), atol=F64)
