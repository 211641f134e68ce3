"""Handles that are turned, that give way, and that are alone: what the object does then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.model import Handle, Pose
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes

EXACT = 1e-9
BAR = shapes.capsule()


@pytest.fixture(scope="module")
def bar() -> Deformer:
    return Deformer(shapes.lifted_surface(BAR.points, BAR.normals), DeformSettings())


def _handle(deformer: Deformer, at: tuple[float, float, float], **more) -> Handle:
    """On the surface point nearest to `at`; `move` (3,) from there."""
    point = BAR.points[((BAR.points - at) ** 2).sum(1).argmin()]
    move = np.array(more.pop("move", (0.0, 0.0, 0.0)))
    return Handle(deformer.nearest_control_point(point), point, point + move, **more)


def _surface(deformer: Deformer, pose: Pose) -> F64:
    return deformer.skin_points(BAR.points, pose).points


def _twist(deformer: Deformer, pose: Pose) -> F64:
    """Angle about x, rad, by which each ring of the bar turned, from left to right."""
    surface = _surface(deformer, pose)
    angles = []
    for x in np.linspace(-0.35, 0.35, 15):
        ring = np.abs(BAR.points[:, 0] - x) < 0.02
        rest = BAR.points[ring, 1:] @ [1, 1j]
        now = (surface[ring, 1:] - surface[ring, 1:].mean(0)) @ [1, 1j]
        angles.append(np.angle((now * rest.conj()).sum()))
    return np.unwrap(angles)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.7), (1.2, -0.4, 0.3), (3.5, 0.0, 0.0)])
def test_a_turned_handle_is_where_and_how_it_is_told(bar, turn):
    fixed = _handle(bar, (-0.5, 0, 0), is_pin=True)
    moving = _handle(bar, (0.5, 0, 0), move=(-0.1, 0.2, 0.0), turn=turn)
    skinned = bar.skin_points(moving.point, bar.solve((fixed, moving)).pose)
    assert np.abs(skinned.points[0] - moving.target).max() < EXACT
    assert np.abs(skinned.linear[0] - matrix_from_vector(np.array(turn))).max() < 1e-6


def test_two_ends_turned_against_each_other_twist_the_bar_evenly(bar):
    quarter = np.array([np.pi / 2, 0.0, 0.0])
    handles = _handle(bar, (-0.5, 0, 0), turn=-quarter), _handle(bar, (0.5, 0, 0), turn=quarter)
    pose = bar.solve(handles).pose
    twist = _twist(bar, pose)
    assert (np.diff(twist) > 0).all()
    assert np.ptp(twist) > np.radians(90)
    steps = np.diff(twist)
    assert steps.max() < 1.6 * steps.min(), "no part takes all of it"
    surface = _surface(bar, pose)
    assert BAR.volume(surface) == pytest.approx(BAR.volume(BAR.points), rel=0.05)
    middle = np.abs(BAR.points[:, 0]) < 0.3
    radius = np.linalg.norm(surface[middle, 1:], axis=1)
    assert radius.min() > 0.85 * 0.08, "no waist"


def test_more_than_half_a_turn_goes_the_way_it_was_turned(bar):
    fixed = _handle(bar, (-0.5, 0, 0), turn=(0.0, 0.0, 0.0))
    twists = []
    for sign in (1.0, -1.0):
        moving = _handle(bar, (0.5, 0, 0), turn=(sign * np.radians(250), 0.0, 0.0))
        twists.append(np.ptp(_twist(bar, bar.solve((fixed, moving)).pose)))
        assert _twist(bar, bar.solve((fixed, moving)).pose)[-1] * sign > 0
    assert min(twists) > np.radians(130)


def test_one_handle_bends_a_bar_whose_far_end_rests(bar):
    handle = _handle(bar, (0.5, 0, 0), move=(-0.1, 0.35, 0.0))
    pose = bar.solve((handle,)).pose
    surface = _surface(bar, pose)
    moved = np.linalg.norm(surface - BAR.points, axis=1)
    assert moved[BAR.points[:, 0] < -0.3].max() < 0.02, "the far end rests"
    axis = [surface[np.abs(BAR.points[:, 0] - x) < 0.03].mean(0) for x in np.linspace(-0.4, 0.4, 9)]
    heights = np.array(axis)[:, 1]
    assert (np.diff(heights[2:]) > 0).all(), "it rises all the way"
    slopes = np.diff(heights) / np.diff(np.array(axis)[:, 0])
    assert np.abs(np.diff(slopes)).max() < 1.0, "and has no kink"
    assert BAR.volume(surface) == pytest.approx(BAR.volume(BAR.points), rel=0.1)
    length = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
    assert length == pytest.approx(0.8, rel=0.25)


def test_a_soft_pin_gives_way_and_a_hard_one_does_not(bar):
    moving = _handle(bar, (0.5, 0, 0), move=(0.0, 0.3, 0.0))
    ends, misses = (-0.5, 0, 0), []
    for softness in (0.0, 1.0, 100.0):
        middle = _handle(bar, (0.0, 0.08, 0), is_pin=True, softness=softness)
        handles = _handle(bar, ends, is_pin=True), middle, moving
        reached = bar.skin_points(middle.point, bar.solve(handles).pose).points[0]
        misses.append(np.linalg.norm(reached - middle.point))
    assert misses[0] < EXACT
    assert misses[0] < misses[1] < misses[2]


def test_handles_come_and_go_without_a_trace(bar):
    """The state of the solver is a function of the handles, whatever was there before."""
    first = _handle(bar, (-0.5, 0, 0)), _handle(bar, (0.5, 0, 0), move=(0.0, 0.2, 0.1))
    before = bar.solve(first).pose
    more = (*first, _handle(bar, (0.1, 0.08, 0), is_pin=True))
    turned = (first[0], _handle(bar, (0.5, 0, 0), move=(0, 0.2, 0.1), turn=(0.5, 0, 0)))
    for handles in (more, turned, first[:1]):
        bar.solve(handles)
    after = bar.solve(first).pose
    assert before.points.tobytes() == after.points.tobytes()
    assert before.rotations.tobytes() == after.rotations.tobytes()


@pytest.mark.parametrize("nodes", [96, 1600])
def test_few_and_many_control_points_bend_alike(nodes):
    """1,600 are solved by sparse factors, 96 by a dense inverse."""
    lifted = shapes.lifted_surface(BAR.points, BAR.normals, nodes)
    deformer = Deformer(lifted, DeformSettings())
    usual = Deformer(shapes.lifted_surface(BAR.points, BAR.normals), DeformSettings())
    surfaces = []
    for d in (deformer, usual):
        handles = (
            _handle(d, (-0.5, 0, 0), is_pin=True, turn=(0.0, 0.0, 0.0)),
            _handle(d, (0.5, 0, 0), move=(-0.15, 0.4, 0.0), turn=(0.0, 0.0, 1.2)),
        )
        surfaces.append(_surface(d, d.solve(handles).pose))
    assert np.abs(surfaces[0] - surfaces[1]).max() < 0.04  # of an object of length 1


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_size_place_and_direction_of_the_object_do_not_matter(bar, scale):
    r, t = shapes.rotation(6), scale * np.array([3.0, -1.0, 2.0])
    lifted = shapes.lifted_surface(scale * BAR.points @ r.T + t, BAR.normals @ r.T)
    nodes = scale * bar.lifted.control_points @ r.T + t  # of an even bar many are as far apart
    moved = Deformer(replace(lifted, control_points=nodes), DeformSettings())
    handles, others = [], []
    turn = np.array([0.5, 0.0, 0.2])
    for at, move, way in (((-0.5, 0, 0), (0, 0, 0), 0 * turn), ((0.5, 0, 0), (-0.1, 0.3, 0), turn)):
        h = _handle(bar, at, move=move, turn=way)
        handles.append(h)
        point, target = (scale * r @ v + t for v in (h.point, h.target))
        node = h.control_point
        others.append(Handle(node, point, target, turn=r @ way))
    one = _surface(bar, bar.solve(tuple(handles)).pose)
    other = moved.skin_points(scale * BAR.points @ r.T + t, moved.solve(tuple(others)).pose).points
    # Gaussians and control points are float32 and stand up to 4 from the origin
    assert np.abs((other - t) @ r / scale - one).max() < 5e-4
