"""What stays in front: as it is in the photo, over what is edited, with a clean edge."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from objectmorpher_core.base.arrays import crop, unit_pixels
from objectmorpher_core.compose import load
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.layers import layers
from objectmorpher_core.compose.order import doubt_about_front, reordered, stack
from objectmorpher_core.compose.plate.plate import build_plate, plate_cover, plate_picture
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.model import Document, Placement, Prompt
from objectmorpher_core.pipeline import cut_front
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes

WIDTH, HEIGHT = 320, 120
DISC, POST = 70.0, 210.0  # px, the middles of what moves and of what stays
RADIUS, HALF = 30.0, 12.0
EDGE = 3.0  # px over which the post's edge is soft
BEHIND = Placement(move=(POST - DISC, 0.0), depth=-0.5)  # nearer, and yet behind
WALL, INK, WOOD = (70, 110, 150), (230, 60, 30), (40, 160, 50)  # sRGB, of wall, disc and post
SOFT = 0.04  # of colour: what closed-form matting leaves of the wall in an edge three px wide


def _post(x: np.ndarray) -> np.ndarray:
    """Its alpha: a post from top to bottom with soft sides."""
    return np.clip((HALF - np.abs(x - POST)) / EDGE + 0.5, 0, 1)


@cache
def _document(dtype: type = np.uint8) -> Document:
    """A disc, lifted, and beside it a post that stays in front; a plate behind both."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    disc = np.hypot(x - DISC, y - 60) < RADIUS
    alpha = _post(x)[..., None]
    grain = np.random.default_rng(3).normal(0, 1.5, (HEIGHT, WIDTH, 1))
    ground = np.where(disc[..., None], INK, WALL)
    pixels = np.clip(alpha * WOOD + (1 - alpha) * ground + grain, 0, 255)
    deep = 257 if dtype == np.uint16 else 1
    pixels = np.round(pixels * deep).astype(dtype)
    document = shapes.lifted_scene(pixels, disc, 700).document()
    document = edits.set_mask(edits.add_object(document), 1, _post(x) > 0.5, Prompt())
    mask = document.objects[1].mask
    assert mask is not None
    document = edits.keep_in_front(document, 1, cut_front(pixels, mask))
    return edits.set_plate(document, build_plate(pixels, plate_cover(document), load("telea")))


def _order(document: Document) -> list[int]:
    camera = document.photo.camera

    def posed(k: int):
        item = document.objects[k]
        return puppet_of(item, camera).posed(item.pose, item.placement)

    return list(stack(document, posed))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_where_it_is_opaque_its_bytes_are_the_photos(dtype):
    document = _document(dtype)
    result = composite(edits.set_placement(document, 0, BEHIND))
    matte = document.objects[1].matte
    assert matte is not None
    whole = crop(matte.alpha, matte.box, (0, 0, WIDTH, HEIGHT)) >= 1
    assert whole.sum() > 0.7 * 2 * HALF * HEIGHT
    assert np.array_equal(result.pixels[whole], document.photo.pixels[whole])
    assert result.outside_footprint_changed == 0
    away = ~result.footprint
    assert np.array_equal(result.pixels[away], document.photo.pixels[away])


def test_the_disc_is_seen_on_both_sides_and_none_of_the_wall_in_the_edge():
    """Between the two the edge is a mixture of post and disc, as it was one of post and wall."""
    document = _document()
    pixels = unit_pixels(composite(edits.set_placement(document, 0, BEHIND)).pixels)
    x = np.arange(WIDTH) + 0.5
    alpha = _post(x)[:, None]
    expected = (alpha * WOOD + (1 - alpha) * INK) / 255
    near = np.abs(x - POST) < HALF + 8
    row = pixels[56:64].mean(0)
    assert np.abs(row - expected)[near].max() < SOFT
    unedited = unit_pixels(document.photo.pixels)[56:64].mean(0)
    assert np.abs(row - unedited)[near].max() > 0.5


def test_where_nothing_moves_behind_it_nothing_changes():
    document = _document()
    photo = document.photo.pixels
    assert np.array_equal(composite(document).pixels, photo)
    beside = edits.set_placement(document, 0, Placement(move=(12.0, 0.0)))
    assert _order(beside) == [0]
    assert np.array_equal(composite(beside).pixels[:, 170:], photo[:, 170:])


def test_a_hidden_or_released_one_covers_nothing():
    moved = edits.set_placement(_document(), 0, BEHIND)
    at = (60, int(POST))
    for changed in (edits.set_visible(moved, 1, False), edits.stop_keeping_in_front(moved, 1)):
        assert _order(changed) == [0]
        shown = composite(changed).pixels[at].astype(int)
        assert np.abs(shown - INK).max() < 40


def test_an_object_can_be_put_before_it():
    moved = edits.set_placement(_document(), 0, BEHIND)
    assert _order(moved) == [0, 1]
    camera = moved.photo.camera

    def posed(k: int):
        item = moved.objects[k]
        return puppet_of(item, camera).posed(item.pose, item.placement)

    assert _order(reordered(moved, 0, [1, 0], posed)) == [1, 0]


def test_the_background_keeps_it():
    """Its hole is filled in for the sake of the edge, and it stands there all the same."""
    document = _document()
    picture = plate_picture(document)
    photo = document.photo.pixels
    assert document.plate is not None and document.plate.hole[60, int(POST) - document.plate.left]
    matte, mask = document.objects[1].matte, document.objects[1].mask
    assert matte is not None and mask is not None
    whole = crop(matte.alpha, matte.box, (0, 0, WIDTH, HEIGHT)) >= 1
    assert np.array_equal(picture[whole], photo[whole])
    assert np.abs(picture[mask].astype(int) - photo[mask]).max() < 255 * SOFT
    assert np.abs(picture[60, int(DISC)].astype(int) - WALL).max() < 12, "the disc is gone"


def test_its_layer_is_among_the_layers():
    moved = edits.set_placement(_document(), 0, BEHIND)
    moved = edits.rename(moved, 1, "Post")
    result, pile = layers(moved)
    assert "Post" in [layer.name for layer in pile]
    flat = np.zeros((HEIGHT, WIDTH, 3))
    for layer in (each for each in pile if each.is_shown):
        x0, y0, x1, y1 = layer.box
        own = unit_pixels(layer.pixels)
        alpha = own[..., 3:] if own.shape[2] == 4 else 1.0
        flat[y0:y1, x0:x1] += alpha * (own[..., :3] - flat[y0:y1, x0:x1])
    assert np.abs(flat - unit_pixels(result.pixels)).max() < 3 / 255


def test_a_session_keeps_it():
    moved = edits.set_placement(_document(), 0, BEHIND)
    again = decode_session(encode_session(moved))
    assert again.objects[1].stays_in_front
    assert np.array_equal(composite(again).pixels, composite(moved).pixels)


def test_what_moved_or_is_not_selected_cannot_stay_in_front():
    moved = edits.set_placement(_document(), 0, BEHIND)
    with pytest.raises(EditError, match="moved"):
        edits.keep_in_front(moved, 0)
    with pytest.raises(EditError, match="nothing is selected"):
        edits.keep_in_front(edits.add_object(moved), 2)


def test_another_mask_is_cut_out_anew_and_a_lift_ends_it():
    document = _document()
    item = document.objects[1]
    assert item.mask is not None
    again = item.with_mask(np.roll(item.mask, 1, axis=1), item.prompt)
    assert again.stays_in_front and again.matte is None
    disc = document.objects[0]
    assert disc.matte is not None and disc.lifted is not None
    lifted = replace(item, lifted=None).with_lifted(disc.matte, disc.lifted)
    assert not lifted.stays_in_front


def test_a_front_that_hides_what_moves_or_is_the_background_is_doubted():
    moved = edits.set_placement(_document(), 0, BEHIND)
    posed = puppet_of(moved.objects[0], moved.photo.camera).posed(None, BEHIND)

    def doubted(front: np.ndarray) -> str | None:
        document = edits.set_mask(edits.add_object(moved), 2, front, Prompt())
        return doubt_about_front(document, 2, lambda _: posed)

    y, x = np.mgrid[:HEIGHT, :WIDTH]
    assert doubt_about_front(moved, 1, lambda _: posed) is None  # the post, as it is meant
    hidden = doubted(np.abs(x - POST) < 2 * RADIUS)
    assert hidden is not None and "hides" in hidden and moved.objects[0].name in hidden
    around = doubted((x < 40) | (y < 20) | (y > HEIGHT - 20))
    assert around == "touches 4 sides of the photo" or around == "touches 3 sides of the photo"
    assert doubted((np.abs(x - POST) < HALF) & (y > 40) & (y < 60)) is None
