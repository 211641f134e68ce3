"""From handles to a pose: what is held, what follows, and that handles are reached."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.deform.arap import ArapSolver, iterate
from objectmorpher_core.deform.constraints import Constraints, Targets
from objectmorpher_core.deform.deformer import ANCHORED_SHARE, FAITHFUL_ITERATIONS, Deformer
from objectmorpher_core.deform.interpolation import PoseInterpolation
from objectmorpher_core.document.model import Handle
from objectmorpher_core.document.pose import UNHELD, Pose
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes

F64 = 1e-9
F32 = 1e-6  # control points are float32 numbers below 1
ARAP = DeformSettings()


def _deformer(cloud: np.ndarray, count: int = 150, settings: DeformSettings = ARAP) -> Deformer:
    control = shapes.even(cloud, count).astype(np.float32)
    return Deformer(shapes.lifted_cloud(cloud[:400], control), settings)


def _at(deformer: Deformer, near: tuple[float, float, float], move=(0.0, 0.0, 0.0)) -> Handle:
    node = deformer.nearest_control_point(np.array(near))
    return shapes.handle(deformer.lifted, node, np.array(move))


def _surface_handle(deformer: Deformer, index: int, move: np.ndarray) -> Handle:
    """A handle on a Gaussian, between control points."""
    point = deformer.lifted.gaussians.means[index].astype(np.float64)
    return Handle(deformer.nearest_control_point(point), point, point + move)


@pytest.fixture(scope="module")
def bar() -> Deformer:
    return _deformer(shapes.bar(3000))


@pytest.mark.parametrize("move", [(0.0, 0.3, 0.0), (-0.4, 0.6, 0.2), (0.0, 0.0, -1.5)])
def test_every_handle_is_reached_exactly(bar, move):
    handles = (_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0), move), _at(bar, (0.0, 0.06, 0)))
    solution = bar.solve(handles)
    for handle in handles:
        reached = bar.skin_points(handle.point, solution.pose).points[0]
        assert np.abs(reached - handle.target).max() < F64


def test_a_handle_between_control_points_is_reached_exactly(bar):
    rng = np.random.default_rng(0)
    handles = tuple(_surface_handle(bar, i, rng.normal(size=3) * 0.2) for i in (3, 80, 200, 333))
    solution = bar.solve(handles)
    for handle in handles:
        reached = bar.skin_points(handle.point, solution.pose).points[0]
        assert np.abs(reached - handle.target).max() < F64


@pytest.mark.parametrize("settings", [
    DeformSettings(mode="laplacian"), DeformSettings(links="euclidean"),
    DeformSettings(is_faithful=True),
], ids=["laplacian", "euclidean", "faithful"])  # fmt: skip
def test_the_ablations_reach_their_handles_too(settings):
    deformer = _deformer(shapes.bar(3000), settings=settings)
    handles = (_at(deformer, (-0.5, 0, 0)), _at(deformer, (0.5, 0, 0), (0.0, 0.3, 0.1)))
    pose = deformer.solve(handles).pose
    for handle in handles:
        reached = deformer.skin_points(handle.point, pose).points[0]
        if settings.is_faithful:  # the paper constrains the control point itself
            reached = pose.points[handle.control_point]
        assert np.abs(reached - handle.target).max() < F64


def test_the_paper_moves_the_control_point_by_as_much_as_the_clicked_one():
    deformer = _deformer(shapes.bar(3000), settings=DeformSettings(is_faithful=True))
    fixed, moving = (
        _surface_handle(deformer, 3, np.zeros(3)),
        _surface_handle(deformer, 202, np.array([0.1, 0.3, 0.0])),
    )
    assert np.abs(deformer.points[moving.control_point] - moving.point).max() > 1e-3
    pose = deformer.solve((fixed, moving)).pose
    moved = pose.points[moving.control_point] - deformer.points[moving.control_point]
    assert np.abs(moved - [0.1, 0.3, 0.0]).max() < F64


def test_the_papers_pose_is_three_iterations_on_its_graph_with_no_stiffer_hands():
    deformer = _deformer(shapes.bar(3000), settings=DeformSettings(is_faithful=True))
    handles = (_at(deformer, (-0.5, 0, 0)), _at(deformer, (0.5, 0, 0), (0.0, 0.3, 0.1)))
    pose = deformer.solve(handles, UNHELD).pose
    solver = ArapSolver(deformer.points, deformer.graph.weights)
    solver.constrain(Constraints.on_nodes(np.array([h.control_point for h in handles])))
    targets = np.array([h.target for h in handles])
    solver.aim(Targets(targets, np.empty((0, 3)), np.empty((0, 3, 3))))
    papers = iterate(solver, deformer.rest().rotations, FAITHFUL_ITERATIONS)
    assert np.abs(pose.points - papers.positions).max() < F64


def test_laplacian_editing_turns_nothing():
    deformer = _deformer(shapes.bar(3000), settings=DeformSettings(mode="laplacian"))
    handles = (_at(deformer, (-0.5, 0, 0)), _at(deformer, (0.5, 0, 0), (-0.3, 0.5, 0.0)))
    assert np.array_equal(
        deformer.solve(handles).pose.rotations, np.tile(np.eye(3), (len(deformer.points), 1, 1))
    )


def test_a_bend_costs_less_with_rotations_than_without():
    moves = ((-0.5, 0, 0), (0, 0, 0)), ((0.5, 0, 0), (-0.3, 0.6, 0.0))
    energies = []
    for mode in ("arap", "laplacian"):
        deformer = _deformer(shapes.bar(3000), settings=DeformSettings(mode=mode))
        handles = tuple(_at(deformer, near, move) for near, move in moves)
        energies.append(deformer.solve(handles).energies[-1])
    assert energies[0] < 0.5 * energies[1]


def test_no_handle_is_no_deformation(bar):
    solution = bar.solve(())
    assert np.array_equal(solution.pose.points, bar.points)
    assert solution.energies == (0.0,)


def test_handles_that_are_not_dragged_leave_the_object_at_rest(bar):
    solution = bar.solve((_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0))))
    assert np.abs(solution.pose.points - bar.points).max() < F64
    assert solution.energies[-1] < F64


def test_three_rigidly_moved_handles_carry_the_whole_object(bar):
    r, t = shapes.rotation(8), np.array([0.2, 0.1, -0.3])
    places = ((-0.5, 0, 0.06), (0.5, 0.06, 0), (0.0, -0.06, 0), (0.1, 0.06, 0.06))
    handles = []
    for place in places:
        handle = _at(bar, place)
        handles.append(Handle(handle.control_point, handle.point, r @ handle.point + t))
    solution = bar.solve(tuple(handles))
    assert np.abs(solution.pose.points - bar.points @ r.T - t).max() < F64
    assert np.abs(solution.pose.rotations - r).max() < F64
    means = bar.lifted.gaussians.means
    skinned = bar.skin_gaussians(solution.pose)
    assert np.abs(skinned.points - means @ r.T - t).max() < F64
    assert np.abs(skinned.linear - r).max() < 1e-8  # weights' gradients x rounding
    assert solution.energies[-1] < F64


def test_handles_that_are_nearly_moved_as_one_body_nearly_are(bar):
    """No leap where the rigid answer ends and the solver's begins."""
    r, places = (
        shapes.rotation(8),
        ((-0.5, 0, 0.06), (0.5, 0.06, 0), (0.0, -0.06, 0), (0.1, 0.06, 0)),
    )
    handles = [_at(bar, place) for place in places]
    moved = [Handle(h.control_point, h.point, r @ h.point) for h in handles]
    nudged = replace(moved[1], target=moved[1].target + [1e-7, 0, 0])
    rigid, solved = bar.solve(tuple(moved)), bar.solve((moved[0], nudged, *moved[2:]))
    assert rigid.energies == (0.0,)
    assert len(solved.energies) > 1
    assert np.abs(rigid.pose.points - solved.pose.points).max() < 1e-4


def test_one_handle_holds_the_far_quarter(bar):
    handle = _at(bar, (0.5, 0, 0), (0.0, 0.3, 0.0))
    anchors = bar.anchors((handle,))
    assert len(anchors) == pytest.approx(ANCHORED_SHARE * len(bar.points), abs=1)
    assert bar.points[anchors, 0].max() < 0
    pose = bar.solve((handle,)).pose
    assert np.abs(pose.points[anchors] - bar.points[anchors]).max() < F64
    assert np.abs(pose.points - bar.points).max() > 0.2


def test_one_handle_without_anchors_carries_the_object_as_it_is(bar):
    handle = _at(bar, (0.5, 0, 0), (0.0, 0.3, 0.0))
    pose = bar.solve((handle,), base=UNHELD).pose
    assert np.abs(pose.points - bar.points - [0.0, 0.3, 0.0]).max() < F64


def test_a_pin_or_a_second_handle_takes_the_place_of_the_anchors(bar):
    one, two = _at(bar, (0.5, 0, 0), (0, 0.3, 0)), _at(bar, (-0.5, 0, 0))
    pin = Handle(one.control_point, one.point, one.point, is_pin=True)
    assert len(bar.anchors((one, two))) == 0
    assert len(bar.anchors((pin,))) == 0


def test_a_part_without_a_handle_follows_the_nearest_part_rigidly():
    part = shapes.bar(2000)
    deformer = _deformer(np.concatenate([part, part[::2] + [0.0, 0.8, 0.0]]), 200)
    assert deformer.graph.component_count == 2
    handles = (_at(deformer, (-0.5, 0, 0)), _at(deformer, (0.5, 0, 0), (-0.2, 0.5, 0.1)))
    pose = deformer.solve(handles).pose
    upper = deformer.points[:, 1] > 0.4
    r = pose.rotations[upper][0]
    assert np.abs(np.linalg.det(r) - 1) < F64
    rest, now = deformer.points[upper], pose.points[upper]
    assert np.abs(now - now[0] - (rest - rest[0]) @ r.T).max() < F64
    assert np.abs(pose.rotations[upper] - r).max() < F64


def test_the_result_depends_on_the_handles_alone(bar):
    """Not on what was solved before with the same deformer."""
    handles = (_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0), (-0.2, 0.5, 0.1)))
    others = (_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0), (0.3, -0.4, 0.0)))
    first = bar.solve(handles).pose
    bar.solve(others)
    bar.solve((others[1],))
    again = bar.solve(handles).pose
    assert np.array_equal(first.points, again.points)
    assert np.array_equal(first.rotations, again.rotations)


def test_a_drag_in_small_steps_ends_near_the_one_solved_from_rest(bar):
    fixed = _at(bar, (-0.5, 0, 0))
    pose = None
    for step in range(1, 21):
        moving = _at(bar, (0.5, 0, 0), np.array([-0.2, 0.5, 0.1]) * step / 20)
        pose = bar.solve((fixed, moving), start=pose).pose
    cold = bar.solve((fixed, moving)).pose
    assert np.abs(pose.points - cold.points).max() < 1e-2  # of an object of size 1


def test_the_solve_ends_within_one_percent_of_the_minimum(bar):
    handles = (_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0), (-0.5, 0.7, 0.2)))
    found = bar.solve(handles)
    pose = found.pose
    for _ in range(10):  # and on from there
        longer = bar.solve(handles, start=pose)
        pose = longer.pose
    assert found.energies[-1] <= 1.01 * longer.energies[-1]


def test_energies_fall_while_solving(bar):
    handles = (_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0), (-0.5, 0.7, 0.2)))
    energies = np.array(bar.solve(handles).energies)
    # Handles between control points have targets that follow the rotations: a last plain step
    # may cost a little, measured below 2e-5 of the energy.
    assert (np.diff(energies) <= 1e-4 * energies[0]).all()


def test_gaussians_move_with_the_skin(bar):
    handles = (_at(bar, (-0.5, 0, 0)), _at(bar, (0.5, 0, 0), (-0.2, 0.5, 0.1)))
    pose = bar.solve(handles).pose
    skinned = bar.skin_gaussians(pose)
    points = bar.skin_points(bar.lifted.gaussians.means, pose)
    assert np.array_equal(skinned.points, points.points)
    assert np.array_equal(skinned.linear, points.linear)


@pytest.mark.parametrize("settings", [DeformSettings(mode="jelly"), DeformSettings(links="magic")])
def test_unknown_settings_are_refused(settings):
    with pytest.raises(ValueError, match="must be"):
        _deformer(shapes.ball(500), 40, settings)


@pytest.mark.parametrize("move", [(0.1, 0.0, 0.0), (0.0, -0.1, 0.05)])
def test_a_dragged_point_takes_its_surroundings_along(move):
    cloud = np.random.default_rng(3).permutation(shapes.sheet(60, 36, 0.06))
    deformer = _deformer(cloud, 300)
    handle = _at(deformer, (0.1, 0.0, 0.0), move)
    moved = deformer.solve((handle,)).pose.points - deformer.points
    share = moved @ np.array(move) / np.dot(move, move)
    away = np.linalg.norm(deformer.points - handle.point, axis=1)
    edges = np.array([0.03, 0.08, 0.13, 0.2, 0.3, 0.4])
    rings = [share[(away > a) & (away <= b)].mean() for a, b in pairwise(edges)]
    assert rings[0] > 0.4, "no spike"
    assert (np.diff(rings) < 0).all(), "less and less with the distance"


def test_two_handles_close_together_part_as_far_as_they_are_told():
    deformer = _deformer(shapes.sheet(60, 36, 0.06), 300)
    first, second = _at(deformer, (0.0, 0.0, 0.0)), _at(deformer, (0.05, 0.0, 0.0), (0.03, 0, 0))
    assert first.control_point != second.control_point
    pose = deformer.solve((first, second)).pose
    for handle in (first, second):
        reached = deformer.skin_points(handle.point, pose).points[0]
        assert np.abs(reached - handle.target).max() < F64


def _twisted(points: np.ndarray, most: float) -> Pose:
    """Turned about the bar's own axis, from not at all at one end to `most` radians."""
    angles = most * (points[:, 0] - points[:, 0].min()) / np.ptp(points[:, 0])
    turns = np.array([matrix_from_vector(np.array([angle, 0.0, 0.0])) for angle in angles])
    return Pose((turns @ points[:, :, None])[:, :, 0], turns)


def _rigid(points: np.ndarray, vector: np.ndarray, move: np.ndarray) -> Pose:
    turn = matrix_from_vector(vector)
    return Pose(points @ turn.T + move, np.broadcast_to(turn, (len(points), 3, 3)))


@pytest.mark.parametrize("degrees", [10.0, 90.0, 175.0])
def test_the_way_between_two_poses_carries_round_what_turns(bar, degrees):
    """Rigid at both ends it is rigid between, but for what a straight way of few degrees takes."""
    points = bar.points - bar.points.mean(0)
    first = _rigid(points, np.array([0.4, -1.0, 0.3]), np.zeros(3))
    axis = np.array([0.0, 0.6, 0.8]) * np.radians(degrees)
    again = matrix_from_vector(axis)
    turns = again @ first.rotations
    last = Pose(first.points @ again.T + [0.2, 0.1, 0.0], turns)
    way = PoseInterpolation(bar, first, last)
    for share, pose in ((0.0, first), (1.0, last)):
        found = way.at(share)
        np.testing.assert_allclose(found.points, pose.points, atol=1e-9)
        np.testing.assert_allclose(found.rotations, pose.rotations, atol=1e-9)
    for share in (0.2, 0.5):
        found = way.at(share)
        turned = matrix_from_vector(share * axis) @ first.rotations[0]
        np.testing.assert_allclose(found.rotations - turned, 0, atol=1e-9)
        spread = found.points - found.points.mean(0)
        assert np.abs(spread - points @ turned.T).max() < 0.01 * bar.diameter


def test_two_sides_of_a_thing_do_not_part_ways_at_half_a_turn(bar):
    """One end is twisted by 300 degrees, which are 60 the other way round."""
    rest, last = bar.rest(), _twisted(bar.points, np.radians(300.0))
    half = _twisted(bar.points, np.radians(150.0))
    found = PoseInterpolation(bar, rest, last).at(0.5)
    np.testing.assert_allclose(found.rotations, half.rotations, atol=1e-9)
    assert np.abs(found.points - half.points).max() < 0.02 * bar.diameter


def test_what_stays_in_two_poses_stays_on_the_way_and_the_rest_bends(bar):
    held = _at(bar, (-0.5, 0.0, 0.0))
    held = replace(held, is_pin=True, turn=np.zeros(3))
    bent = replace(_at(bar, (0.5, 0.0, 0.0), (-0.5, 0.5, 0.0)), turn=np.radians([0.0, 0.0, 150.0]))
    last = bar.solve((held, bent)).pose
    way = PoseInterpolation(bar, bar.rest(), last)
    is_still = np.linalg.norm(last.points - bar.points, axis=1) < 1e-9
    assert is_still.sum() > 2
    most = [bar.strain(pose).most.max() for pose in (last, way.at(0.25), way.at(0.5))]
    assert max(most[1:]) < most[0]
    for share in (0.25, 0.5, 0.75):
        found = way.at(share)
        gaps = np.linalg.norm(found.points - bar.points, axis=1)[is_still]
        assert gaps.max() < 1e-3 * bar.diameter
        assert bar.strain(found).least.min() > 0.5
