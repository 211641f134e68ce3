"""Repairs of the plate: the painted pixels and no others."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objectmorpher_core import compose
from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import hole_margin, plate_picture
from objectmorpher_core.compose.plate.repair import (
    THUMB,
    fill_patch,
    patch_of,
    restored,
    thumbnail,
    with_patch,
)
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes

MARGIN = hole_margin(shapes.WIDTH, shapes.HEIGHT)
pytestmark = pytest.mark.usefixtures("without_weights")


def _stroke(*places: tuple[float, float], radius: float = 6.0, hardness: float = 0.6) -> Stroke:
    stroke = Stroke((shapes.WIDTH, shapes.HEIGHT), Brush(radius, hardness))
    for x, y in places:
        stroke.move_to(x, y)
    return stroke


def _filled(document: Document, stroke: Stroke, name: str = "patchmatch", seed: int = 1):
    patch = fill_patch(patch_of(document, stroke.coverage, stroke.box), MARGIN,
                       compose.load(name), seed=seed)  # fmt: skip
    return edits.set_plate(document, with_patch(document, patch, name))


def _document() -> Document:
    """The background is rough, so that nothing is filled in as it was."""
    document = shapes.scene("ellipse").document()
    noise = np.random.default_rng(5).integers(60, 200, document.plate.pixels.shape, np.uint8)
    return replace(document, plate=replace(document.plate, pixels=noise))


@pytest.mark.parametrize("name", [n for n in compose.BACKENDS if compose.missing(n) is None])
@pytest.mark.parametrize("places", [((80, 60), (95, 66)), ((4, 4), (12, 4)), ((40, 60), (60, 60))])
def test_a_repair_changes_what_is_painted_and_nothing_else(name, places):
    document, stroke = _document(), _stroke(*places)
    repaired = _filled(document, stroke, name)
    before, after = plate_picture(document), plate_picture(repaired)
    painted = stroke.coverage > 0
    assert np.array_equal(after[~painted], before[~painted])
    assert (after != before).any()
    assert repaired.plate.hole.sum() >= document.plate.hole.sum()
    assert repaired.plate.seed == document.plate.seed + 1


@pytest.mark.slow
def test_another_seed_fills_differently_and_strokes_add_up():
    document = _document()
    one, other = _stroke((80, 60), (95, 66)), _stroke((30, 100), (50, 100))
    fills = [plate_picture(_filled(document, one, seed=seed)) for seed in (1, 2)]
    assert (fills[0] != fills[1]).any()
    both = _filled(_filled(document, one), other)
    painted = both.plate.painted
    assert painted is not None
    x0, y0, x1, y1 = both.plate.box
    for stroke in (one, other):
        assert painted[(stroke.coverage > 0)[y0:y1, x0:x1]].all()


def test_a_repair_leaves_no_line():
    """On a slope of grey: a fill of the wrong brightness is joined to what is around it."""
    ramp = np.linspace(60, 160, shapes.WIDTH)[None, :, None].repeat(shapes.HEIGHT, 0).repeat(3, 2)
    document = _document()
    picture = replace(document.photo.picture, pixels=ramp.astype(np.uint8))
    document = replace(document, photo=replace(document.photo, picture=picture))
    document = replace(document, plate=replace(document.plate, pixels=picture.pixels))
    repaired = plate_picture(_filled(document, _stroke((70, 60), (90, 60), radius=10)))
    step = np.abs(np.diff(repaired.astype(int), axis=1)).max()
    assert step <= 8


def test_the_photo_comes_back_where_no_object_hides_it():
    document = _document()
    alpha = document.objects[0].matte.alpha
    stroke = _stroke((80, 20), (80, 100), radius=40, hardness=1.0)
    plate = restored(document, patch_of(document, stroke.coverage, stroke.box))
    changed = edits.set_plate(document, plate)
    wholly = stroke.coverage > 0.999
    x0, y0, x1, y1 = document.objects[0].matte.box
    covered = np.zeros_like(wholly)
    covered[y0:y1, x0:x1] = alpha[max(-y0, 0) :, max(-x0, 0) :] > 0
    after, photo = plate_picture(changed), document.photo.pixels
    assert np.array_equal(after[wholly & ~covered], photo[wholly & ~covered])
    assert np.array_equal(after[covered], plate_picture(document)[covered])
    assert plate.hole.sum() < document.plate.hole.sum()


def test_what_was_painted_far_from_the_object_is_shown_once_something_moves():
    scene, stroke = shapes.scene("ellipse"), _stroke((8, 8), (20, 8))
    repaired = _filled(scene.document(), stroke)
    assert np.array_equal(composite(repaired, {0: scene.puppet}).pixels, scene.pixels)
    moved = edits.set_placement(repaired, 0, Placement(move=(5.0, 0.0)))
    result = composite(moved, {0: scene.puppet})
    painted = stroke.coverage > 0.999
    assert np.array_equal(result.pixels[painted], plate_picture(repaired)[painted])
    assert result.outside_footprint_changed == 0


def test_a_session_keeps_repairs():
    repaired = _filled(_document(), _stroke((80, 60)))
    loaded = decode_session(encode_session(repaired))
    assert np.array_equal(loaded.plate.painted, repaired.plate.painted)
    assert np.array_equal(loaded.plate.pixels, repaired.plate.pixels)
    assert loaded.plate.seed == repaired.plate.seed


@pytest.mark.parametrize("size", [(160, 120), (40, 300)])
def test_thumbnails_have_one_shape_and_what_is_filled_in_their_middle(size):
    document = _document()
    photo = cv2.resize(document.photo.pixels, size)
    hole, color = np.ones((10, 12), bool), np.array([255, 0, 255], np.uint8)
    filled = np.tile(color, (10, 12, 1))
    small = thumbnail(photo, replace(document.plate, left=3, top=4, pixels=filled, hole=hole))
    assert small.shape == (THUMB[1], THUMB[0], 3)
    assert np.array_equal(small[THUMB[1] // 2, THUMB[0] // 2], color)
    assert np.array_equal(small[0, 0], photo[3, 1]), "some of the photo is around it"
