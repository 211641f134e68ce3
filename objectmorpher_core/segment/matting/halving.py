"""Pictures at half the size, and back: pixel for pixel, whatever the size."""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, frozen, unit_pixels
from ...base.kernel_files import numba
from ...base.threads import in_threads

LEAST_ROWS = 128  # for which a second thread is woken


def halved(image: np.ndarray) -> F32:
    """(h, w, ...) the mean of each 2 x 2 pixels; an odd last row or column counts twice."""
    return _scaled(image, 1.0)


def halved_pixels(picture: np.ndarray) -> F32:
    """`halved` of a picture that `unit` takes, without the whole of it as floats."""
    is_unit = picture.dtype == np.float32
    return _scaled(picture, 1.0 if is_unit else 1.0 / np.iinfo(picture.dtype).max)


def unit(picture: np.ndarray) -> F32:
    """`picture` (h, w, 3), a photo's own pixels or already in [0, 1], in [0, 1]."""
    return picture if picture.dtype == np.float32 else unit_pixels(picture)


def doubled(image: F32, shape: tuple[int, ...]) -> F32:
    """`image` at twice the size, smoothly; `shape` (h, w) is that of what had been halved."""
    height, width = image.shape[:2]
    large = cv2.resize(image, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(large, np.float32)[: shape[0], : shape[1]]


def _scaled(image: np.ndarray, factor: float) -> F32:
    height, width = image.shape[:2]
    small = np.empty(((height + 1) // 2, (width + 1) // 2, *image.shape[2:]), np.float32)
    channels = frozen(image.reshape(height, width, -1)), small.reshape(*small.shape[:2], -1)

    def run(first: int, last: int) -> None:
        _halve(*channels, np.float32(factor / 4), first, last)

    in_threads(run, len(small), least=LEAST_ROWS)
    return small


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _halve(image: np.ndarray, small: F32, scale: np.float32, first: int, last: int) -> None:
    """Rows of `small` (h, w, c): the sums of each 2 x 2 pixels of `image`, times `scale`."""
    height, width, count = image.shape
    sums = np.empty(width * count, np.float32)
    for y in range(first, last):
        upper = image[2 * y].reshape(width * count)
        lower = image[min(2 * y + 1, height - 1)].reshape(width * count)
        for k in range(width * count):
            sums[k] = np.float32(upper[k]) + np.float32(lower[k])
        if count == 3:  # a number that the compiler knows: twice as quick
            for x in range(width // 2):
                for c in range(3):
                    small[y, x, c] = scale * (sums[6 * x + c] + sums[6 * x + 3 + c])
        else:
            for x in range(width // 2):
                for c in range(count):
                    own = 2 * x * count + c
                    small[y, x, c] = scale * (sums[own] + sums[own + count])
        if width % 2:
            for c in range(count):
                small[y, width // 2, c] = 2 * scale * sums[(width - 1) * count + c]
