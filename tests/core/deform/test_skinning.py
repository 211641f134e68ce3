"""Skinning: points follow their control points without seams, and F is the true derivative."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.graph import Graph, build_graph
from objectmorpher_core.deform.skinning import NEIGHBOURS, Binding, bind, faithful_linear, skin
from objectmorpher_core.rotations import turn_matrix
from tests import shapes

F64 = 1e-9
SURFACE = shapes.horseshoe(400, seed=5)
CONTROL = shapes.even(shapes.horseshoe(3000), 120)
GRAPH = build_graph(CONTROL)


def _bent(amount: float = 0.6) -> tuple[np.ndarray, np.ndarray]:
    """A smooth bend and twist of the control points, with the rotations that belong to it."""
    angle = amount * CONTROL[:, 0]
    rotations = np.stack([turn_matrix(0, 0, np.degrees(a)) for a in angle])
    points = np.einsum("nab,nb->na", rotations, CONTROL) + [0.1, 0.0, 0.0] * CONTROL[:, 1:2]
    return points, rotations


def _moved(points: np.ndarray, pose: tuple[np.ndarray, np.ndarray]):
    return skin(points, bind(points, CONTROL, GRAPH), CONTROL, *pose)


def test_weights_are_positive_sum_to_one_and_their_gradients_to_nothing():
    binding = bind(SURFACE, CONTROL, GRAPH)
    assert binding.control_points.shape == (len(SURFACE), NEIGHBOURS)
    assert binding.weights.min() >= 0
    assert np.abs(binding.weights.sum(1) - 1).max() < F64
    # gradients reach 1e4 per unit where two distances nearly tie
    assert np.abs(binding.weight_gradients.sum(1)).max() < 1e-6


def test_the_nearest_control_point_weighs_most():
    binding = bind(SURFACE, CONTROL, GRAPH)
    gaps = np.linalg.norm(SURFACE[:, None] - CONTROL[None], axis=-1)
    assert np.array_equal(binding.control_points[:, 0], gaps.argmin(1))
    assert (binding.weights[:, 0] >= binding.weights.max(1) - F64).all()


def test_at_rest_nothing_moves():
    rest = CONTROL, np.tile(np.eye(3), (len(CONTROL), 1, 1))
    skinned = _moved(SURFACE, rest)
    assert np.abs(skinned.points - SURFACE).max() < F64
    assert np.abs(skinned.linear - np.eye(3)).max() < 1e-8  # gradients x rounding


def test_a_rigid_motion_is_followed_exactly():
    r, t = shapes.rotation(1), np.array([1.0, -2.0, 0.5])
    skinned = _moved(SURFACE, (CONTROL @ r.T + t, np.tile(r, (len(CONTROL), 1, 1))))
    assert np.abs(skinned.points - SURFACE @ r.T - t).max() < F64
    assert np.abs(skinned.linear - r).max() < 1e-8


def test_the_jacobian_is_the_derivative_of_the_motion():
    """Against central differences; the few points at whose step a neighbour changes are left."""
    pose, step = _bent(), 1e-6
    skinned = _moved(SURFACE, pose)
    numeric = np.empty((len(SURFACE), 3, 3))
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ahead, behind = _moved(SURFACE + shift, pose), _moved(SURFACE - shift, pose)
        numeric[:, :, axis] = (ahead.points - behind.points) / (2 * step)
    error = np.abs(skinned.linear - numeric).max((1, 2))
    assert np.quantile(error, 0.99) < 1e-6  # step^2 x third derivative + rounding / step


def test_the_motion_has_no_seams():
    """Along lines on the surface, as fine as 1e-4, no step jumps: weights vanish where
    a control point enters or leaves the four."""
    pose = _bent(1.5)
    for around in (0.0, 1.0, 2.5):
        angle = np.linspace(0.4, 5.8, 20_000)
        radius = 0.4 + 0.05 * np.cos(around)
        line = np.column_stack(
            [radius * np.cos(angle), radius * np.sin(angle), np.full(20_000, 0.05 * np.sin(around))]
        )
        steps = np.linalg.norm(np.diff(_moved(line, pose).points, axis=0), axis=1)
        assert steps.max() < 6 * np.median(steps)


def test_parts_that_are_near_but_far_along_the_surface_do_not_pull_each_other():
    """The horseshoe's ends: a Gaussian of one never follows a control point of the other."""
    binding = bind(SURFACE, CONTROL, GRAPH)
    side = np.sign(CONTROL[:, 1])[binding.control_points]
    tips = np.abs(np.arctan2(SURFACE[:, 1], SURFACE[:, 0])) < 0.4
    assert tips.any()
    assert (side[tips] == np.sign(SURFACE[tips, 1])[:, None]).all()


def test_fewer_control_points_than_neighbours_still_bind():
    control = shapes.even(shapes.ball(100), 4)
    binding = bind(shapes.ball(20), control, build_graph(control))
    assert np.abs(binding.weights.sum(1) - 1).max() < F64
    assert np.isfinite(binding.weight_gradients).all()


def test_a_control_point_alone_in_its_part_carries_its_gaussians():
    control = np.concatenate([shapes.even(shapes.ball(1000), 60), [[9.0, 0, 0]]])
    graph = build_graph(control)
    assert np.isinf(graph.geodesics[60, :60]).all()
    binding = bind(np.array([[9.01, 0, 0]]), control, graph)
    assert binding.weights[0] @ (binding.control_points[0] == 60) == pytest.approx(1)


# ---- the paper's own motion of the Gaussians (Eq. 5) ----------------------------------------


def _two_node_binding() -> tuple[Binding, Graph, np.ndarray]:
    control = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    weights = 1 - np.eye(2)
    graph = Graph(weights, weights, np.zeros(2, np.int32), 1.0)
    return (
        Binding(np.array([[0, 1]], np.int32), np.full((1, 2), 0.5), np.zeros((1, 2, 3))),
        (graph),
        control,
    )


def test_quaternions_of_opposite_sign_blend_as_the_same_rotation():
    """179 and 181 degrees about one axis: their quaternions come out with opposite signs."""
    binding, graph, control = _two_node_binding()
    rotations = np.stack([turn_matrix(0, 0, 179), turn_matrix(0, 0, 181)])
    linear = faithful_linear(binding, control, control, rotations, graph)
    assert np.abs(linear[0] - turn_matrix(0, 0, 180)).max() < F64


def test_the_faithful_scale_is_the_mean_stretch_of_the_links():
    binding, graph, control = _two_node_binding()
    rotations = np.tile(np.eye(3), (2, 1, 1))
    linear = faithful_linear(binding, control, 1.5 * control, rotations, graph)
    assert np.abs(linear[0] - 1.5 * np.eye(3)).max() < F64


def test_the_faithful_motion_follows_a_rigid_one_exactly():
    binding = bind(SURFACE, CONTROL, GRAPH)
    r = shapes.rotation(2)
    rotations = np.tile(r, (len(CONTROL), 1, 1))
    linear = faithful_linear(binding, CONTROL, CONTROL @ r.T + 1.0, rotations, GRAPH)
    assert np.abs(linear - r).max() < F64
