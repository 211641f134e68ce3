"""Real photographs that come with the development packages."""

from __future__ import annotations

from functools import cache

import numpy as np

NAMES = ("chelsea", "coffee", "astronaut", "rocket", "flower", "china")


@cache
def photo(name: str) -> np.ndarray:
    """One of NAMES as (H, W, 3) u8 RGB, read-only."""
    if name in ("flower", "china"):
        from sklearn.datasets import load_sample_image

        pixels = load_sample_image(f"{name}.jpg")
    else:
        from skimage import data

        pixels = getattr(data, name)()
    pixels = np.ascontiguousarray(pixels)
    pixels.setflags(write=False)
    return pixels
