"""Half the size: means of four, whatever is stored and however many rows there are."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import unit_pixels
from objectmorpher_core.segment.matting.halving import doubled, halved, halved_pixels

F32 = 1e-6
RNG = np.random.default_rng(0)


def _plainly(image: np.ndarray) -> np.ndarray:
    height, width = image.shape[:2]
    pads = [(0, height % 2), (0, width % 2)] + [(0, 0)] * (image.ndim - 2)
    whole = np.pad(image.astype(np.float64), pads, mode="edge")
    return 0.25 * sum(whole[i::2, j::2] for i in (0, 1) for j in (0, 1))


@pytest.mark.parametrize("shape", [(6, 8), (7, 9, 3), (1, 1), (1, 6, 8), (5, 1, 2), (700, 11, 3)])
def test_a_pixel_is_the_mean_of_four_and_an_odd_last_one_counts_twice(shape):
    image = RNG.random(shape, np.float32)
    assert np.allclose(halved(image), _plainly(image), rtol=0, atol=F32)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_photos_own_pixels_come_out_in_the_unit_interval(dtype):
    pixels = RNG.integers(0, np.iinfo(dtype).max + 1, (33, 47, 3)).astype(dtype)
    expected = _plainly(unit_pixels(pixels))
    assert np.allclose(halved_pixels(pixels), expected, rtol=0, atol=F32)


def test_what_is_all_object_stays_exactly_so():
    assert (halved(np.ones((5, 7), np.float32)) == 1).all()


def test_doubling_a_ramp_gives_a_ramp():
    ramp = np.arange(8, dtype=np.float32)[None].repeat(8, 0)
    large = doubled(ramp, (16, 15))
    assert large.shape == (16, 15)
    assert np.allclose(np.diff(large[:, 1:-1], axis=1), 0.5, atol=F32)
