"""Fills a hole by continuing the colours of its rim (Telea 2004): smooth, quick, always there."""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import Mask, Pixels
from ...base.progress import Progress
from .. import InpaintError

RADIUS = 5  # px of rim that each filled pixel looks at
FILL_PIXELS = 250_000  # of a large crop, shrunk: the result has no detail that could be lost


class TeleaInpainter:
    """The last resort, where no other inpainter runs."""

    name = "telea"
    is_random = False

    def missing(self) -> str | None:
        return None

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """`rgb` (h, w, 3) with its hole filled; the same bytes outside. Raises InpaintError."""
        if hole.all():
            raise InpaintError("the hole covers everything: there is nothing to fill it from")
        filled = rgb.copy()
        if not hole.any():
            return filled
        progress(0.0, "Filling in the background")
        height, width = hole.shape
        shrink = min(1.0, (FILL_PIXELS / hole.size) ** 0.5)
        size = max(1, round(width * shrink)), max(1, round(height * shrink))
        known = (~hole).astype(np.float32)
        weight = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
        small = np.empty((size[1], size[0], 3), np.uint16)
        for c in range(3):  # OpenCV fills 16 bits only in single channels
            total = cv2.resize(rgb[..., c] * known, size, interpolation=cv2.INTER_AREA)
            level = np.rint(total / np.maximum(weight, 1e-3)).astype(np.uint16)
            small_hole = (weight < 0.5).astype(np.uint8)
            small[..., c] = cv2.inpaint(level, small_hole, RADIUS, cv2.INPAINT_TELEA)
        large = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
        most = np.iinfo(rgb.dtype).max  # beyond it OpenCV goes by a level now and then
        filled[hole] = np.minimum(large[hole], most).astype(rgb.dtype)
        progress(1.0, "Filled the background")
        return filled
