"""The place of a photo, or of a crop of it, in the square picture that a SAM sees.

SAM (Kirillov et al. 2023) keeps the proportions and leaves the square's right or bottom empty; SAM
2 and 3 (Ravi et al. 2024) stretch. Masks come back as a small square of logits in the same frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from PIL import Image

from ...base.arrays import F32, F64, RGB

Box = tuple[int, int, int, int]  # left, top, right, bottom px of the photo


@dataclass(frozen=True)
class SamFrame:
    """A box of the photo in a square of `side` px."""

    box: Box
    side: int
    is_padded: bool  # proportions are kept; else it is stretched

    @property
    def size(self) -> tuple[int, int]:
        """Width and height px that the box takes up in the square."""
        width, height = self.box[2] - self.box[0], self.box[3] - self.box[1]
        if not self.is_padded:
            return self.side, self.side
        scale = self.side / max(width, height)
        return max(1, int(width * scale + 0.5)), max(1, int(height * scale + 0.5))

    @property
    def scale(self) -> F64:
        """(2,) px of the square for a px of the photo, across and down."""
        width, height = self.box[2] - self.box[0], self.box[3] - self.box[1]
        return np.array(self.size) / (width, height)

    def picture(self, rgb: RGB) -> RGB:
        """The box of a photo (H, W, 3) at its size in the square, as the SAMs were trained.

        Pillow's triangle filter widens when it shrinks, as cv2's bilinear does not.
        """
        left, top, right, bottom = self.box
        crop = Image.fromarray(np.ascontiguousarray(rgb[top:bottom, left:right]))
        return np.asarray(crop.resize(self.size, Image.Resampling.BILINEAR), np.uint8)

    def points(self, photo: F64) -> F64:
        """(n, 2) px of the photo in px of the square; a pixel's centre is at its number + 0.5."""
        return (np.asarray(photo, np.float64).reshape(-1, 2) - self.box[:2]) * self.scale

    def unfold(self, logits: F32, size: tuple[int, int]) -> F32:
        """(h, w) logits (n, n) of the square as those of the box, at `size` (width, height) px."""
        if self.is_padded:
            square = cv2.resize(logits, (self.side, self.side), interpolation=cv2.INTER_LINEAR)
            logits = np.asarray(square[: self.size[1], : self.size[0]], np.float32)
        return np.asarray(cv2.resize(logits, size, interpolation=cv2.INTER_LINEAR), np.float32)

    def fold(self, logits: F32, size: int) -> F32:
        """(size, size) logits of the square that are `logits` (h, w) in the box; else very low."""
        inner = cv2.resize(logits, self.size, interpolation=cv2.INTER_LINEAR)
        square = np.full((self.side, self.side), EMPTY, np.float32)
        square[: self.size[1], : self.size[0]] = inner
        low = cv2.resize(square, (size, size), interpolation=cv2.INTER_AREA)
        return np.asarray(low, np.float32)


EMPTY = -10.0  # logit of what is surely not the object
