"""Binding: the nearest control points along the surface, with weights that fade in and out."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.binding import NEIGHBOURS, STEEPEST, Binding, bind
from objectmorpher_core.deform.graph import ControlGraph, build_graph
from tests import shapes

F64 = 1e-9
SURFACE = shapes.horseshoe(400, seed=5)
CONTROL = shapes.even(shapes.horseshoe(3000), 120)
GRAPH = build_graph(CONTROL)


def slow_bind(points: np.ndarray, p: np.ndarray, graph: ControlGraph) -> Binding:
    """The twin of `bind` for parts with more than K control points: one point at a time."""
    nodes, weights, gradients = [], [], []
    for x in points:
        nearest = int(np.linalg.norm(p - x, axis=1).argmin())
        candidates = graph.neighbours[nearest]
        candidates = candidates[candidates >= 0]
        distances = np.linalg.norm(p[candidates] - x, axis=1)
        order = np.argsort(distances, kind="stable")[: NEIGHBOURS + 1]
        chosen, d = candidates[order], distances[order]
        directions = (x - p[chosen]) / d[:, None]
        slack = 1 - d[:-1] / d[-1]
        change = d[:-1, None] / d[-1] ** 2 * directions[-1] - directions[:-1] / d[-1]
        total = (slack**2).sum()
        w, g = slack**2 / total, 2 * slack[:, None] * change / total
        nodes.append(chosen[:-1])
        g -= w[:, None] * g.sum(0)
        steepest = np.linalg.norm(g, axis=1).max()
        weights.append(w)
        gradients.append(g * min(1.0, STEEPEST / graph.mean_spacing / steepest))
    return Binding(np.array(nodes, np.int32), np.array(weights), np.array(gradients))


def test_the_binding_is_that_of_its_slow_twin():
    fast, slow = bind(SURFACE, CONTROL, GRAPH), slow_bind(SURFACE, CONTROL, GRAPH)
    assert np.array_equal(fast.control_points, slow.control_points)
    assert np.abs(fast.weights - slow.weights).max() < F64
    largest = np.abs(slow.weight_gradients).max()
    assert np.abs(fast.weight_gradients - slow.weight_gradients).max() < F64 * largest
    lengths = np.linalg.norm(fast.weight_gradients, axis=2)
    assert lengths.max() <= STEEPEST / GRAPH.mean_spacing * (1 + F64)


def test_a_point_alone_is_bound_as_it_is_among_many():
    many, one = bind(SURFACE, CONTROL, GRAPH), bind(SURFACE[7], CONTROL, GRAPH)
    assert np.array_equal(one.control_points[0], many.control_points[7])
    assert np.array_equal(one.weights[0], many.weights[7])


def test_every_thread_binds_its_own_points():
    points = shapes.horseshoe(20_000, seed=6)
    many = bind(points, CONTROL, GRAPH)
    for part in (slice(0, 50), slice(9_990, 10_010), slice(19_950, None)):
        few = bind(points[part], CONTROL, GRAPH)
        assert np.array_equal(few.control_points, many.control_points[part])
        assert np.array_equal(few.weight_gradients, many.weight_gradients[part])


def test_weights_are_positive_sum_to_one_and_their_gradients_to_nothing():
    binding = bind(SURFACE, CONTROL, GRAPH)
    assert binding.control_points.shape == (len(SURFACE), NEIGHBOURS)
    assert binding.weights.min() >= 0
    assert np.abs(binding.weights.sum(1) - 1).max() < F64
    assert np.abs(binding.weight_gradients.sum(1)).max() < 1e-6


def test_the_nearest_control_point_weighs_most():
    binding = bind(SURFACE, CONTROL, GRAPH)
    gaps = np.linalg.norm(SURFACE[:, None] - CONTROL[None], axis=-1)
    assert np.array_equal(binding.control_points[:, 0], gaps.argmin(1))
    assert (binding.weights[:, 0] >= binding.weights.max(1) - F64).all()


def test_a_point_far_from_the_object_is_bound_to_what_is_nearest():
    far = np.array([[50.0, 3, -2], [-1e4, 0, 0], [0, 0, 1e3]])
    gaps = np.linalg.norm(far[:, None] - CONTROL[None], axis=-1)
    assert np.array_equal(bind(far, CONTROL, GRAPH).control_points[:, 0], gaps.argmin(1))


def test_parts_that_are_near_but_far_along_the_surface_do_not_pull_each_other():
    """The horseshoe's ends: a Gaussian of one never follows a control point of the other."""
    binding = bind(SURFACE, CONTROL, GRAPH)
    side = np.sign(CONTROL[:, 1])[binding.control_points]
    tips = np.abs(np.arctan2(SURFACE[:, 1], SURFACE[:, 0])) < 0.4
    assert tips.any()
    assert (side[tips] == np.sign(SURFACE[tips, 1])[:, None]).all()


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_fewer_control_points_than_neighbours_still_bind(count):
    control = shapes.ball(count, seed=1)
    binding = bind(shapes.ball(20), control, build_graph(control))
    assert binding.control_points.shape == (20, NEIGHBOURS)
    assert np.abs(binding.weights.sum(1) - 1).max() < F64
    assert np.isfinite(binding.weight_gradients).all()


def test_a_control_point_alone_in_its_part_carries_its_gaussians():
    control = np.concatenate([shapes.even(shapes.ball(1000), 60), [[9.0, 0, 0]]])
    graph = build_graph(control)
    assert (graph.neighbours[60, 1:] == -1).all()
    binding = bind(np.array([[9.01, 0, 0]]), control, graph)
    assert binding.weights[0] @ (binding.control_points[0] == 60) == pytest.approx(1)
    assert not binding.weight_gradients.any()


def test_coincident_control_points_share_what_they_move():
    """Five at one place, and a point on them: no distance is larger than another, all are 0."""
    control = np.concatenate([np.zeros((5, 3)), np.eye(3)])
    neighbours = np.tile(np.arange(8, dtype=np.int32), (8, 1))
    graph = build_graph(control)
    for i in range(8):  # itself first
        neighbours[i] = np.roll(neighbours[i], -i)
    graph = ControlGraph(
        graph.weights, graph.auxiliary, neighbours, graph.components, graph.mean_spacing
    )
    points = np.array([[0.0, 0, 0], [1e-200, 0, 0], [1e-9, 0, 0], [0.2, 0.1, 0], [1, 0, 0]])
    binding = bind(points, control, graph)
    assert np.isfinite(binding.weights).all() and np.isfinite(binding.weight_gradients).all()
    assert np.abs(binding.weights.sum(1) - 1).max() < F64


def test_a_point_that_is_no_number_is_refused_with_one_sentence():
    points = SURFACE.copy()
    points[3, 1] = np.nan
    points[9] = np.inf
    with pytest.raises(ValueError, match="2 of 400 points to bind are not finite"):
        bind(points, CONTROL, GRAPH)
