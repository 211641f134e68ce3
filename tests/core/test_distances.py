"""Distances are exact, and the same wherever memory lies."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from objectmorpher_core.base.poisson_disk import distance_inside


def test_distances_are_those_of_the_definition():
    mask = np.random.default_rng(0).random((300, 2000)) > 0.0005
    expected = distance_transform_edt(mask).astype(np.float32)
    np.testing.assert_array_equal(distance_inside(mask), expected)


def test_far_away_they_are_as_exact_as_their_numbers_are():
    mask = np.ones((40, 6000), bool)
    mask[3, 7] = False
    np.testing.assert_allclose(distance_inside(mask), distance_transform_edt(mask), rtol=3e-7)


def test_every_call_gives_the_same_bits():
    mask = np.zeros((88, 118), bool)
    mask[20:70, 30:90] = True
    first = distance_inside(mask)
    kept = []  # so that the answers lie at other addresses
    for size in np.random.default_rng(0).integers(1, 100_000, 40):
        kept.append((np.empty(size, np.uint8), distance_inside(mask)))
    assert all(np.array_equal(first, again) for _, again in kept)
