"""An object's mirror image on the ground: where it lies in the photo, and how much of it is seen.

What is seen is the ground's light, less a share of that, and the same share of the mirror image,
all in linear light. The share is largest at the object's foot.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64
from ...document.model import Matte
from .shadow import GAMMA

KNOTS = 4  # of the share, along the object's height
LEAST_BLUR = 0.2  # px, less is none
SOFT = 0.03  # x the height, over which the image ends
MOST_LOST = 0.9  # of the ground's contrast

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px of the photo


@dataclass(frozen=True)
class MirrorLine:
    """About which line an object is mirrored, how blurred, and what share of the light that is."""

    foot: tuple[float, float]  # photo px, a point of the line
    tilt: float  # degrees that it leans
    aside: float  # photo px that the image is shifted along it
    scale: float  # of the mirrored height
    blur: float  # photo px
    height: float  # photo px, of the object
    fade: float  # photo px, over which the share falls to 1/e
    shares: tuple[float, ...] = (1.0,) * KNOTS  # x that, at even steps of the height
    taken: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x share, light it takes besides
    ends: float = np.inf  # photo px below the line
    contrast: float = 1.0  # how much of its share the ground's texture loses

    def laid(self, image: F32, corner: tuple[float, float], box: Box, pitch: float = 1.0) -> F32:
        """An image (h, w, c), its `corner` at photo px, mirrored into a box; cells of `pitch`."""
        x0, y0, x1, y1 = box
        normal, back = _normal(self.tilt), 1 + 1 / self.scale
        linear = np.eye(2) - back * np.outer(normal, normal)
        moved = back * (np.array(self.foot) @ normal) * normal
        moved -= self.aside * np.array([normal[1], -normal[0]])
        middle = np.full(2, 0.5 * pitch)
        shift = (linear @ (np.array([x0, y0]) + middle) + moved - corner - middle) / pitch
        size = (round((x1 - x0) / pitch), round((y1 - y0) / pitch))
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        laid = cv2.warpAffine(image, np.column_stack([linear, shift]), size, flags=flags)
        if self.blur > LEAST_BLUR * pitch:
            laid = cv2.GaussianBlur(laid, (0, 0), self.blur / pitch)
        return np.asarray(laid, np.float32)

    def below(self, box: Box, pitch: float = 1.0) -> F32:
        """(h, w) how many photo px below the line the cells of a box are."""
        x0, y0, x1, y1 = box
        normal = _normal(self.tilt)
        x = x0 + (np.arange(round((x1 - x0) / pitch)) + 0.5) * pitch - self.foot[0]
        y = y0 + (np.arange(round((y1 - y0) / pitch)) + 0.5) * pitch - self.foot[1]
        return np.asarray(x[None] * normal[0] + y[:, None] * normal[1], np.float32)

    def faded(self, below: F32) -> F32:
        """The share's course, 1 at the line, so many photo px below it."""
        return np.exp(-np.maximum(below, 0) / np.float32(self.fade))

    def share(self, below: F32) -> F32:
        """Return the mirror image's share of the light, so many photo px below the line."""
        bends = knots(below, self.height) @ np.array(self.shares, np.float32)
        ends = np.clip((self.ends - below) / (SOFT * self.height), 0, 1)
        return np.asarray(self.faded(below) * bends * ends, np.float32)

    def without(self, light: F32, laid: F32, below: F32, ground: F32) -> F32:
        """`light` (h, w, 3) without the mirror image that is `laid` there (h, w, 4).

        `ground` (h, w, 3) is what it is without texture; all linear.
        """
        share, alpha = self.share(below)[..., None], laid[..., 3:]
        taken = np.array(self.taken, np.float32) + np.float32(1 - self.contrast) * ground
        lost = np.minimum(self.contrast * share * alpha, MOST_LOST)
        return np.asarray(
            (light - share * (laid[..., :3] - alpha * taken)) / (1 - lost), np.float32
        )


def premultiplied(matte: Matte, pitch: float = 1.0) -> F32:
    """(h, w, 4) linear light x alpha, and alpha; cells of `pitch` px."""
    light = np.clip(matte.foreground, 0, 1) ** np.float32(GAMMA)
    picture = np.dstack([light * matte.alpha[..., None], matte.alpha])
    if pitch == 1:
        return picture
    size = tuple(max(round(n / pitch), 1) for n in matte.alpha.shape[::-1])
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def knots(below: F32, height: float) -> F32:
    """(..., KNOTS) weights, linear between even steps of the height."""
    at = np.clip(below / np.float32(height), 0, 1)[..., None] * (KNOTS - 1)
    return np.clip(1 - np.abs(at - np.arange(KNOTS, dtype=np.float32)), 0, 1)


def _normal(tilt: float) -> F64:
    """Of the line, downwards."""
    return np.array([-np.sin(np.radians(tilt)), np.cos(np.radians(tilt))])
