"""Pictures at half the size, and back: pixel for pixel, whatever the size."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import F32
from ..pixels import unit_pixels

STRIP = 512  # rows that are converted at a time


def halved(image: F32) -> F32:
    """(h, w, ...) the mean of each 2 x 2 pixels; an odd last row or column counts twice."""
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        more = (0, height % 2, 0, width % 2)
        image = np.asarray(cv2.copyMakeBorder(image, *more, cv2.BORDER_REPLICATE), np.float32)
    size = ((width + 1) // 2, (height + 1) // 2)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def unit(picture: np.ndarray) -> F32:
    """`picture` (h, w, 3), a photo's own pixels or already in [0, 1], in [0, 1]."""
    return picture if picture.dtype == np.float32 else unit_pixels(picture)


def halved_pixels(picture: np.ndarray) -> F32:
    """`halved` of a picture that `unit` takes, without the whole of it as floats."""
    rows = range(0, len(picture), STRIP)
    return np.concatenate([halved(unit(picture[y : y + STRIP])) for y in rows])


def doubled(image: F32, shape: tuple[int, ...]) -> F32:
    """`image` at twice the size, smoothly; `shape` (h, w) is that of what had been halved."""
    height, width = image.shape[:2]
    large = cv2.resize(image, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(large, np.float32)[: shape[0], : shape[1]]
