"""The document: read-only, and what a change makes invalid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    Handle,
    Placement,
    Pose,
    Prompt,
    show_the_same,
)
from objectmorpher_core.document.paint import HARDLY, Paint
from objectmorpher_core.document.sides import FurtherView
from tests import shapes

F64 = 1e-9
PIXEL = 1e-6  # px


@pytest.fixture(scope="module")
def scene() -> shapes.Scene:
    return shapes.scene("ellipse", 300)


@pytest.fixture(scope="module")
def document(scene) -> Document:
    return scene.document()


def test_arrays_of_the_document_cannot_be_written(document):
    item = document.objects[0]
    arrays = [
        document.photo.pixels, item.mask, item.matte.alpha, item.matte.foreground,
        item.lifted.control_points, item.lifted.world_from_object, item.lifted.texture.u0,
        document.plate.pixels, document.plate.hole,
        Pose(np.zeros((3, 3)), np.zeros((3, 3, 3))).points,
        Handle(0, np.zeros(3), np.ones(3)).point,
    ]  # fmt: skip
    assert not any(array.flags.writeable for array in arrays)


def test_a_new_mask_takes_everything_that_was_made_of_the_old_one(document):
    item = replace(document.objects[0], placement=Placement(move=(3.0, 4.0)))
    changed = item.with_mask(shapes.mask("disc"), Prompt())
    assert changed.matte is None
    assert changed.lifted is None
    assert changed.handles == ()
    assert changed.pose is None
    assert changed.placement.is_identity
    assert changed.name == item.name


def test_a_new_lift_takes_handles_and_pose_but_not_the_placement(document, scene):
    lifted = scene.lifted
    item = replace(
        document.objects[0], handles=(shapes.handle(lifted, 0, np.ones(3)),),
        pose=scene.puppet.deformer.rest(), placement=Placement(scale=2.0),
    )  # fmt: skip
    changed = item.with_lifted(scene.matte, lifted)
    assert changed.handles == ()
    assert changed.pose is None
    assert changed.placement.scale == 2.0


def test_the_plate_stays_as_long_as_what_hides_the_background_does(document):
    item = document.objects[0]
    moved = document.with_object(0, replace(item, placement=Placement(move=(5.0, 0.0))))
    assert moved.plate is document.plate
    masked = document.with_object(0, item.with_mask(shapes.mask("disc"), Prompt()))
    assert masked.plate is None
    selected = EditObject("Object 2", mask=shapes.mask("disc"))
    beside = document.with_object(1, selected)
    assert beside.plate is document.plate
    assert beside.with_object(1, selected.with_mask(None, Prompt())).plate is document.plate
    assert beside.with_object(1, replace(selected, matte=item.matte)).plate is None


def test_each_stage_has_one_backend(document):
    twice = (
        document.with_backend("lift", "a").with_backend("inpaint", "b").with_backend("lift", "c")
    )
    assert dict(twice.backends) == {"inpaint": "b", "lift": "c"}


def test_an_object_is_moved_by_pose_placement_or_hiding(document, scene):
    item = document.objects[0]
    assert not item.is_moved
    assert replace(item, placement=Placement(turn=(0.0, 1.0, 0.0))).is_moved
    assert replace(item, pose=scene.puppet.deformer.rest()).is_moved
    assert replace(item, is_visible=False).is_moved
    assert not EditObject("empty", is_visible=False).is_moved


def test_a_refinement_is_of_one_photo_plate_and_look_of_the_objects(document):
    item = document.objects[0]
    renamed = replace(document, objects=(replace(item, name="Cat", is_locked=True),))
    assert show_the_same(document, renamed)
    others = (
        {"photo": replace(document.photo)}, {"plate": replace(document.plate)},
        {"plate": None}, {"horizon": 20.0}, {"feather": 2.0}, {"objects": ()},
        {"depth": np.ones((3, 4), np.float32)},
        {"objects": (replace(item, placement=Placement(depth=1.0)),)},
    )  # fmt: skip
    for other in others:
        assert not show_the_same(document, replace(document, **other)), other.keys()


def test_paint_is_shown_on_the_gaussians_and_not_kept_in_them(document, scene):
    count = len(scene.lifted.gaussians)
    is_painted, apart = np.arange(count) % 2 == 0, np.arange(count) % 3 == 0
    spots = np.where(is_painted[:, None], np.array([0, 255, 0, 255]), 0)
    item = replace(document.objects[0], matte=replace(scene.matte, paint=Paint((), spots, apart)))
    for plain in (document.objects[0], replace(item, lifted=None)):
        assert plain.shown is plain.lifted
    shown, lifted = item.shown, scene.lifted
    assert item.lifted is lifted
    assert (shown.gaussians.colors[is_painted] == [0, 1, 0]).all()
    for own, kept, where in (
        (shown.gaussians.colors, lifted.gaussians.colors, ~is_painted),
        (shown.texture.visibility, lifted.texture.visibility, ~apart),
    ):
        assert np.array_equal(own[where], kept[where])
    assert shown.texture.visibility[apart].max() <= HARDLY < lifted.texture.visibility[apart].max()


VIEW = {
    "pose": np.eye(4), "pixels": np.zeros((5, 7, 3)), "alpha": np.zeros((5, 7)),
    "matches": np.zeros((2, 4)),
}  # fmt: skip


@pytest.mark.parametrize(
    "part",
    [
        {"pose": np.diag([1.0, 1.0, -1.0, 1.0])}, {"pose": np.full((4, 4), np.nan)},
        {"pixels": np.zeros((7, 5, 3))}, {"alpha": np.zeros((5, 7, 1))}, {"alpha": np.zeros(5)},
        {"pixels": np.zeros((0, 7, 3)), "alpha": np.zeros((0, 7))},
        {"matches": np.zeros((2, 3))}, {"matches": np.full((2, 4), np.inf)},
    ],
)  # fmt: skip
def test_a_further_photo_is_taken_where_its_parts_fit_each_other_alone(scene, part):
    assert FurtherView("side.png", scene.camera, left=0, top=0, **VIEW).mask.shape == (5, 7)
    with pytest.raises(ValueError, match=r"further photo|matches"):
        FurtherView("side.png", scene.camera, left=0, top=0, **(VIEW | part))


# ---- a lifted object ------------------------------------------------------------------------


def test_the_object_frame_and_the_world_are_inverse_to_each_other(scene):
    points = shapes.ball(30)
    lifted = scene.lifted
    assert np.abs(lifted.object_points(lifted.world_points(points)) - points).max() < F64


def test_the_diameter_is_the_largest_distance_of_two_control_points(scene):
    p = scene.lifted.control_points.astype(np.float64)
    expected = max(np.linalg.norm(p - q, axis=1).max() for q in p)
    assert scene.lifted.diameter == pytest.approx(expected, rel=F64)


def test_the_centre_is_that_of_the_bounding_box_in_camera_axes(scene):
    world = scene.lifted.world_points(scene.lifted.gaussians.means.astype(np.float64))
    assert np.abs(scene.lifted.centre - (world.min(0) + world.max(0)) / 2).max() < 1e-6


# ---- placement ------------------------------------------------------------------------------


def test_no_placement_is_no_motion(scene):
    assert np.abs(Placement().matrix(scene.lifted, scene.camera) - np.eye(4)).max() < F64


@pytest.mark.parametrize("placement", [
    Placement(move=(-20.0, 7.5)), Placement(move=(4.0, 300.0), turn=(30.0, -20.0, 70.0)),
    Placement(move=(12.0, 3.0), depth=0.7, scale=1.7), Placement(move=(5.0, 5.0), depth=-0.3),
])  # fmt: skip
def test_the_centre_moves_by_exactly_that_many_pixels_and_diameters(scene, placement):
    lifted, camera = scene.lifted, scene.camera
    matrix = placement.matrix(lifted, camera)
    moved = matrix[:3, :3] @ lifted.centre + matrix[:3, 3]
    shift = camera.project(moved) - camera.project(lifted.centre)
    assert np.abs(shift - placement.move).max() < PIXEL
    away = (moved[2] - lifted.centre[2]) / (lifted.diameter * lifted.scale)
    assert away == pytest.approx(placement.depth, abs=F64)


def test_turn_and_scale_are_about_the_centre(scene):
    matrix = Placement(turn=(10.0, 20.0, 30.0), scale=2.5).matrix(scene.lifted, scene.camera)
    centre = scene.lifted.centre
    assert np.abs(matrix[:3, :3] @ centre + matrix[:3, 3] - centre).max() < F64
    assert np.abs(matrix[:3, :3] - 2.5 * turn_matrix(10, 20, 30)).max() < F64


def test_a_placement_is_the_same_motion_each_time_and_of_each_object_its_own(scene):
    """It is remembered; what somebody does with it changes nobody else's."""
    there = scene.lifted
    nearer = np.diag([0.5, 0.5, 0.5, 1.0]) @ there.world_from_object
    other = replace(there, world_from_object=nearer)
    places = [Placement(move=(float(k), 2.0), turn=(k, 0.0, 0.0)) for k in range(1, 20)]
    first = [(p.matrix(there, scene.camera), p.matrix(other, scene.camera)) for p in places]
    for (mine, others), place in zip(first, places, strict=True):
        assert np.array_equal(place.matrix(there, scene.camera), mine)
        assert not np.array_equal(mine, others)
        place.matrix(there, scene.camera)[:] = 0.0
        assert np.array_equal(place.matrix(there, scene.camera), mine)
        wide = replace(scene.camera, focal=2 * scene.camera.focal)
        assert not np.array_equal(place.matrix(there, wide), mine)


def test_a_positive_yaw_takes_what_faces_the_camera_to_the_left(scene):
    lifted = scene.lifted
    front = lifted.centre - [0, 0, 0.1]
    matrix = Placement(turn=(20.0, 0.0, 0.0)).matrix(lifted, scene.camera)
    moved = matrix[:3, :3] @ front + matrix[:3, 3]
    assert scene.camera.project(moved)[0] < scene.camera.project(front)[0]


def test_behind_the_camera_is_refused(scene):
    with pytest.raises(ValueError, match="-50 diameters is behind the camera"):
        Placement(depth=-50.0).matrix(scene.lifted, scene.camera)
