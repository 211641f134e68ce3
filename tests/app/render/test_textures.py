"""Pictures on the GPU: what is painted in place is uploaded in parts, and is then the whole."""

from __future__ import annotations

from typing import Any

import numpy as np

from objectmorpher.render.gpu_memory import PictureTexture
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.segment.mask_edit import MaskPainting

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures


def test_a_painted_mask_is_the_same_on_the_gpu(context: Any) -> None:
    painting = MaskPainting((97, 61), None, Brush(7.0, 0.3), is_erasing=False)
    texture = PictureTexture(context)
    for x, y in ((10, 10), (30, 20), (96, 60), (-40, -40), (50, 5)):
        painting.move_to(x, y)
        texture.upload(painting.shown, painting.touched)
        uploaded = np.frombuffer(texture.texture.read(alignment=1), np.uint8).reshape(61, 97)
        np.testing.assert_array_equal(uploaded, painting.shown)
    assert painting.shown.any() and not painting.shown.all()


def test_another_picture_of_the_same_size_is_uploaded_whole(context: Any) -> None:
    texture = PictureTexture(context)
    first = MaskPainting((40, 30), None, Brush(5.0), is_erasing=False)
    first.move_to(10, 10)
    texture.upload(first.shown, first.touched)
    second = MaskPainting((40, 30), None, Brush(5.0), is_erasing=False)
    second.move_to(30, 20)
    texture.upload(second.shown, second.touched)
    uploaded = np.frombuffer(texture.texture.read(alignment=1), np.uint8).reshape(30, 40)
    np.testing.assert_array_equal(uploaded, second.shown)


def test_of_a_picture_that_is_shown_small_a_halved_copy_is_uploaded(context: Any) -> None:
    texture = PictureTexture(context)
    picture = np.random.default_rng(0).integers(0, 255, (64, 96, 3), np.uint8)
    for zoom, halved in ((1.0, 1), (0.6, 1), (0.5, 2), (0.3, 2), (0.2, 4), (4.0, 1)):
        texture.upload(picture, (), zoom)
        shape = (64 // halved, 96 // halved, 3)
        uploaded = np.frombuffer(texture.texture.read(alignment=1), np.uint8).reshape(shape)
        blocks = picture.reshape(shape[0], halved, shape[1], halved, 3).mean((1, 3))
        np.testing.assert_allclose(uploaded, blocks, atol=1.0)


def test_what_is_painted_after_it_was_shown_small_is_whole(context: Any) -> None:
    texture = PictureTexture(context)
    painting = MaskPainting((96, 64), None, Brush(7.0), is_erasing=False)
    texture.upload(painting.shown, painting.touched, 0.25)
    for x, y in ((10, 10), (80, 50)):
        painting.move_to(x, y)
        texture.upload(painting.shown, painting.touched, 0.25)
        uploaded = np.frombuffer(texture.texture.read(alignment=1), np.uint8).reshape(64, 96)
        np.testing.assert_array_equal(uploaded, painting.shown)
