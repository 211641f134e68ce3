"""Changes of the document: pure, and refused in one sentence where they make no sense."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.document import edits
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.model import BesidePrompt, Click, Document, Placement, Pose, Prompt
from objectmorpher_core.document.rig import Rig, Seam
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.segment.mask_edit import feather, grow, shrink
from tests import shapes


@pytest.fixture(scope="module")
def document() -> Document:
    return shapes.scene("ellipse", 300).document()


def _point(document: Document, index: int) -> np.ndarray:
    return document.objects[0].lifted.gaussians.means[index].astype(np.float64)


REGIONS = np.array([0, 1, 2], np.int32), np.array([5, 6], np.int32)


def test_other_objects_are_background_but_the_one_that_is_clicked(document):
    mask = document.objects[0].mask
    (y, x), (far_y, far_x) = np.argwhere(mask)[0], np.argwhere(~mask)[0]
    beside = edits.beside(document, 1, Prompt((Click(far_x, far_y),)))
    assert isinstance(beside, BesidePrompt)
    np.testing.assert_array_equal(beside.taken, mask)
    assert beside == edits.beside(document, 1, Prompt((Click(far_x, far_y),)))
    on_it, own = Prompt((Click(x, y),)), Prompt((Click(far_x, far_y),))
    assert edits.beside(document, 1, on_it) is on_it
    assert edits.beside(document, 0, own) is own
    width, height = document.photo.size
    for at in ((0, height), (width, 0), (-1, y)):  # on nothing: to be refused with the prompt
        outside = edits.beside(document, 1, Prompt((Click(*at),)))
        assert isinstance(outside, BesidePrompt)
        np.testing.assert_array_equal(outside.taken, mask)


def test_a_handle_turns_and_softens(document):
    changed = edits.add_handle(document, 0, _point(document, 5))
    changed = edits.turn_handle(changed, 0, 0, np.array([0.0, 4.0, 0.0]))
    changed = edits.soften_handle(changed, 0, 0, 0.5)
    handle = changed.objects[0].handles[0]
    assert handle.turn is not None
    assert handle.turn.tolist() == [0.0, 4.0, 0.0], "more than half a turn stays as it is"
    assert handle.softness == 0.5
    assert edits.turn_handle(changed, 0, 0, None).objects[0].handles[0].turn is None
    with pytest.raises(EditError, match="softness"):
        edits.soften_handle(changed, 0, 0, -1.0)


def test_regions_are_cut_glued_and_made_bodies(document):
    changed = edits.cut(document, 0, *REGIONS)
    changed = edits.glue(changed, 0, np.array([9]), np.array([11]))
    assert [s.is_glued for s in changed.objects[0].rig.seams] == [False, True]
    changed = edits.make_body(changed, 0, np.array([0, 1, 2, 3]))
    changed = edits.make_body(changed, 0, np.array([3, 4, 3]))
    assert [b.tolist() for b in changed.objects[0].rig.bodies] == [[0, 1, 2], [3, 4]]
    assert document.objects[0].rig.seams == ()


@pytest.mark.parametrize(("rig", "sentence"), [
    (Rig(seams=(Seam([0, 1], [1, 2]),)), "two sides of a seam share"),
    (Rig(seams=(Seam([], [1, 2]),)), "holds no control point"),
    (Rig(bodies=([0, 1], [1, 2])), "two rigid bodies share"),
    (Rig(held=[0, 100_000]), "beyond the object's"),
    (Rig(held=[-1]), "beyond the object's"),
    (Rig(stiffness=[1.0, 2.0]), "stiffnesses for"),
    (Rig(shifts=np.zeros((1, 3))), "does not say where"),
    (Rig(held=[0, 1], shifts=np.zeros((1, 3))), "does not say where"),
    (Rig(held=[0], shifts=np.full((1, 3), np.nan)), "finite"),
])  # fmt: skip
def test_impossible_rigs_are_refused(document, rig, sentence):
    with pytest.raises(EditError, match=sentence):
        edits.set_rig(document, 0, rig)


def test_freezing_remembers_where_points_are_and_thawing_forgets_it(document):
    rest = document.objects[0].lifted.control_points.astype(np.float64)
    at_rest = edits.freeze(document, 0, np.array([4, 2]))
    assert at_rest.objects[0].rig.held.tolist() == [2, 4]
    assert at_rest.objects[0].rig.shifts is None
    moves = np.random.default_rng(3).normal(size=rest.shape)
    pose = Pose(rest + moves, np.broadcast_to(np.eye(3), (len(rest), 3, 3)))
    posed = edits.freeze(edits.set_pose(at_rest, 0, pose), 0, np.array([3, 7]))
    rig = posed.objects[0].rig
    assert rig.held.tolist() == [2, 3, 4, 7]
    np.testing.assert_allclose(rig.shifts[[0, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(rig.shifts[[1, 3]], moves[[3, 7]], atol=1e-12)
    assert [rig.is_held(node) for node in (2, 5, 7)] == [True, False, True]
    left = edits.thaw(posed, 0, np.array([3, 5])).objects[0].rig
    assert left.held.tolist() == [2, 4, 7]
    np.testing.assert_allclose(left.shifts[2], moves[7], atol=1e-12)
    assert edits.thaw(posed, 0, rig.held).objects[0].rig.shifts is None
    reset = edits.reset_pose(posed, 0).objects[0]
    assert reset.rig.held.tolist() == [2, 3, 4, 7]
    assert (reset.rig.shifts, reset.pose, reset.handles) == (None, None, ())
    nearest = np.array([7, 0, 7, 3])
    moved = rig.moved_to(nearest)
    assert moved.held.tolist() == [0, 2, 3]
    np.testing.assert_allclose(moved.shifts, moves[[7, 7, 3]], atol=1e-12)


def test_a_stiffness_must_be_above_nothing(document):
    count = len(document.objects[0].lifted.control_points)
    with pytest.raises(EditError, match="not above 0"):
        edits.set_rig(document, 0, Rig(stiffness=np.zeros(count)))


def test_other_control_points_keep_handles_and_regions_where_they_were(document):
    points = document.objects[0].lifted.control_points
    left = np.flatnonzero(points[:, 0] < -0.1)
    right = np.flatnonzero(points[:, 0] > 0.1)
    changed = edits.add_handle(document, 0, _point(document, 5))
    changed = edits.make_body(edits.cut(changed, 0, left, right), 0, left)
    changed = edits.resample(changed, 0, 60)
    item = changed.objects[0]
    assert len(item.lifted.control_points) == 60
    assert item.lifted.gaussians is document.objects[0].lifted.gaussians
    gaps = np.linalg.norm(item.lifted.control_points - item.handles[0].point, axis=1)
    assert item.handles[0].control_point == gaps.argmin()
    assert (item.lifted.control_points[item.rig.bodies[0], 0] < 0).all()
    assert (item.lifted.control_points[item.rig.seams[0].second, 0] > 0).all()
    assert item.pose is None
    for count in (3, 5000):
        with pytest.raises(EditError, match="control points"):
            edits.resample(changed, 0, count)


def test_a_change_leaves_the_document_it_was_made_from(document):
    before = document.objects
    changed = edits.set_visible(edits.add_object(document), 0, False)
    assert document.objects is before
    assert document.objects[0].is_visible
    assert not changed.objects[0].is_visible
    assert changed.objects[0].mask is document.objects[0].mask, "what did not change is shared"


def test_objects_come_and_go(document):
    two = edits.add_object(document)
    assert [o.name for o in two.objects] == ["Object 1", "Object 2"]
    one = edits.remove_object(two, 0)
    assert [o.name for o in one.objects] == ["Object 2"]


@pytest.mark.parametrize(("mask", "sentence"), [
    (np.zeros((120, 160), bool), "nothing is selected"),
    (np.ones((120, 160), bool), "covers the whole photo"),
    (np.ones((120, 161), bool), r"the mask is \(120, 161\), the photo is \(120, 160\)"),
])  # fmt: skip
def test_impossible_masks_are_refused(document, mask, sentence):
    with pytest.raises(EditError, match=sentence):
        edits.set_mask(document, 0, mask, Prompt())


def test_a_mask_is_copied_read_only(document):
    changed = edits.set_mask(document, 0, shapes.mask("disc"), Prompt())
    assert not changed.objects[0].mask.flags.writeable


def test_a_handle_stays_until_it_is_dragged(document):
    changed = edits.add_handle(document, 0, _point(document, 5))
    handle = changed.objects[0].handles[0]
    assert np.array_equal(handle.point, handle.target)
    moved = edits.move_handle(changed, 0, 0, handle.point + 0.1)
    assert np.abs(moved.objects[0].handles[0].target - handle.point - 0.1).max() < 1e-12
    assert edits.remove_handle(moved, 0, 0).objects[0].handles == ()


def test_two_handles_on_one_control_point_with_two_targets_are_an_error(document):
    point = _point(document, 5)
    once = edits.add_handle(document, 0, point, point + [0.1, 0.0, 0.0])
    with pytest.raises(EditError, match="two points take the same control point"):
        edits.add_handle(once, 0, point, point + [0.0, 0.1, 0.0])
    again = edits.add_handle(once, 0, point, point + [0.1, 0.0, 0.0])
    assert len(again.objects[0].handles) == 1, "the same wish twice is one handle"


def test_a_pin_where_a_handle_pulls_is_an_error(document):
    point = _point(document, 5)
    pinned = edits.add_handle(document, 0, point, is_pin=True)
    with pytest.raises(EditError, match="to different places"):
        edits.add_handle(pinned, 0, point, point + 0.2)


def test_a_handle_needs_a_lifted_object(document):
    with pytest.raises(EditError, match="lift the object before"):
        edits.add_handle(edits.add_object(document), 1, np.zeros(3))


@pytest.mark.parametrize(("placement", "sentence"), [
    (Placement(scale=0.0), "a scale of 0 is not above 0"),
    (Placement(scale=-1.0), "a scale of -1 is not above 0"),
    (Placement(scale=float("nan")), "a scale of nan is not above 0"),
    (Placement(depth=-99.0), "behind the camera"),
])  # fmt: skip
def test_impossible_placements_are_refused(document, placement, sentence):
    with pytest.raises(EditError, match=sentence):
        edits.set_placement(document, 0, placement)


def test_other_settings_of_the_deformation_put_the_object_to_rest(document):
    deformer = shapes.scene("ellipse", 300).puppet.deformer
    posed = edits.set_pose(document, 0, deformer.rest())
    changed = edits.set_deform(posed, 0, DeformSettings(mode="laplacian"))
    assert changed.objects[0].pose is None
    assert changed.objects[0].deform.mode == "laplacian"


def test_lifting_and_inpainting_are_recorded(document):
    scene = shapes.scene("ellipse", 300)
    lifted = edits.set_lifted(document, 0, scene.matte, scene.lifted)
    plate = edits.set_plate(lifted, shapes.grey_plate(scene.mask))
    assert dict(plate.backends) == {"lift": "relief", "inpaint": "made"}
    assert edits.set_plate(plate, None).plate is None


def test_handles_do_not_cost_the_plate(document):
    assert edits.add_handle(document, 0, _point(document, 1)).plate is document.plate


def _prompted(document: Document, mask: np.ndarray) -> Document:
    return edits.set_mask(document, 0, mask, Prompt((Click(80.0, 60.0),)))


def test_a_mask_changed_by_hand_remembers_what_the_prompt_gave(document):
    mask = shapes.mask("disc")
    changed = edits.change_mask(_prompted(document, mask), 0, grow(mask, 3))
    changed = edits.change_mask(changed, 0, grow(mask, 6))
    item = changed.objects[0]
    np.testing.assert_array_equal(item.found, mask)
    np.testing.assert_array_equal(item.mask, grow(mask, 6))
    assert item.lifted is not None and item.shaped is not None  # it is to be refitted
    by_hand = edits.change_mask(edits.set_mask(document, 0, mask, Prompt()), 0, grow(mask, 3))
    by_hand = edits.change_mask(by_hand, 0, shrink(mask, 3)).objects[0]
    np.testing.assert_array_equal(by_hand.found, mask)  # what was erased is known without a prompt


def test_corrections_survive_every_later_answer(document):
    mask, painted = shapes.mask("disc"), np.zeros_like(shapes.mask("disc"))
    painted[5:12, 5:30] = True
    changed = edits.change_mask(_prompted(document, mask), 0, mask | painted)
    for answer in (mask | painted, shrink(mask, 4), grow(mask, 4)):  # the first one agrees
        clicks = (*changed.objects[0].prompt.clicks, Click(90.0, 60.0))
        changed = edits.answer_prompt(changed, 0, answer, Prompt(clicks))
        assert changed.objects[0].mask is not None
        assert changed.objects[0].mask[painted].all()
        np.testing.assert_array_equal(changed.objects[0].mask[20:], answer[20:])


def test_a_soft_edge_survives_where_the_outline_does(document):
    mask = shapes.mask("disc")
    changed = edits.change_mask(_prompted(document, mask), 0, feather(mask, 4))
    answer = mask.copy()
    answer[:, :60] = False
    clicks = (Click(80.0, 60.0), Click(50.0, 60.0, False))
    item = edits.answer_prompt(changed, 0, answer, Prompt(clicks)).objects[0]
    np.testing.assert_array_equal(item.mask, answer)
    assert item.coverage is not None
    assert not ((item.coverage > 0) & (item.coverage < 255))[:, :55].any()
    np.testing.assert_array_equal(item.coverage[:, 80:], feather(mask, 4)[:, 80:])


def test_a_coverage_that_is_hard_everywhere_is_just_a_mask(document):
    mask = shapes.mask("disc")
    item = edits.set_mask(document, 0, mask * np.uint8(255), Prompt()).objects[0]
    assert item.coverage is None
    np.testing.assert_array_equal(item.mask, mask)
    assert item.selection is item.mask


@pytest.mark.parametrize(
    "depth", [np.ones(4), np.ones((2, 0)), np.array([[1.0, np.nan]]), np.ones((2, 2, 1))]
)
def test_a_depth_map_that_is_none_is_refused(document, depth):
    with pytest.raises(EditError, match="number for each"):
        edits.set_depth(document, depth)
    assert edits.set_depth(document, np.ones((2, 3))).depth.shape == (2, 3)


def test_thawing_what_is_not_frozen_changes_nothing(document):
    assert edits.thaw(document, 0, REGIONS[0]) is document
    flat = document.with_object(0, replace(document.objects[0], lifted=None))
    assert edits.thaw(flat, 0, REGIONS[0]) is flat


def test_a_stiffness_is_a_positive_finite_number_for_each_control_point():
    Rig(stiffness=np.array([1e-300, 1e300])).check(2)
    for wrong in ([1.0, np.inf], [0.0, 1.0], [1.0, np.nan], [1.0, -1.0], [1.0]):
        with pytest.raises(ValueError, match="stiffness"):
            Rig(stiffness=np.array(wrong)).check(2)
