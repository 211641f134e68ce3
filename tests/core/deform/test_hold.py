"""Which rows a set of handles is, where they want them, and how stiff a hand is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.deform.binding import Binding
from objectmorpher_core.deform.hold import GRIP, SHARED, SMALLEST, Frozen, Grasp, HandleRows, Start
from objectmorpher_core.deform.hold import stiffened as weights_in_hand
from objectmorpher_core.document.model import Handle
from tests import shapes

F64 = 1e-12
EXACT = {"rtol": 0, "atol": F64}


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_handles_take_their_rows_along_and_what_is_frozen_goes_its_way(share):
    """One that moves a point of the surface, one that turns what is around it, and two frozen."""
    rng = np.random.default_rng(0)
    points, shifts = rng.normal(size=(10, 3)), rng.normal(size=(2, 3))
    free = Handle(0, rng.normal(size=3), rng.normal(size=3), softness=0.5)
    turning = Handle(4, rng.normal(size=3), rng.normal(size=3), turn=rng.normal(size=3))
    binding = Binding(
        np.array([[0, 1], [4, 2]], np.int32), np.array([[0.7, 0.3], [1.0, 0.0]]),
        np.zeros((2, 2, 3)),
    )  # fmt: skip
    around = np.empty(0, np.int32), np.array([4, 5, 6], np.int32)
    frozen = Frozen(np.array([6, 8], np.int32), shifts)
    start = Start(None, (free, turning), np.array([3, 5], np.int32), frozen)
    rows = HandleRows.of((free, turning), Grasp(binding, around), points, start)
    assert rows.owners.tolist() == [0, 1, 1]
    assert rows.constraints.nodes.tolist() == [[0, 1], [4, 4], [5, 5]]
    assert rows.constraints.turned.tolist() == [4, 5]
    assert rows.constraints.held.tolist() == [3, 6, 8], "a handle is on 5, and 6 is frozen"
    assert rows.constraints.softness.tolist() == [0.5, 0.0, 0.0]
    assert turning.turn is not None
    later = (
        replace(free, target=rng.normal(size=3)),
        replace(turning, target=rng.normal(size=3), turn=rng.normal(size=3)),
    )
    targets = rows.targets(later, share)
    assert later[1].turn is not None
    turn = matrix_from_vector(later[1].turn) @ matrix_from_vector(turning.turn).T
    arms = points[[4, 5]] - turning.point
    goals = np.vstack([later[0].target, later[1].target + arms @ turn.T])
    np.testing.assert_allclose(targets.points, goals, **EXACT)
    np.testing.assert_allclose(targets.turns, [turn, turn], **EXACT)
    way = np.vstack([np.zeros(3), shifts])
    np.testing.assert_allclose(targets.held, points[[3, 6, 8]] + share * way, **EXACT)


def test_a_hand_is_stiffest_in_its_middle_and_ends_at_its_radius():
    """A link's grip is the product of its ends'; beyond the radius it is as it was."""
    radius = SMALLEST * 2.0
    shares = np.array([0.0, 0.25, 0.5, 1.0, 1.5])  # x the radius, from the handle
    points = np.outer(shares * radius, [0.6, 0.0, 0.8])
    weights = np.random.default_rng(0).uniform(1, 2, (5, 5))
    weights = csr_array(np.triu(weights, 1) + np.triu(weights, 1).T)
    handle = np.zeros((1, 3))
    data = weights_in_hand(points, weights, handle, handle, 2.0)
    grip = np.array([1, (15 / 16) ** 2, (3 / 4) ** 2, 0, 0])
    dense = csr_array((data, weights.indices, weights.indptr)).toarray()
    times = 1 + (GRIP - 1) * np.outer(grip, grip)
    np.testing.assert_allclose(dense, weights.toarray() * times, **EXACT)
    turn = shapes.rotation(3)
    turned = weights_in_hand(points @ turn.T + 1, weights, handle + 1, handle + 1, 2.0)
    np.testing.assert_allclose(turned, data, rtol=1e-9)


@pytest.mark.parametrize("apart", [1.0, 1.9, 2.1])
def test_of_two_hands_each_lets_go_towards_the_other_and_both_in_the_middle(apart):
    """`apart` x their radius: from twice that on they do not meet, and are as if alone."""
    radius = SMALLEST * 2.0
    places = np.array([0.0, 0.2, 0.5, 0.8, 1.0]) * apart  # x the radius, from the one
    points, handles = np.outer(places, [radius, 0, 0]), np.outer([0, apart], [radius, 0, 0])
    weights = csr_array(1.0 - np.eye(5))
    data = weights_in_hand(points, weights, handles, handles, 2.0)
    grips = [np.maximum(1 - gaps**2, 0) ** 2 for gaps in (places, places[::-1])]
    if apart < 2:
        grips[0] *= ((apart - 2 * places) / (SHARED * apart)).clip(0, 1)
        grips[1] = grips[0][::-1]
    times = 1 + (GRIP - 1) * np.maximum(*(np.outer(grip, grip) for grip in grips))
    dense = csr_array((data, weights.indices, weights.indptr)).toarray()
    np.testing.assert_allclose(dense, weights.toarray() * times, **EXACT)
