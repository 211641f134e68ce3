"""Colours that a photo has where it is clear: no edit heeds them, and none changes them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core import api
from objectmorpher_core.base.arrays import Mask, Pixels, crop
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.lighting import Lighting
from objectmorpher_core.compose.refine import refinement
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Photo, Placement
from objectmorpher_core.document.transparency import STEP, colours_of, seen
from objectmorpher_core.pictures.image import Picture, array_of
from objectmorpher_core.scripting.runner import coarse_edit
from tests.core.compose.test_transparency import lifted
from tests.photos import photo

SIZE = 240, 160  # px
RNG = np.random.default_rng(3)
SMALL = cv2.resize(photo("coffee"), SIZE, interpolation=cv2.INTER_AREA)
HIDDEN = {
    "noise": RNG.integers(60, 200, SMALL.shape).astype(np.uint8),
    "white": np.full_like(SMALL, 250),
    "black": np.full_like(SMALL, 4),
    "a photo": cv2.resize(photo("chelsea"), SIZE, interpolation=cv2.INTER_AREA),
}
ITEM = cv2.ellipse(np.zeros(SIZE[::-1], np.uint8), (108, 93), (48, 42), 0, 0, 360, 1, -1) > 0
SHOWN = {  # where the photo is not clear
    "a half": (np.arange(SIZE[0]) < 165) | ITEM,
    "the thing alone": cv2.dilate(ITEM.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0,
}
SOFT = {  # u8 alpha, which fades
    "a soft thing": cv2.GaussianBlur(255 * ITEM.astype(np.uint8), (0, 0), 2.0),
    "a soft half": np.tile(np.clip(20 * (165 - np.arange(SIZE[0])), 0, 255), (SIZE[1], 1)),
}
EDITS = {
    "moved": lambda edit: edit.move(90.0, 20.0).scale(0.7),
    "turned": lambda edit: edit.turn(yaw=25.0),
    "rolled": lambda edit: edit.turn(pitch=5.0, roll=12.0),
    "dragged": lambda edit: edit.pin(108, 125).drag((108, 70), (150, 50)),
}
everywhere = pytest.mark.parametrize("where", SHOWN)


@cache
def _smooth() -> Pixels:
    """Whose light is told well; where the photo has noise, that of its other half is in doubt."""
    return cv2.GaussianBlur(SMALL, (0, 0), 20)


def _picture(ground: Pixels, there: Mask, hidden: str) -> Picture:
    pixels = np.where(there[..., None], ground, HIDDEN[hidden])
    return Picture(pixels, np.where(there, 255, 0).astype(np.uint8))


@cache
def _alike(where: str, is_smooth: bool = False) -> tuple[Document, ...]:
    """The same edit of photos that look alike and hide other colours."""
    ground, there = _smooth() if is_smooth else SMALL, np.broadcast_to(SHOWN[where], ITEM.shape)
    pictures = [_picture(ground, there, hidden) for hidden in HIDDEN]
    first = edits.set_placement(
        lifted(pictures[0], ITEM), 0, Placement(move=(90.0, 20.0), scale=0.7)
    )
    return tuple(replace(first, photo=replace(first.photo, picture=own)) for own in pictures)


def _seen(document: Document) -> np.ndarray:
    """(H, W, 4) what an edit looks like."""
    result = composite(document)
    assert result.alpha is not None
    return np.dstack([np.where(result.alpha[..., None] > 0, result.pixels, 0), result.alpha])


@everywhere
@pytest.mark.parametrize("is_smooth", [False, True], ids=["as it is", "smooth"])
@pytest.mark.parametrize("share", ["harmony", "grain", "defocus", "relight"])
def test_what_is_hidden_changes_nothing_that_is_seen(where, is_smooth, share):
    first, *others = (edits.set_share(d, 0, share, 1.0) for d in _alike(where, is_smooth))
    looks = _seen(first)
    for other in others:
        assert np.array_equal(_seen(other), looks)


def test_the_focus_is_that_of_what_is_seen():
    """Around the ground beside the thing, and of the thing with its outline."""
    found = [Lighting(document).focus for document in _alike("a half", is_smooth=True)]
    beside = [[focus.beside(row, 30.0, 100.0) for row in range(8, 160, 16)] for focus in found]
    assert all(each == beside[0] for each in beside)
    own = [Lighting(d).focus.of_object(d.objects[0].matte) for d in _alike("the thing alone")]
    assert len(set(own)) == 1


def test_around_a_thing_on_clear_ground_nothing_says_what_light_it_has():
    lights = [Lighting(document).light for document in _alike("the thing alone", is_smooth=True)]
    assert all(np.isnan(light).mean() > 0.6 for light in lights)


def _opacity(name: str) -> np.ndarray:
    """(H, W) u8 alpha, by its name in SHOWN or SOFT."""
    if name in SOFT:
        return SOFT[name].astype(np.uint8)
    return np.broadcast_to(SHOWN[name], ITEM.shape).astype(np.uint8) * np.uint8(255)


@cache
def _pictures(name: str) -> tuple[Picture, ...]:
    alpha = _opacity(name)
    return tuple(
        Picture(np.where(alpha[..., None] > 0, SMALL, hidden), alpha) for hidden in HIDDEN.values()
    )


@cache
def _lifts(name: str) -> tuple[api.Edit, ...]:
    """Each lifted anew, by the shape that it is seen to have."""
    opened = [api.open(array_of(picture)).mask(ITEM) for picture in _pictures(name)]
    return tuple(edit.lift(gaussians=6000) for edit in opened)


@pytest.mark.parametrize("name", [*SHOWN, *SOFT])
@pytest.mark.parametrize("edit", EDITS)
def test_of_photos_that_look_alike_each_edit_looks_the_same(name, edit):
    """Also where the thing is selected, cut out, lifted and filled in behind anew."""
    first, *others = (_seen(EDITS[edit](each).render().edited.document) for each in _lifts(name))
    for other in others:
        assert np.array_equal(other, first)


@pytest.mark.parametrize("name", [*SHOWN, *SOFT])
def test_what_is_hidden_is_neither_looked_at_nor_selected_in(name):
    camera = Camera.from_fov(*SIZE)
    for picture in _pictures(name):
        first = _pictures(name)[0]
        assert np.array_equal(colours_of(picture), colours_of(first))
        photos = [Photo(each, camera, b"", "cut.png") for each in (picture, first)]
        assert np.array_equal(seen(photos[0]), seen(photos[1]))


@pytest.mark.parametrize("name", SHOWN)
def test_a_click_selects_the_same_thing_whatever_is_hidden(name):
    opened = [api.open(array_of(picture)).click(108, 93) for picture in _pictures(name)]
    first, *others = (edit.selection for edit in opened)
    assert all(np.array_equal(other, first) for other in others)


def test_the_colours_of_an_opaque_photo_are_its_own():
    solid = np.full(SMALL.shape[:2], 255, np.uint8)
    for picture in (Picture(SMALL), Picture(SMALL, solid)):
        assert colours_of(picture) is picture.pixels


def test_a_thing_alone_on_clear_ground_is_cut_out_as_it_is_there():
    """Its alpha is the photo's, whatever is hidden around it."""
    alpha = SOFT["a soft thing"]
    for edit in _lifts("a soft thing"):
        matte = edit.document.objects[0].matte
        assert matte is not None
        own = crop(alpha, (0, 0, *SIZE), matte.box)
        assert np.abs(matte.alpha - own / 255)[own > 0].max() < STEP


class Paling:
    """Shows what it is shown, with its colours a little nearer to grey."""

    name = "paling"

    def missing(self) -> str | None:
        """Return None: it runs everywhere."""
        return None

    def refine(self, original, coarse, object_alpha, progress, seed=0):
        """Return `coarse`, paler where the edit is."""
        paler = coarse + 0.3 * object_alpha[..., None] * (128 - coarse.astype(np.float32))
        return np.rint(paler).astype(np.uint8)


@everywhere
def test_a_refiner_sees_nothing_that_is_hidden(where):
    first, *others = (coarse_edit(document) for document in _alike(where))
    for other in others:
        assert np.array_equal(other.coarse, first.coarse)
        assert np.array_equal(other.pixels, first.pixels)


@everywhere
def test_a_refined_picture_keeps_the_bytes_that_are_hidden(where):
    """Only what is seen is refined."""
    for document in _alike(where):
        made = refinement.refine(coarse_edit(document), Paling(), silent, 0, 1.0)
        picture, result = document.photo.picture, composite(edits.set_refined(document, made))
        assert picture.alpha is not None and result.alpha is not None
        is_hidden = (picture.alpha == 0) & (result.alpha == 0)
        assert np.array_equal(result.pixels[is_hidden], picture.pixels[is_hidden])
        assert result.shares.from_refiner > 0.3, "and all the rest is"
