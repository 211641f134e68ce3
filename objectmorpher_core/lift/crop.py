"""The crop of a photo in which the shape network sees an object, and its units.

Distances are from the camera along each pixel's ray, in crop units: one is as long as the crop is
wide at the object's distance. So the same object far away or magnified has the same numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from ..base.arrays import F32, F64, RGB, Mask, Pixels
from ..base.camera import Camera
from ..base.masks import box_of
from ..pictures.image import to_u8

SIDE = 224  # px of a crop as it is seen
ROOM = 1.2  # crop's side over the object's longer side
OUTLINE_SCALE = 0.25  # crop's side, of the distance to the outline


class Crop(NamedTuple):
    """A square of a photo, part of which may lie beyond its frame."""

    left: int  # px of the photo
    top: int
    side: int
    tangents: F32  # (3,) of its middle, right and down of the optical axis, and its width

    @staticmethod
    def around(mask: Mask, camera: Camera) -> Crop:
        """Around what `mask` (H, W) holds, which is something."""
        low, high = np.array(box_of(mask)).reshape(2, 2)
        side = int(np.ceil(ROOM * (high - low).max()))
        left, top = 0.5 * (low + high - side)
        return Crop.at(float(left), float(top), side, camera)

    @staticmethod
    def at(left: float, top: float, side: float, camera: Camera) -> Crop:
        """The nearest whole pixels of a square of photo px."""
        x, y, wide = round(left), round(top), max(round(side), 1)
        middle = (np.array([x, y]) + 0.5 * wide - [camera.cx, camera.cy]) / camera.focal
        return Crop(x, y, wide, np.array([*middle, wide / camera.focal], np.float32))

    @property
    def away(self) -> float:
        """Crop units from the camera to what is at height 0."""
        return float(np.hypot(1.0, np.hypot(*self.tangents[:2])) / self.tangents[2])

    def seen(self, pixels: Pixels) -> RGB:
        """(SIDE, SIDE, 3) of a photo (H, W, 3); black beyond its frame."""
        return self._resized(to_u8(self._cut(pixels)))

    def seen_mask(self, mask: Mask) -> Mask:
        """(SIDE, SIDE) of a mask (H, W)."""
        return self._resized(self._cut(mask).view(np.uint8) * np.uint8(255)) > 127

    def grid_xy(self, xy: F64) -> F64:
        """Indices (..., 2) of the crop as it is seen, centres at integers, of photo px (..., 2)."""
        return (xy - [self.left, self.top]) * (SIDE / self.side) - 0.5

    def _cut(self, image: np.ndarray) -> np.ndarray:
        height, width = image.shape[:2]
        x0, y0 = max(self.left, 0), max(self.top, 0)
        x1 = max(min(self.left + self.side, width), x0)  # it may lie beside the photo
        y1 = max(min(self.top + self.side, height), y0)
        whole = np.zeros((self.side, self.side, *image.shape[2:]), image.dtype)
        whole[y0 - self.top : y1 - self.top, x0 - self.left : x1 - self.left] = image[y0:y1, x0:x1]
        return whole

    def _resized(self, image: np.ndarray) -> np.ndarray:
        method = cv2.INTER_AREA if self.side > SIDE else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(image, (SIDE, SIDE), interpolation=method))


def rays(tangents: F32, side: int = SIDE) -> F64:
    """(s, s, 3) unit rays of a crop's pixels: x right, y down, z forward."""
    steps = ((np.arange(side) + 0.5) / side - 0.5) * float(tangents[2])
    x, y = np.meshgrid(steps + float(tangents[0]), steps + float(tangents[1]))
    ways = np.stack([x, y, np.ones_like(x)], -1)
    return ways / np.linalg.norm(ways, axis=-1, keepdims=True)


def planes_of(rgb: RGB, mask: Mask, tangents: F32) -> F32:
    """(7, s, s) what the network sees of a crop besides its tokens."""
    side = len(mask)
    distance = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    steps = ((np.arange(side, dtype=np.float32) + 0.5) / side - 0.5) * tangents[2]
    x, y = np.meshgrid(steps + tangents[0], steps + tangents[1])
    colours = rgb.transpose(2, 0, 1).astype(np.float32) / 255 - 0.45
    own = [mask.astype(np.float32), distance / (OUTLINE_SCALE * side), x, y]
    return np.concatenate([colours * 4, np.stack(own)]).astype(np.float32)
