"""The cut-out as finely as the lift needs it, and fields looked up between their pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, crop, frozen
from ...base.kernel_files import numba
from ...base.masks import Box, box_of
from ...base.poisson_disk import nearest_in
from ...base.threads import LEAST_ROWS, in_threads
from ...document.model import Matte

LEAST_SIDE = 384  # px that the longer side keeps
NEARBY = 2.0  # px, over which it is looked at how a field goes on
LEAST_SPREAD = 0.3  # px^2, of the places that tell its slope


@dataclass(frozen=True, eq=False)
class ReliefCanvas:
    """A crop of the photo on pixels of its own."""

    corner: F64  # (2,) px in the photo
    step: int  # px of the photo per pixel
    alpha: F32  # (h, w)
    foreground: F32  # (h, w, 3)
    whole: F32  # (h, w) alpha, and 1 where the object is hidden

    @staticmethod
    def of(matte: Matte, hidden: Mask | None = None, fineness: float = 1.0) -> ReliefCanvas:
        """A crop that holds the matte and what is `hidden` (H, W) in the photo, too.

        `fineness` px of the photo may be one; nothing becomes blurred that is larger.
        """
        foreground, alpha, box = matte.foreground, matte.alpha, matte.box
        whole = alpha
        if hidden is not None and hidden.any():
            box, pads = _box_around(matte.box, hidden)
            alpha = np.pad(alpha, pads)
            foreground = np.pad(foreground, [*pads, (0, 0)], mode="edge")
            own = crop(hidden, (0, 0, hidden.shape[1], hidden.shape[0]), box)
            whole = np.maximum(alpha, own.astype(np.float32))
        step = max(1, min(int(fineness), max(alpha.shape) // LEAST_SIDE, *alpha.shape))
        small = [_in_blocks(image, step) for image in (alpha, foreground)]
        whole = small[0] if whole is alpha else _in_blocks(whole, step)
        return ReliefCanvas(np.array(box[:2], np.float64), step, small[0], small[1], whole)


def _box_around(box: Box, hidden: Mask) -> tuple[Box, list[tuple[int, int]]]:
    """The box of the photo that holds `box` and `hidden` (H, W), and how much is added to it."""
    (x0, y0, x1, y1), (left, top, right, bottom) = box, box_of(hidden)
    wide = min(x0, left - 1), min(y0, top - 1), max(x1, right + 1), max(y1, bottom + 1)
    return wide, [(y0 - wide[1], wide[3] - y1), (x0 - wide[0], wide[2] - x1)]


def _in_blocks(image: F32, step: int) -> F32:
    """Means over blocks of `step` px; what is left over at the end is left out."""
    if step == 1:
        return image
    height, width = image.shape[0] // step, image.shape[1] // step
    part = image[: height * step, : width * step]
    return np.asarray(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def carried_on(field: F64, known: Mask, reach: float) -> F64:
    """`field` (h, w) where it is `known` (h, w), and beyond as it is about to go on there.

    As the plane that is nearest to what is known nearby, as far as `reach` px; from there on it
    stays as it is.
    """
    height, width = known.shape
    y, x = np.mgrid[:height, :width] - 0.5 * np.array([[[height]], [[width]]])
    weight, values = known.astype(np.float64), np.where(known, field, 0.0)

    total = np.maximum(cv2.GaussianBlur(weight, (0, 0), NEARBY), 1e-12)

    def mean(part: F64) -> F64:
        return np.asarray(cv2.GaussianBlur(part, (0, 0), NEARBY), np.float64) / total

    across, down, middle = mean(weight * x), mean(weight * y), mean(values)
    xx, yy = (mean(weight * p * p) - q * q + LEAST_SPREAD for p, q in ((x, across), (y, down)))
    xy = mean(weight * x * y) - across * down
    right, below = mean(values * x) - across * middle, mean(values * y) - down * middle
    slopes = np.stack([right * yy - below * xy, below * xx - right * xy]) / (xx * yy - xy * xy)
    plane = middle + slopes[0] * (x - across) + slopes[1] * (y - down)
    away = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, 5)
    whole = np.where(known, field, plane)
    return whole.ravel()[nearest_in(away <= reach)]


def bilinear(field: np.ndarray, xy: F64) -> F64:
    """`field` (h, w, ...) at positions (N, 2) in its pixel indices, clamped to it."""
    height, width = field.shape[:2]
    # Large pictures are float32 already; all else is small, and compiled for once.
    dtype = np.float32 if field.dtype == np.float32 else np.float64
    channels = frozen(field.reshape(height, width, -1), dtype)
    positions = frozen(xy, np.float64)
    values = np.empty((len(positions), channels.shape[2]))

    def run(first: int, last: int) -> None:
        _look_up(channels, positions[first:last], values[first:last])

    in_threads(run, len(positions), least=LEAST_ROWS)
    return values.reshape(-1, *field.shape[2:])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _look_up(field, xy, values):
    """`values` (N, c) of a field (h, w, c) at xy (N, 2)."""
    height, width, count = field.shape
    for n in range(len(xy)):
        x = min(xy[n, 0], width - 1.001) if xy[n, 0] > 0 else 0.0  # also where it is not a number
        y = min(xy[n, 1], height - 1.001) if xy[n, 1] > 0 else 0.0
        j, i = int(x), int(y)
        s, t = x - j, y - i
        j1, i1 = min(j + 1, width - 1), min(i + 1, height - 1)
        for c in range(count):
            upper = field[i, j, c] * (1 - s) + field[i, j1, c] * s
            lower = field[i1, j, c] * (1 - s) + field[i1, j1, c] * s
            values[n, c] = upper * (1 - t) + lower * t
