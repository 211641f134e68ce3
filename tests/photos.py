"""Real photographs that come with the development packages."""

from __future__ import annotations

from functools import cache

import numpy as np

NAMES = ("chelsea", "coffee", "astronaut", "rocket", "flower", "china")
OTHERS = ("motorcycle", "camera", "coins")  # the last two are grey


@cache
def photo(name: str) -> np.ndarray:
    """One of NAMES or OTHERS as (H, W, 3) u8 RGB, read-only."""
    if name in ("flower", "china"):
        from sklearn.datasets import load_sample_image

        pixels = load_sample_image(f"{name}.jpg")
    elif name == "motorcycle":
        pixels = _motorcycle()
    else:
        from skimage import data

        pixels = getattr(data, name)()
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    pixels = np.ascontiguousarray(pixels)
    pixels.setflags(write=False)
    return pixels


def _motorcycle() -> np.ndarray:
    """The left one of the stereo pair; `data.stereo_motorcycle` reads the other, too."""
    from pathlib import Path

    import skimage
    from skimage import io

    return io.imread(Path(skimage.__file__).parent / "data" / "motorcycle_left.png")
