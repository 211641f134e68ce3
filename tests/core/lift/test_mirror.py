"""Mirror axes: a symmetric picture's is found, noise has none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.document.model import Matte
from objectmorpher_core.lift.relief.canvas import ReliefCanvas
from objectmorpher_core.lift.relief.mirror import MirrorAxis, find_axis
from tests.tree import over

EXACT = 1e-9
SIZE = 240  # px


def _noise(seed: int, side: int = SIZE) -> F32:
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.normal(size=(SIZE, SIZE, 3)), (0, 0), 7)
    noise = np.clip(0.5 + 0.25 * noise / noise.std(), 0, 1)
    return cv2.resize(noise, (side, side)).astype(np.float32)


def _body(side: int = SIZE) -> F32:
    """A pear: it has one axis, the upright one in its middle."""
    y, x = (np.mgrid[:side, :side] + 0.5) / side - 0.5
    return (np.hypot(x, 0.8 * y - 0.02) < 0.22 + 0.15 * y).astype(np.float32)


def _symmetric(picture: F32) -> F32:
    return 0.5 * (picture + picture[:, ::-1])


def _turned(picture: F32, degrees: float) -> F32:
    middle = (SIZE / 2 - 0.5, SIZE / 2 - 0.5)
    warp = cv2.getRotationMatrix2D(middle, -degrees, 1.0)  # OpenCV's positive angles are ours < 0
    return np.asarray(
        cv2.warpAffine(picture, warp, (SIZE, SIZE), borderMode=cv2.BORDER_REPLICATE), np.float32
    )


@over("degrees", [-30.0, -15.0, 0.0, 15.0, 30.0])
@over("seed", range(3))
def test_a_symmetric_picture_has_its_axis(seed, degrees):
    alpha, rgb = _turned(_body(), degrees), _turned(_symmetric(_noise(seed)), degrees)
    axis = find_axis(ReliefCanvas.of(Matte(100, 50, alpha, rgb)))
    assert axis.is_sure
    angle = np.degrees(np.arctan2(axis.normal[1], axis.normal[0]))
    assert angle == pytest.approx(degrees, abs=1)
    middle = np.array([100.0, 50.0]) + SIZE / 2
    assert float(np.array(axis.normal) @ middle) == pytest.approx(axis.offset, abs=0.02 * SIZE)


@pytest.mark.parametrize("seed", range(6))
def test_noise_has_no_axis_however_symmetric_its_outline(seed):
    axis = find_axis(ReliefCanvas.of(Matte(0, 0, _body(), _noise(seed))))
    assert axis.overlap > 0.85
    assert not axis.is_sure


def test_a_lopsided_outline_has_no_axis_however_plain_its_colours():
    y, x = (np.mgrid[:SIZE, :SIZE] + 0.5) / SIZE
    alpha = ((np.hypot(x - 0.35, y - 0.4) < 0.25) | (np.abs(y - 0.8 * x - 0.2) < 0.04)).astype(
        np.float32
    )
    rgb = np.full((SIZE, SIZE, 3), 0.5, np.float32)
    assert not find_axis(ReliefCanvas.of(Matte(0, 0, alpha, rgb))).is_sure


def test_what_is_hidden_belongs_to_the_outline_but_its_colours_tell_nothing():
    """A quarter of the object is behind something else."""
    alpha, rgb = _body().copy(), _symmetric(_noise(2)).copy()
    hidden = np.zeros((SIZE, SIZE), bool)
    hidden[100:, 140:] = alpha[100:, 140:] > 0.5
    alpha[hidden], rgb[hidden] = 0, [1, 0, 1]
    assert not find_axis(ReliefCanvas.of(Matte(0, 0, alpha, rgb))).is_sure
    axis = find_axis(ReliefCanvas.of(Matte(0, 0, alpha, rgb), hidden))
    assert axis.is_sure
    assert axis.offset == pytest.approx(SIZE / 2, abs=0.02 * SIZE)


def test_a_photo_of_another_size_has_the_same_axis():
    one = find_axis(ReliefCanvas.of(Matte(0, 0, _body(), _symmetric(_noise(1)))))
    large = cv2.resize(_symmetric(_noise(1)), (3 * SIZE, 3 * SIZE))
    three = find_axis(ReliefCanvas.of(Matte(0, 0, _body(3 * SIZE), np.asarray(large, np.float32))))
    assert three.offset == pytest.approx(3 * one.offset, rel=0.01)
    assert three.normal == one.normal


@over("width", [60, 100, 150, 210, 400])
def test_the_axis_is_in_the_middle_whatever_the_width(width):
    """It is looked for in a smaller picture, whose sides are whole px."""
    tall = (width, 1000)
    alpha, rgb = (cv2.resize(p, tall) for p in (_body(), _symmetric(_noise(1))))
    axis = find_axis(ReliefCanvas.of(Matte(30, 0, np.asarray(alpha), np.asarray(rgb))))
    assert axis.normal == (1.0, 0.0)
    assert axis.offset == pytest.approx(30 + width / 2, abs=0.1)


def test_a_mirror_image_of_a_mirror_image_is_the_place_itself():
    axis = MirrorAxis((float(np.cos(0.3)), float(np.sin(0.3))), 40.0, 1.0, 1.0)
    xy = np.random.default_rng(0).uniform(0, 100, (5, 7, 2))
    image = axis.mirrored(xy)
    assert np.abs(axis.mirrored(image) - xy).max() < EXACT * 100
    half_way = 0.5 * (image + xy)
    assert np.abs(half_way @ np.array(axis.normal) - 40.0).max() < EXACT * 100


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (3, 3)])
def test_a_picture_of_few_pixels_has_an_answer(shape):
    axis = find_axis(
        ReliefCanvas.of(Matte(0, 0, np.ones(shape, np.float32), np.ones((*shape, 3), np.float32)))
    )
    assert np.isfinite(axis.offset)
