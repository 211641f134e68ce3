"""What is put out of focus: how much, and that nothing else changes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import skimage.data

from objectmorpher_core.compose import composite as composing
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.defocus import blurred, measure_blur
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement
from tests import focussed, shapes


@pytest.mark.parametrize("blur", [1.5, 3.0])
@pytest.mark.parametrize("name", ["astronaut", "coffee", "chelsea"])
def test_a_blur_is_measured_by_the_edges(name, blur):
    photo = getattr(skimage.data, name)()
    everywhere = np.ones(photo.shape[:2], bool)
    found = measure_blur(cv2.GaussianBlur(photo, (0, 0), blur), everywhere)
    sharp = measure_blur(photo, everywhere)
    assert sharp is not None and sharp < 1
    assert found == pytest.approx(np.hypot(blur, sharp), rel=0.35)


def test_where_there_are_no_edges_nothing_is_said():
    ramp = np.linspace(40, 200, 200)[None, :, None] * np.ones((120, 1, 3))
    noisy = ramp + np.random.default_rng(0).normal(0, 3, ramp.shape)
    assert measure_blur(noisy.astype(np.uint8), np.ones((120, 200), bool)) is None


def test_what_goes_farther_is_as_blurred_as_the_ground_there():
    for far in (2.0, 3.0):
        document = focussed.scene(far)
        for ratio in (1.5, 1.8):
            true = float(focussed.blur_at(focussed.row_at(ratio), far))
            found = focussed.look(focussed.farther(document, ratio)).blur
            assert found == pytest.approx(true, rel=0.3)


def test_what_keeps_its_depth_or_comes_into_focus_is_not_touched():
    document = focussed.scene(4.0)
    for place in (Placement(move=(40.0, 0.0)), Placement(turn=(0, 25, 0)), Placement(scale=1.3)):
        assert focussed.look(edits.set_placement(document, 0, place)).blur == 0
    sharp = focussed.scene(0.0)
    assert focussed.look(focussed.farther(sharp, 1.8)).blur == 0


def test_of_what_the_frame_cuts_off_only_the_photo_is_asked():
    made = shapes.scene("frame")
    document = edits.set_share(made.document(), 0, "defocus", 1.0)
    far = edits.set_placement(document, 0, Placement(depth=2.0))
    assert made.matte.left < 0 or made.matte.top < 0 or made.matte.box[2] > shapes.WIDTH
    assert focussed.look(far).blur == 0


def test_an_unmoved_object_leaves_the_photo():
    document = focussed.scene(4.0)
    assert np.array_equal(composite(document).pixels, document.photo.pixels)


def test_blur_keeps_what_is_shown_in_sum_and_premultiplied():
    picture = np.zeros((60, 70, 4), np.float32)
    picture[20:40, 25:45] = (0.2, 0.5, 0.9, 1.0)
    soft = blurred(picture, 3.0)
    assert np.allclose(soft.sum((0, 1)), picture.sum((0, 1)), rtol=1e-4)
    there = soft[..., 3] > 1e-3
    assert np.allclose(soft[there][:, :3] / soft[there][:, 3:], (0.2, 0.5, 0.9), atol=1e-3)


def test_strips_and_pieces_change_nothing(monkeypatch):
    document = focussed.farther(focussed.scene(5.0), 1.8)
    assert focussed.look(document).blur > 1
    whole = composite(document)
    monkeypatch.setattr(composing, "STRIP", 20_000)
    parts = composite(document)
    assert np.abs(whole.pixels.astype(int) - parts.pixels).max() <= 1
    assert whole.outside_footprint_changed == 0


def test_a_harmonised_object_is_put_out_of_focus_and_can_be_left():
    document = focussed.farther(focussed.scene(5.0), 1.8)
    assert document.objects[0].defocus > 0
    soft = composite(document)
    sharp = composite(edits.set_share(document, 0, "defocus", 0.0))
    changed = (soft.pixels != sharp.pixels).any(2)
    fine = [cv2.Laplacian(c.pixels.astype(np.float32), -1)[changed].std() for c in (soft, sharp)]
    assert fine[0] < 0.5 * fine[1]
    assert (soft.footprint >= changed).all()
    with pytest.raises(edits.EditError):
        edits.set_share(document, 0, "defocus", 1.2)
