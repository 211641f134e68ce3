"""Changes of the document: pure, and refused in one sentence where they make no sense."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core import edits
from objectmorpher_core.document import DeformSettings, Document, Placement, Prompt
from objectmorpher_core.edits import EditError
from tests import shapes


@pytest.fixture(scope="module")
def document() -> Document:
    return shapes.scene("ellipse", 300).document()


def _point(document: Document, index: int) -> np.ndarray:
    return document.objects[0].lifted.gaussians.means[index].astype(np.float64)


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
    assert edits.add_object(document, "Cat").objects[1].name == "Cat"


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
