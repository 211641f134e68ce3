"""Handles and rig go over to another shape of the same picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.document import edits
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.key_edits import add_key
from objectmorpher_core.document.model import Document, LiftedObject, LiftSettings, Placement
from objectmorpher_core.document.pose import Base, Pose
from objectmorpher_core.document.rig import Rig
from objectmorpher_core.pipeline import lift_mask
from tests import shapes

thicknesses = pytest.mark.parametrize("thickness", [0.3, 1.8])
MASK = shapes.mask("ellipse")


def _document(count: int = 1500) -> Document:
    return shapes.scene("ellipse", count).document()


def _lifted(document: Document) -> LiftedObject:
    lifted = document.objects[0].lifted
    assert lifted is not None
    return lifted


def _places(lifted: LiftedObject, is_front: bool) -> np.ndarray:
    """Some Gaussians of one side, well inside."""
    texture = lifted.texture
    middle = np.hypot(*((texture.u0 - [78, 62]) / [45, 30]).T) < 0.7
    side = (texture.visibility > 0.5) == is_front
    return np.flatnonzero(middle & side & (texture.solidity > 0.5))[::97][:5]


def _with_handles(document: Document, is_front: bool) -> Document:
    lifted = _lifted(document)
    for i in _places(lifted, is_front):
        point = lifted.gaussians.means[i].astype(np.float64)
        document = edits.add_handle(document, 0, point, point + [0.1, 0.02, -0.05])
    return document


def _seen(lifted: LiftedObject, points: np.ndarray) -> np.ndarray:
    return shapes.camera().project(lifted.world_points(points))


def _lifted_anew(document: Document, settings: LiftSettings, seed: int = 7) -> Document:
    matte, lifted = lift_mask(
        shapes.picture(MASK), shapes.camera(), MASK, "relief", settings, seed=seed
    )
    return edits.reshape(document, 0, matte, lifted, settings)


@thicknesses
@pytest.mark.parametrize("is_front", [True, False], ids=["front", "back"])
def test_a_handle_takes_hold_of_the_same_px_of_the_photo(thickness, is_front):
    before = _with_handles(_document(), is_front)
    after = edits.set_thickness(before, 0, thickness)
    handles = before.objects[0].handles, after.objects[0].handles
    assert len(handles[1]) == len(handles[0]) >= 3
    for old, new in zip(*handles, strict=True):
        places = _seen(_lifted(before), old.point), _seen(_lifted(after), new.point)
        assert np.abs(places[0] - places[1]).max() < 0.01
        assert new.control_point == edits.nearest_control_point(_lifted(after), new.point)


@thicknesses
def test_a_handle_stays_on_its_side(thickness):
    for is_front in (True, False):
        after = edits.set_thickness(_with_handles(_document(), is_front), 0, thickness)
        lifted = _lifted(after)
        for handle in after.objects[0].handles:
            i = int(((lifted.gaussians.means - handle.point) ** 2).sum(1).argmin())
            assert (lifted.texture.visibility[i] > 0.5) == is_front


@thicknesses
def test_a_handle_is_dragged_as_far_in_the_world(thickness):
    before = _with_handles(_document(), True)
    after = edits.set_thickness(before, 0, thickness)
    pairs = zip(before.objects[0].handles, after.objects[0].handles, strict=True)
    for old, new in pairs:
        far = [(h.target - h.point) * _lifted(d).scale for h, d in ((old, before), (new, after))]
        assert np.abs(far[0] - far[1]).max() < 1e-6


@pytest.mark.parametrize("is_front", [True, False], ids=["front", "back"])
def test_a_handle_goes_over_to_a_shape_that_is_lifted_anew(is_front):
    before = _with_handles(_document(), is_front)
    after = _lifted_anew(before, LiftSettings(2500, 1.5))
    lifted = _lifted(after)
    spacing = 160 / 30  # px, more than the Gaussians are apart
    for old, new in zip(before.objects[0].handles, after.objects[0].handles, strict=True):
        gap = np.linalg.norm(_seen(_lifted(before), old.point) - _seen(lifted, new.point))
        assert gap < spacing
        i = int(((lifted.gaussians.means - new.point) ** 2).sum(1).argmin())
        assert (lifted.texture.visibility[i] > 0.5) == is_front
        nearest = edits.nearest_control_point(lifted, new.point)
        assert new.control_point == nearest


def test_pins_softness_and_turns_go_along():
    before = _with_handles(_document(), True)
    before = edits.set_pin(before, 0, 0, True)
    before = edits.soften_handle(before, 0, 1, 0.4)
    before = edits.turn_handle(before, 0, 2, np.array([0.0, 1.0, 0.0]))
    pin, soft, turned, *_ = edits.set_thickness(before, 0, 1.5).objects[0].handles
    assert pin.is_pin
    assert soft.softness == 0.4
    assert turned.turn is not None


def test_of_two_handles_that_would_share_a_control_point_the_later_one_is_gone():
    before = _with_handles(_document(), True)
    item = before.objects[0]
    few = replace(_lifted(before), control_points=_lifted(before).control_points[:2])
    assert item.matte is not None
    after = edits.reshape(before, 0, item.matte, few, item.shape)
    indices = [h.control_point for h in after.objects[0].handles]
    assert len(indices) == len(set(indices)) <= 2
    assert np.allclose(after.objects[0].handles[0].point, item.handles[0].point)


def _region(document: Document) -> np.ndarray:
    """The control points on the left, both sides."""
    lifted = _lifted(document)
    return np.flatnonzero(_seen(lifted, lifted.control_points)[:, 0] < 60).astype(np.int32)


@thicknesses
def test_the_rig_of_the_same_gaussians_stays_as_it_is(thickness):
    before = edits.make_body(_document(), 0, _region(_document()))
    before = edits.freeze(before, 0, _region(before))
    after = edits.set_thickness(before, 0, thickness)
    assert np.array_equal(after.objects[0].rig.bodies[0], before.objects[0].rig.bodies[0])
    assert after.objects[0].rig.held is not None
    assert np.array_equal(after.objects[0].rig.held, before.objects[0].rig.held)


def test_the_rig_of_a_shape_that_is_lifted_anew_covers_the_same_part_of_the_photo():
    before = edits.freeze(_document(), 0, _region(_document()))
    after = _lifted_anew(before, LiftSettings(2500, 0.6))
    held = after.objects[0].rig.held
    assert held is not None
    x = _seen(_lifted(after), _lifted(after).control_points)[:, 0]
    is_held = np.isin(np.arange(len(x)), held)
    assert is_held[x < 55].all()
    assert not is_held[x > 65].any()


@thicknesses
def test_what_was_frozen_away_from_its_rest_is_as_far_from_it_in_the_world(thickness):
    before = _document()
    region = _region(before)
    shifts = np.full((len(region), 3), 0.05)
    before = edits.set_rig(before, 0, Rig(held=region, shifts=shifts))
    after = edits.set_thickness(before, 0, thickness)
    rig = after.objects[0].rig
    assert rig.shifts is not None
    assert np.abs(rig.shifts * _lifted(after).scale - 0.05 * _lifted(before).scale).max() < 1e-6


@thicknesses
def test_there_and_back_is_the_same_edit(thickness):
    before = edits.freeze(_with_handles(_document(), True), 0, _region(_document()))
    there = edits.set_thickness(before, 0, thickness)
    back = edits.set_thickness(there, 0, 1.0)
    for old, new in zip(before.objects[0].handles, back.objects[0].handles, strict=True):
        assert old.control_point == new.control_point
        assert np.abs(old.point - new.point).max() < 1e-5
        assert np.abs(old.target - new.target).max() < 1e-5
    assert np.array_equal(before.objects[0].rig.held, back.objects[0].rig.held)


def test_the_pose_of_handles_is_gone_and_the_settings_are_told():
    after = edits.set_thickness(_with_handles(_document(), True), 0, 1.4)
    assert after.objects[0].pose is None
    assert after.objects[0].shape.thickness == 1.4


TURN = turn_matrix(40.0, -25.0, 60.0)


def _moved_as_one(lifted: LiftedObject) -> Pose:
    """The pose of an object that is turned, and moved in the world, as one body."""
    points = lifted.world_points(lifted.control_points.astype(np.float64))
    moved = lifted.object_points((points - [0, 0, 1]) @ TURN.T + [0.02, -0.01, 1.1])
    return Pose(moved, np.broadcast_to(TURN, (len(moved), 3, 3)))


def _thinner(document: Document) -> Document:
    return edits.set_thickness(document, 0, 0.4)


def _with_another_back(document: Document) -> Document:
    return _lifted_anew(document, LiftSettings(2500, 1.5, back="mirrored"))


shape_changes = pytest.mark.parametrize("change", [_thinner, _with_another_back])


@shape_changes
def test_what_was_moved_as_one_body_is_so_in_another_shape_in_its_key_poses_too(change):
    """A pose that no handle gives, the one from which handles move it, and key poses."""
    before = _document()
    pose, region = _moved_as_one(_lifted(before)), _region(before)
    posed = replace(before.objects[0], pose=pose, base=Base(pose, anchors=region))
    document = add_key(before.with_object(0, replace(posed, handles=(), base=Base())))
    document = document.with_object(0, replace(posed, keys=document.objects[0].keys))
    document = _with_handles(add_key(document), True)
    document = add_key(edits.set_placement(document, 0, Placement(move=(9.0, 0.0))))
    item = change(document).objects[0]
    wanted = _moved_as_one(item.lifted)
    for found in (item.pose, item.base.pose, *(key.pose for key in item.keys)):
        assert found is not None
        np.testing.assert_allclose(found.points, wanted.points, atol=1e-6)
        np.testing.assert_allclose(found.rotations, wanted.rotations, atol=1e-6)
    x = _seen(item.lifted, item.lifted.control_points)[:, 0]
    assert (x[item.base.anchors] < 68).all() and len(item.base.anchors) > (x < 55).sum()
    assert [key.placement.move[0] for key in item.keys] == [0.0, 0.0, 9.0]
    handles = [h.control_point for h in item.handles]
    assert [[h.control_point for h in key.handles] for key in item.keys] == [[], [], handles]


@thicknesses
def test_a_key_pose_is_the_same_after_there_and_back(thickness):
    before = _with_handles(_document(), True)
    solver = shapes.scene("ellipse", 1500).puppet.deformer
    pose = solver.solve(before.objects[0].handles).pose
    before = add_key(edits.set_pose(before, 0, pose))
    back = edits.set_thickness(edits.set_thickness(before, 0, thickness), 0, 1.0)
    (key,) = back.objects[0].keys
    assert np.abs(key.pose.points - pose.points).max() < 1e-5
    assert np.abs(key.pose.rotations - pose.rotations).max() < 1e-9


def test_an_object_that_is_not_lifted_has_no_thickness_to_change():
    document = _document()
    bare = document.with_object(0, replace(document.objects[0], lifted=None))
    with pytest.raises(EditError, match="lift the object"):
        edits.set_thickness(bare, 0, 1.4)


@pytest.mark.parametrize("thickness", [0.0, -1.0, 1e9, float("nan")])
def test_impossible_thicknesses_are_refused(thickness):
    with pytest.raises(ValueError, match="thickness"):
        edits.set_thickness(_document(), 0, thickness)
