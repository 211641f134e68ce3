"""Between the photo's own integers and colours in [0, 1], and between boxes of the photo."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from .arrays import F32, Pixels


class PixelSource(Protocol):
    """The stored pixels of a picture file (H, W, 1..4): an array, or a source of rows like one."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def dtype(self) -> np.dtype: ...

    def __getitem__(self, rows: slice, /) -> np.ndarray: ...


def unit_pixels(pixels: Pixels) -> F32:
    """u8 or u16 pixels of any shape as sRGB values in [0, 1]."""
    return pixels.astype(np.float32) * np.float32(1.0 / np.iinfo(pixels.dtype).max)


def pixels_from_unit(values: np.ndarray, dtype: np.dtype) -> Pixels:
    """sRGB values, clipped to [0, 1], as u8 or u16, rounded to nearest."""
    return np.rint(np.clip(values, 0, 1) * np.iinfo(dtype).max).astype(dtype)


def crop(
    image: np.ndarray, own: tuple[int, int, int, int], box: tuple[int, int, int, int]
) -> np.ndarray:
    """`image`, which covers the box `own` of the photo, cut or padded with 0 to `box`."""
    x0, y0, x1, y1 = box
    result = np.zeros((y1 - y0, x1 - x0, *image.shape[2:]), image.dtype)
    left, top = max(x0, own[0]), max(y0, own[1])
    right, bottom = min(x1, own[2]), min(y1, own[3])
    if left < right and top < bottom:
        result[top - y0 : bottom - y0, left - x0 : right - x0] = image[
            top - own[1] : bottom - own[1], left - own[0] : right - own[0]
        ]
    return result
