"""The photo without its objects: true where it was seen, and without a line where it was not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from objectmorpher_core import compose
from objectmorpher_core.base.arrays import Mask, Pixels
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.compose.plate.plate import (
    SEAM,
    build_plate,
    hole_margin,
    plate_cover,
    plate_crop,
    plate_picture,
)
from objectmorpher_core.document.model import Plate
from tests import shapes

DISC = shapes.mask("disc")
HEIGHT, WIDTH = DISC.shape
pytestmark = pytest.mark.usefixtures("without_weights")


class Off:
    """An inpainter that knows the background, but for a wrong brightness."""

    name = "off"

    def __init__(self, background: Pixels, by: int) -> None:
        self._background, self._by = background, by

    def missing(self) -> str | None:
        return None

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        assert rgb.shape == self._background.shape, "the context reaches to the frame here"
        return np.where(hole[..., None], self._background.astype(int) + self._by, rgb).astype(
            rgb.dtype
        )


def _background(dtype: type = np.uint8) -> Pixels:
    """A slope from dark to light."""
    slope = np.linspace(60, 180, WIDTH)[None, :, None]
    scale = 257 if dtype is np.uint16 else 1
    return (np.broadcast_to(slope, (HEIGHT, WIDTH, 3)) * scale).astype(dtype)


def _with_disc(background: Pixels) -> Pixels:
    return np.where(DISC[..., None], np.iinfo(background.dtype).max, background).astype(
        background.dtype
    )


def _whole(plate: Plate, photo: Pixels) -> Pixels:
    return plate_crop(photo, plate, (0, 0, WIDTH, HEIGHT))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("name", ["telea", "patchmatch"])
def test_outside_the_seam_the_photo_stays(name, dtype):
    photo = _with_disc(_background(dtype))
    plate = build_plate(photo, DISC, compose.load(name))
    assert plate.pixels.dtype == dtype
    seam = SEAM * hole_margin(WIDTH, HEIGHT)
    away = cv2.distanceTransform((~DISC).astype(np.uint8), cv2.DIST_L2, 5)
    assert np.array_equal(_whole(plate, photo)[away > seam], photo[away > seam])
    outside = ~plate.hole
    x0, y0, x1, y1 = plate.box
    assert np.array_equal(plate.pixels[outside], photo[y0:y1, x0:x1][outside])


@pytest.mark.parametrize("by", [-30, 0, 30])
def test_a_fill_of_another_brightness_shows_no_line(by):
    background = _background()
    plate = build_plate(_with_disc(background), DISC, Off(background, by))
    error = np.abs(_whole(plate, background).astype(int) - background).max(2)
    inner = cv2.distanceTransform(DISC.astype(np.uint8), cv2.DIST_L2, 5)
    assert error[inner < 2].max() <= 8  # of 30
    steps = np.abs(np.diff(_whole(plate, background).astype(int), axis=1)).max()
    assert steps <= 4, "nowhere a step; the slope's own is 1"


def test_a_true_fill_is_not_changed():
    background = _background()
    plate = build_plate(_with_disc(background), DISC, Off(background, 0))
    assert np.array_equal(_whole(plate, background), background)


def test_the_same_seed_gives_the_same_plate():
    photo = shapes.picture(DISC)
    plates = [build_plate(photo, DISC, compose.load("patchmatch"), seed=3) for _ in range(2)]
    assert np.array_equal(plates[0].pixels, plates[1].pixels)


def test_what_covers_everything_cannot_be_painted_out():
    with pytest.raises(compose.InpaintError, match="covers everything"):
        build_plate(_background(), np.ones((HEIGHT, WIDTH), bool), compose.load("telea"))


def test_objects_cover_what_their_mattes_touch():
    scene = shapes.scene("ellipse")
    covered = plate_cover(scene.document())
    assert covered[scene.mask].all()
    assert not covered[:10].any()
    assert not plate_cover(replace(scene.document(), objects=())).any()


def test_the_plates_picture_is_the_photo_outside_its_hole():
    scene = shapes.scene("ellipse")
    document = scene.document()
    picture = plate_picture(document)
    hole = document.plate.hole
    assert np.array_equal(picture[~hole], scene.pixels[~hole])
    assert (picture[hole] == 128).all()
