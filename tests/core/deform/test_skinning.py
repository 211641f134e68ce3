"""Skinning: points follow their control points without seams, and F is the true derivative."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from objectmorpher_core.base.rotations import matrices_from_quats, quats_from_matrices, turn_matrix
from objectmorpher_core.deform.binding import Binding, bind
from objectmorpher_core.deform.graph import build_graph
from objectmorpher_core.deform.jacobians import LEAST_STRETCH, MOST_STRETCH
from objectmorpher_core.deform.skinning import Motion, Skinned, coupling, skin
from tests import shapes

F64 = 1e-9
SURFACE = shapes.horseshoe(400, seed=5)
CONTROL = shapes.even(shapes.horseshoe(3000), 120)
GRAPH = build_graph(CONTROL)
BINDING = bind(SURFACE, CONTROL, GRAPH)
STILL = np.tile(np.eye(3), (len(CONTROL), 1, 1))


def _bent(amount: float = 0.6) -> Motion:
    """A smooth bend and twist of the control points, with the rotations that belong to it."""
    angle = amount * CONTROL[:, 0]
    rotations = np.stack([turn_matrix(0, 0, np.degrees(a)) for a in angle])
    points = np.einsum("nab,nb->na", rotations, CONTROL) + [0.1, 0.0, 0.0] * CONTROL[:, 1:2]
    return Motion(CONTROL, points, rotations)


def _moved(points: np.ndarray, motion: Motion) -> Skinned:
    return skin(points, bind(points, CONTROL, GRAPH), motion)


# ---- twins ----------------------------------------------------------------------------------


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternion product (4,) wxyz."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector])


def slow_skin(points: np.ndarray, binding: Binding, motion: Motion) -> Skinned:
    """The twin of `skin`: its formulas, one point and one control point at a time; no limits."""
    quats = quats_from_matrices(motion.rotations)
    conjugate = np.array([1, -1, -1, -1])
    moved, linear = np.empty(points.shape), np.empty((len(points), 3, 3))
    for i, x in enumerate(points):
        own, w, grad = (
            v[i] for v in (binding.control_points, binding.weights, binding.weight_gradients)
        )
        u = [motion.rotations[j] @ (x - motion.rest[j]) + motion.points[j] - x for j in own]
        q = [quats[j] if quats[j] @ quats[own[0]] >= 0 else -quats[j] for j in own]
        moments = [_product(np.concatenate([[0], u[k]]), q[k]) for k in range(len(own))]
        b = sum(w[k] * q[k] for k in range(len(own)))
        p = sum(w[k] * moments[k] for k in range(len(own)))
        square = b @ b
        d = _product(p, b * conjugate)[1:] / square
        f = matrices_from_quats(b[None])[0]
        for k in range(len(own)):
            change = _product(moments[k], b * conjugate) + _product(p, q[k] * conjugate)
            f = f + np.outer((change[1:] - 2 * (b @ q[k]) * d) / square, grad[k])
        moved[i], linear[i] = x + d, f
    return Skinned(moved, linear)


def linear_blend(points: np.ndarray, binding: Binding, motion: Motion) -> np.ndarray:
    """Paper Eq. 5, first line: what blended quaternions are measured against."""
    own = binding.control_points
    arms = points[:, None] - motion.rest[own]
    each = np.einsum("nkab,nkb->nka", motion.rotations[own], arms) + motion.points[own]
    return (binding.weights[..., None] * each).sum(1)


def test_the_motion_is_that_of_its_slow_twin():
    motion = _bent(1.0)
    fast, slow = skin(SURFACE, BINDING, motion), slow_skin(SURFACE, BINDING, motion)
    assert np.abs(fast.points - slow.points).max() < F64
    stretches = np.linalg.svd(slow.linear)[1]
    is_within = (stretches.min(1) > LEAST_STRETCH) & (stretches.max(1) < MOST_STRETCH)
    is_within &= np.linalg.det(slow.linear) > 0
    assert is_within.mean() > 0.95
    assert np.abs(fast.linear - slow.linear)[is_within].max() < 1e-8  # gradients x rounding


def test_every_thread_moves_its_own_points():
    points, motion = shapes.horseshoe(10_000, seed=7), _bent()
    many = _moved(points, motion)
    for part in (slice(0, 40), slice(4_990, 5_010), slice(9_981, None)):
        few = _moved(points[part], motion)
        assert np.abs(few.points - many.points[part]).max() < F64
        assert np.abs(few.linear - many.linear[part]).max() < 1e-8


# ---- what stays -----------------------------------------------------------------------------


def test_at_rest_nothing_moves():
    skinned = skin(SURFACE, BINDING, Motion(CONTROL, CONTROL, STILL))
    assert np.array_equal(skinned.points, SURFACE)
    assert np.array_equal(skinned.linear, np.tile(np.eye(3), (len(SURFACE), 1, 1)))


def test_at_rest_nothing_moves_a_thousand_diameters_away_either():
    away = np.array([1000.0, -700.0, 400.0])
    skinned = skin(SURFACE + away, BINDING, Motion(CONTROL + away, CONTROL + away, STILL))
    assert np.abs(skinned.points - SURFACE - away).max() < 1e-12
    assert np.abs(skinned.linear - np.eye(3)).max() < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_a_rigid_motion_is_followed_exactly(seed):
    r, t = shapes.rotation(seed), np.array([1.0, -2.0, 0.5])
    motion = Motion(CONTROL, CONTROL @ r.T + t, np.tile(r, (len(CONTROL), 1, 1)))
    skinned = skin(SURFACE, BINDING, motion)
    assert np.abs(skinned.points - SURFACE @ r.T - t).max() < F64
    assert np.abs(skinned.linear - r).max() < 1e-8  # gradients x rounding


def test_a_long_way_costs_no_digits_of_the_jacobian():
    motion = Motion(CONTROL, CONTROL + [1e6, 0, 0], STILL)
    assert np.abs(skin(SURFACE, BINDING, motion).linear - np.eye(3)).max() < 1e-5


def test_quaternions_of_opposite_sign_blend_as_the_same_rotation():
    """Turns of 170 to 190 degrees: the quaternions of half of them come with the other sign."""
    angles = np.linspace(170, 190, len(CONTROL))
    rotations = np.stack([turn_matrix(0, 0, a) for a in angles])
    motion = Motion(CONTROL, np.einsum("nab,nb->na", rotations, CONTROL), rotations)
    back = turn_matrix(0, 0, -180)  # from where no sign is in doubt
    small = Motion(CONTROL, motion.points @ back.T, back @ rotations)
    turned, plain = skin(SURFACE, BINDING, motion), skin(SURFACE, BINDING, small)
    assert np.abs(turned.points @ back.T - plain.points).max() < F64
    assert np.abs(back @ turned.linear - plain.linear).max() < 1e-8


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_motion_is_the_same_in_every_frame_and_at_every_scale(scale):
    """Rest shape in one frame, pose in another: F turns from the one to the other."""
    before, after, t = shapes.rotation(3), shapes.rotation(4), np.array([3.0, -1.0, 2.0])
    motion = _bent()
    points, control = scale * (SURFACE @ before.T + t), scale * (CONTROL @ before.T + t)
    rotations = after @ motion.rotations @ before.T
    other = Motion(control, scale * (motion.points @ after.T - t), rotations)
    skinned, turned = (
        skin(SURFACE, BINDING, motion),
        skin(points, bind(points, control, build_graph(control)), other),
    )
    expected = scale * (skinned.points @ after.T - t)
    assert np.abs(turned.points - expected).max() < F64 * scale
    assert np.abs(turned.linear - after @ skinned.linear @ before.T).max() < 1e-7


# ---- how it moves ---------------------------------------------------------------------------


def test_the_jacobian_is_the_derivative_of_the_motion():
    """Against central differences; the few points at whose step a neighbour changes are left."""
    motion, step = _bent(), 1e-6
    skinned = skin(SURFACE, BINDING, motion)
    numeric = np.empty((len(SURFACE), 3, 3))
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ahead, behind = _moved(SURFACE + shift, motion), _moved(SURFACE - shift, motion)
        numeric[:, :, axis] = (ahead.points - behind.points) / (2 * step)
    error = np.abs(skinned.linear - numeric).max((1, 2))
    assert np.quantile(error, 0.99) < 1e-6  # step^2 x third derivative + rounding / step


def test_the_motion_has_no_seams():
    """Along lines on the surface, as fine as 1e-4, no step jumps: weights vanish where
    a control point enters or leaves the four."""
    motion = _bent(1.5)
    for around in (0.0, 1.0, 2.5):
        angle = np.linspace(0.4, 5.8, 20_000)
        radius = 0.4 + 0.05 * np.cos(around)
        line = np.column_stack(
            [radius * np.cos(angle), radius * np.sin(angle), np.full(20_000, 0.05 * np.sin(around))]
        )
        steps = np.linalg.norm(np.diff(_moved(line, motion).points, axis=0), axis=1)
        assert steps.max() < 6 * np.median(steps)


@pytest.mark.parametrize("seed", range(5))
def test_no_rotations_are_too_wild(seed):
    """Every control point turned at random, some by half a turn against each other."""
    rng = np.random.default_rng(seed)
    rotations = shapes.rotations(len(CONTROL), seed)
    rotations[::3] = np.diag([1.0, -1.0, -1.0])
    rotations[1::3] = np.eye(3)
    motion = Motion(CONTROL, rng.normal(size=CONTROL.shape), rotations)
    skinned = skin(SURFACE, BINDING, motion)
    assert np.isfinite(skinned.points).all() and np.isfinite(skinned.linear).all()
    stretches = np.linalg.svd(skinned.linear)[1]
    assert stretches.max() < MOST_STRETCH + F64 and stretches.min() > LEAST_STRETCH - F64
    assert np.linalg.det(skinned.linear).min() > 0


def _volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Signed volume inside closed `triangles` (T, 3) of points (N, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def _round_bar(along: int = 120, around: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) of a closed cylinder about x, one long and 0.2 wide, and its triangles."""
    x, angle = np.meshgrid(np.linspace(0, 1, along), np.arange(around) * 2 * np.pi / around)
    x, angle = x.ravel(), angle.ravel()
    points = np.column_stack([x, 0.1 * np.cos(angle), 0.1 * np.sin(angle)])
    hull = ConvexHull(points + 1e-4 * np.sin(np.pi * x)[:, None] * points * [0, 1, 1])  # no ties
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(1) < 0
    triangles = hull.simplices.copy()
    triangles[inward] = triangles[inward, ::-1]
    return points, triangles


@pytest.mark.parametrize(("turn", "loss"), [(180, 0.012), (360, 0.05)])
def test_a_twisted_bar_keeps_its_volume(turn, loss):
    """On 64 control points: linear blending loses 1.4 % at half a turn and 5.3 % at a whole one."""
    points, triangles = _round_bar()
    control = shapes.even(points, 64)
    rotations = np.stack([turn_matrix(0, turn * x, 0) for x in control[:, 0]])  # about x
    motion = Motion(control, np.einsum("nab,nb->na", rotations, control), rotations)
    binding = bind(points, control, build_graph(control))
    twisted = skin(points, binding, motion).points
    assert np.abs(np.linalg.norm(twisted[:, 1:], axis=1) - 0.1).max() < F64
    rest = _volume(points, triangles)
    # what remains is that the triangles are flat
    assert _volume(twisted, triangles) == pytest.approx(rest, rel=0.002)
    assert _volume(linear_blend(points, binding, motion), triangles) < (1 - loss) * rest


# ---- how it depends on the control points ---------------------------------------------------


def test_the_coupling_gives_the_motion_of_the_points():
    motion = _bent(1.5)
    blocks = coupling(BINDING, motion.rotations)
    own = BINDING.control_points
    turned = np.einsum("nkab,nkb->nka", motion.rotations[own], SURFACE[:, None] - CONTROL[own])
    u = turned + motion.points[own] - SURFACE[:, None]
    moved = SURFACE + np.einsum("nkab,nkb->na", blocks, u)
    assert np.abs(moved - skin(SURFACE, BINDING, motion).points).max() < F64
    assert np.abs(blocks.sum(1) - np.eye(3)).max() < F64


def test_without_turns_against_each_other_the_coupling_is_the_weights():
    rotations = np.tile(shapes.rotation(1), (len(CONTROL), 1, 1))
    expected = BINDING.weights[..., None, None] * np.eye(3)
    assert np.abs(coupling(BINDING, rotations) - expected).max() < F64
