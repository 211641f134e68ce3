"""From near to far, and stable."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.raster.binning import depth_order


@pytest.mark.parametrize("count", [0, 1, 2, 5000])
def test_it_is_the_order_of_a_stable_sort(count):
    rng = np.random.default_rng(0)
    even, ties = rng.uniform(2, 4, count), rng.integers(1, 9, count) / 3.0
    for depths in (even, ties, 10.0 ** rng.uniform(-30, 30, count)):
        slow = np.argsort(depths.astype(np.float32), kind="stable")
        assert np.array_equal(depth_order(depths), slow)


def test_what_has_no_depth_is_left_out():
    depths = np.array([3.0, 0.0, 1.0, -2.0, 2.0], np.float32)
    assert depth_order(np.column_stack([depths, depths])[:, 0]).tolist() == [2, 4, 0]
