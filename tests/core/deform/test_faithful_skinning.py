"""The paper's own motion of the Gaussians (Eq. 5), against a slow twin."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.rotations import matrices_from_quats, quats_from_matrices, turn_matrix
from objectmorpher_core.deform.binding import Binding, bind
from objectmorpher_core.deform.graph import ControlGraph, build_graph
from objectmorpher_core.deform.skinning import Motion, Skinned, skin_faithful, stretches
from tests import shapes

F64 = 1e-9
SURFACE = shapes.horseshoe(400, seed=5)
CONTROL = shapes.even(shapes.horseshoe(3000), 120)
GRAPH = build_graph(CONTROL)
BINDING = bind(SURFACE, CONTROL, GRAPH)


def slow_skin_faithful(
    points: np.ndarray, binding: Binding, motion: Motion, graph: ControlGraph
) -> Skinned:
    """The twin of `skin_faithful`: Eq. 5, a line each, for all points at once."""
    own, weights = binding.control_points, binding.weights
    arms = points[:, None] - motion.rest[own]
    each = np.einsum("nkab,nkb->nka", motion.rotations[own], arms) + motion.points[own]
    moved = (weights[..., None] * each).sum(1)

    quats = quats_from_matrices(motion.rotations)[own]  # (N, K, 4)
    signs = np.where((quats * quats[:, :1]).sum(-1, keepdims=True) < 0, -1, 1)
    blended = (quats * signs * weights[..., None]).sum(1)

    linked = graph.weights.toarray() > 0
    rest = np.linalg.norm(motion.rest[:, None] - motion.rest[None], axis=-1)
    posed = np.linalg.norm(motion.points[:, None] - motion.points[None], axis=-1)
    ratios = np.where(linked, posed / np.where(rest > 0, rest, 1), 0)
    stretch = ratios.sum(1) / linked.sum(1)
    scale = (stretch[own] * weights).sum(1)
    return Skinned(moved, matrices_from_quats(blended) * scale[:, None, None])


def _two_nodes() -> tuple[Binding, ControlGraph, np.ndarray]:
    """A point in the middle between two control points."""
    control = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    weights, nodes = np.array([[0.5, 0.5, 0, 0]]), np.array([[0, 1, 0, 0]], np.int32)
    return Binding(nodes, weights, np.zeros((1, 4, 3))), build_graph(control), control


def test_the_faithful_motion_is_that_of_its_slow_twin():
    rng = np.random.default_rng(0)
    motion = Motion(CONTROL, 3 * rng.normal(size=CONTROL.shape), shapes.rotations(len(CONTROL), 1))
    fast = skin_faithful(SURFACE, BINDING, motion, GRAPH)
    slow = slow_skin_faithful(SURFACE, BINDING, motion, GRAPH)
    assert np.abs(fast.points - slow.points).max() < F64
    # a mean quaternion of opposed ones is short: its direction keeps fewer digits
    assert np.abs(fast.linear - slow.linear).max() < 1e-7


def test_quaternions_of_opposite_sign_blend_as_the_same_rotation():
    """179 and 181 degrees about one axis: their quaternions come out with opposite signs."""
    binding, graph, control = _two_nodes()
    rotations = np.stack([turn_matrix(0, 0, 179), turn_matrix(0, 0, 181)])
    motion = Motion(control, control, rotations)
    linear = skin_faithful(control.mean(0), binding, motion, graph).linear
    assert np.abs(linear[0] - turn_matrix(0, 0, 180)).max() < F64


def test_the_faithful_scale_is_the_mean_stretch_of_the_links():
    binding, graph, control = _two_nodes()
    motion = Motion(control, 1.5 * control, np.tile(np.eye(3), (2, 1, 1)))
    linear = skin_faithful(control.mean(0), binding, motion, graph).linear
    assert np.abs(linear[0] - 1.5 * np.eye(3)).max() < F64


def test_the_faithful_motion_follows_a_rigid_one_exactly():
    r = shapes.rotation(2)
    motion = Motion(CONTROL, CONTROL @ r.T + 1.0, np.tile(r, (len(CONTROL), 1, 1)))
    skinned = skin_faithful(SURFACE, BINDING, motion, GRAPH)
    assert np.abs(skinned.points - SURFACE @ r.T - 1.0).max() < F64
    assert np.abs(skinned.linear - r).max() < F64


def test_coincident_control_points_have_no_stretch_of_their_own():
    control = np.concatenate([CONTROL, CONTROL[:1]])
    motion = Motion(control, 2 * control, np.tile(np.eye(3), (len(control), 1, 1)))
    assert np.abs(stretches(motion, build_graph(control)) - 2).max() < F64
