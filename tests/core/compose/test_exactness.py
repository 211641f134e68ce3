"""Thirty random edits of six photos, of 8 and of 16 bits: what an edit does not touch stays."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from objectmorpher_core.compose import load
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.compose.plate.plate import hole_margin, plate_cover
from objectmorpher_core.compose.shadow.old_shadow import traceless_plate
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow
from objectmorpher_core.deform.puppet import Puppet, puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, EditObject, Photo, Placement, Prompt
from objectmorpher_core.document.settings import Shadow
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import lift_mask, make_plate
from objectmorpher_core.raster.texture import TextureLevels
from tests.outlines import silhouette
from tests.photos import NAMES, photo
from tests.shapes import camera, png

SIDE = 420  # px, longer side
EDITS = 5  # of each photo

PHOTOS = [(name, 16 if k % 2 else 8) for k, name in enumerate(NAMES)]

pytestmark = pytest.mark.slow


@cache
def _lifted(name: str, bits: int) -> tuple[Document, Puppet]:
    """A photo with an object whose outline is made up."""
    whole = photo(name)
    scale = SIDE / max(whole.shape[:2])
    size = round(whole.shape[1] * scale), round(whole.shape[0] * scale)
    pixels = cv2.resize(whole, size, interpolation=cv2.INTER_AREA)
    if bits == 16:
        rng = np.random.default_rng(0)
        fine = rng.integers(0, 257, pixels.shape, np.uint16)
        pixels = pixels.astype(np.uint16) * np.uint16(256) + np.minimum(fine, 255)
    rng = np.random.default_rng([NAMES.index(name)])
    height, width = pixels.shape[:2]
    angle = np.arctan2(*np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j])
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    radius = rng.uniform(0.35, 0.5) * (1 + 0.2 * np.cos(3 * angle + rng.uniform(0, 6)))
    mask = np.hypot(x + rng.uniform(-0.2, 0.2), y + rng.uniform(-0.2, 0.2)) < radius
    view = camera(width, height)
    document = Document(Photo(Picture(pixels), view, png(pixels), f"{name}.png"))
    document = edits.set_mask(edits.add_object(document), 0, mask, Prompt())
    document = edits.set_lifted(document, 0, *lift_mask(pixels, view, mask, "relief"))
    plate = make_plate(pixels, plate_cover(document), "telea")
    document = edits.set_plate(document, plate)
    return document, puppet_of(document.objects[0], view)


def _edited(document: Document, rng: np.random.Generator) -> Document:
    """Moved, turned, enlarged, with or without shadow and light."""
    place = Placement(
        move=tuple(rng.uniform(-90, 90, 2)), depth=rng.uniform(-0.3, 0.8),
        turn=tuple(rng.uniform(-40, 40, 3)), scale=rng.uniform(0.6, 1.3),
    )  # fmt: skip
    document = edits.set_placement(document, 0, place)
    if rng.random() < 0.5:
        document = edits.harmonised(document, 0)
    if rng.random() < 0.5:
        shadow = Shadow(rng.uniform(0.2, 1), rng.uniform(0, 360), rng.uniform(0, 1.5))
        document = edits.set_shadow(document, 0, shadow)
    return edits.set_feather(document, rng.uniform(0.5, 2))


def _reach(document: Document, item: EditObject, puppet: Puppet) -> np.ndarray:
    """(H, W) all that an edit without a shadow may change, found another way."""
    width, height = document.photo.size
    where = plate_cover(document).astype(np.uint8)
    assert document.plate is not None
    x0, y0, x1, y1 = document.plate.box  # what the object left beside it is gone, too
    where[y0:y1, x0:x1] |= document.plate.hole
    shape = silhouette(puppet.posed(None, item.placement), _texture(item), puppet.camera)
    if shape is not None:
        matrix = np.array([[shape.pitch, 0, shape.left], [0, shape.pitch, shape.top]])
        new = cv2.warpAffine(
            (shape.alpha > 0).astype(np.uint8), matrix, (width, height), flags=cv2.INTER_NEAREST
        )
        where |= cv2.dilate(new, np.ones((2 * int(np.ceil(shape.pitch)) + 3,) * 2))
    reach = int(np.ceil(document.feather * hole_margin(width, height))) + 6
    return cv2.dilate(where, np.ones((2 * reach + 1,) * 2)) > 0


def _texture(item: EditObject) -> TextureLevels:
    assert item.matte is not None
    return object_texture(item.matte, item.lifted)


@pytest.mark.parametrize(("name", "bits"), PHOTOS)
def test_pixels_outside_the_edit_are_the_photos(name, bits):
    document, puppet = _lifted(name, bits)
    original = document.photo.pixels
    rng = np.random.default_rng([NAMES.index(name), bits])
    for _ in range(EDITS):
        edited = _edited(document, rng)
        result = composite(edited, {0: puppet})
        assert np.array_equal(result.pixels[~result.footprint], original[~result.footprint])
        assert result.outside_footprint_changed == 0
        assert result.changed > 0
        bare = edits.set_shadow(edited, 0, Shadow())
        changed = (composite(bare, {0: puppet}).pixels != original).any(-1)
        assert not (changed & ~_reach(edited, edited.objects[0], puppet)).any()


@pytest.mark.parametrize(("name", "bits"), PHOTOS)
def test_moved_back_it_is_the_photo_byte_for_byte(name, bits):
    document, puppet = _lifted(name, bits)
    edited = _edited(document, np.random.default_rng([7, NAMES.index(name), bits]))
    assert (composite(edited, {0: puppet}).pixels != document.photo.pixels).any()
    item = edited.objects[0]
    assert item.matte is not None
    old = find_old_shadow(document.photo.pixels, item.matte)
    if old is not None:  # also where its shadow was taken off the ground
        pixels, covered = document.photo.pixels, plate_cover(document)
        plate = traceless_plate(pixels, covered, (old,), load("telea"))
        edited = edits.set_plate(edited, plate)
    back = edits.set_placement(edited, 0, Placement())
    assert np.array_equal(composite(back, {0: puppet}).pixels, document.photo.pixels)
