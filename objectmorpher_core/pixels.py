"""Between the photo's own integers and colours in [0, 1]."""

from __future__ import annotations

import numpy as np

from .arrays import F32, Pixels


def unit_pixels(pixels: Pixels) -> F32:
    """u8 or u16 pixels of any shape as sRGB values in [0, 1]."""
    return pixels.astype(np.float32) * np.float32(1.0 / np.iinfo(pixels.dtype).max)


def pixels_from_unit(values: np.ndarray, dtype: np.dtype) -> Pixels:
    """sRGB values, clipped to [0, 1], as u8 or u16, rounded to nearest."""
    return np.rint(np.clip(values, 0, 1) * np.iinfo(dtype).max).astype(dtype)
