"""Distances to the nearest empty pixel, the same on every call."""

from __future__ import annotations

import cv2
import numpy as np

from .arrays import F32, Mask

SNAPPED = 1400.0  # px; the squares of larger distances have steps in float32 themselves


def distance_inside(mask: Mask | np.ndarray) -> F32:
    """(H, W) px, exact: from each pixel of `mask` (H, W) to the nearest one outside, centre to it.

    Where everything is inside, distances are larger than the mask.

    OpenCV takes the root by the processor's wide instructions where memory happens to be aligned
    for them, and another one elsewhere: the last bit is not the same on every call. The squares
    are whole numbers, which tells the root that is meant.
    """
    wide = cv2.distanceTransform(
        np.asarray(mask, np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )  # fmt: skip
    near = np.sqrt(np.rint(np.square(wide, dtype=np.float64))).astype(np.float32)
    return np.where(wide < SNAPPED, near, wide)
