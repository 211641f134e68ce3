"""Fields between their pixels: the same as four products, wherever one looks."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.lift.relief.canvas import bilinear
from tests.tree import over

F64 = 1e-12
RNG = np.random.default_rng(0)


def _plainly(field: np.ndarray, x: float, y: float) -> np.ndarray:
    height, width = field.shape[:2]
    x, y = min(max(x, 0), width - 1.001), min(max(y, 0), height - 1.001)
    j, i = int(x), int(y)
    (a, b), (c, d) = field[i : i + 2, j : j + 2].astype(np.float64)
    s, t = x - j, y - i
    return (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d)


@over("dtype", [np.float32, np.float64, np.uint8])
@over("more", [(), (1,), (3,), (2, 2)])
def test_a_value_is_the_mean_of_four_pixels_also_beyond_the_field(dtype, more):
    field = (100 * RNG.random((7, 9, *more))).astype(dtype)
    xy = RNG.uniform(-4, 13, (200, 2))
    expected = [_plainly(field, x, y) for x, y in xy]
    assert np.allclose(bilinear(field, xy), expected, rtol=0, atol=100 * F64)


def test_many_are_looked_up_as_few_are():
    """More than one thread takes."""
    field, xy = RNG.random((50, 40, 2)), RNG.uniform(0, 40, (20_000, 2))
    parts = [bilinear(field, part) for part in np.array_split(xy, 40)]
    assert np.array_equal(bilinear(field, xy), np.concatenate(parts))


def test_none_are_looked_up_and_one_row_is_a_field():
    assert bilinear(np.ones((4, 4, 3)), np.empty((0, 2))).shape == (0, 3)
    assert bilinear(np.arange(5.0)[None], np.array([[2.5, 0.0]])) == pytest.approx([2.5])
