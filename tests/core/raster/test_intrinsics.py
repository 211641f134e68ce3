"""Instructions of `raster/intrinsics.py`, compiled anew: what they compute, in plain numbers."""

from __future__ import annotations

import numpy as np
from numba import njit, types

from objectmorpher_core.raster.intrinsics import bytes_over

FOUR = types.UniTuple(types.float32, 4)


@njit(types.int32(FOUR, types.float32, FOUR, types.float32))  # nothing is kept on the disk
def _mixed(over, alpha, under, rest):
    return bytes_over(over, alpha, under, rest)


def test_a_pixel_over_another_is_rounded_to_the_nearest_byte():
    rng = np.random.default_rng(0)
    for _ in range(300):
        over, under = rng.random((2, 4)).astype(np.float32)
        alpha = np.float32(rng.choice([0.0, 1.0, rng.random()]))
        rest = np.float32(1) - alpha
        word = np.int32(_mixed(tuple(over), alpha, tuple(under), rest))
        exact = 255 * (alpha * over.astype(np.float64) + rest * under.astype(np.float64))
        made = np.frombuffer(word.tobytes(), np.uint8)
        assert np.abs(made - exact).max() < 0.5 + 1e-4
    white = (np.float32(1),) * 4
    assert np.int32(_mixed(white, np.float32(1), white, np.float32(0))).tobytes() == b"\xff" * 4
