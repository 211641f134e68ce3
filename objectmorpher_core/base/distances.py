"""Distances to the nearest empty pixel, the same on every call, and which pixel is nearest."""

from __future__ import annotations

import cv2
import numpy as np

from .arrays import F32, I64, Mask

SNAPPED = 1400.0  # px; the squares of larger distances have steps in float32 themselves


def distance_inside(mask: Mask | np.ndarray) -> F32:
    """Return the exact distances (H, W), px, from pixels of `mask` to the nearest one outside.

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


def nearest_in(mask: Mask) -> I64:
    """(H, W) the flat index of the pixel of `mask` (H, W) that is nearest; 0 where it is empty."""
    if not mask.any():
        return np.zeros(mask.shape, np.int64)
    _, found = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    label = np.asarray(found, np.int64)
    index = np.zeros(int(label.max()) + 1, np.int64)
    index[label[mask]] = np.flatnonzero(mask)
    return index[label]
