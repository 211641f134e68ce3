"""What is in a mask: the box around it, its largest piece, and what is near it."""

from __future__ import annotations

import cv2
import numpy as np

from .arrays import U8, Mask

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px


def box_of(mask: np.ndarray, margin: int = 0) -> Box:
    """The box around what is not 0 in `mask` (H, W), `margin` px larger, inside it.

    All of it is 0 where nothing is.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not len(rows):
        return 0, 0, 0, 0
    height, width = mask.shape
    return (
        max(int(columns[0]) - margin, 0), max(int(rows[0]) - margin, 0),
        min(int(columns[-1]) + 1 + margin, width), min(int(rows[-1]) + 1 + margin, height),
    )  # fmt: skip


def largest_piece(mask: Mask) -> Mask:
    """The largest of the connected pieces of `mask` (H, W); corners connect."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 2:
        return mask
    return np.asarray(labels) == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))


def disc(radius: int) -> U8:
    """(2 radius + 1, 2 radius + 1) the disc as OpenCV's morphology takes it."""
    size = 2 * radius + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)


def dilated(mask: Mask, radius: int) -> Mask:
    """`mask` (H, W) and what is `radius` px from it at most."""
    return cv2.dilate(mask.astype(np.uint8), disc(radius)) > 0
