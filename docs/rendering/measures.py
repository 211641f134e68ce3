"""What pictures are compared by."""

from __future__ import annotations

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.raster.reference import Picture3D

GREY = 0.5  # of the ground that objects are shown on
LUMA = np.array([0.299, 0.587, 0.114], np.float32)
WHOLE = 0.995  # alpha from which a pixel is inside


def on_grey(picture: Picture3D) -> F32:
    """(h, w, 3)"""
    return picture.color + (1 - picture.alpha[..., None]) * np.float32(GREY)


def inside(alpha: np.ndarray, margin: int) -> Mask:
    """Pixels of a solid object, `margin` px away from its edge."""
    solid = (alpha >= WHOLE).astype(np.uint8)
    solid = cv2.copyMakeBorder(solid, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    kernel = np.ones((2 * margin + 1,) * 2, np.uint8)
    return cv2.erode(solid, kernel)[1:-1, 1:-1] > 0


def detail(pixels: np.ndarray, where: Mask) -> float:
    """Mean squared Sobel gradient of the luma of `pixels` (h, w, 3) in [0, 1]."""
    grey = np.ascontiguousarray(pixels.astype(np.float32) @ LUMA)
    across = cv2.Sobel(grey, cv2.CV_32F, 1, 0)
    down = cv2.Sobel(grey, cv2.CV_32F, 0, 1)
    return float((across**2 + down**2)[where].mean())


def psnr(picture: np.ndarray, truth: np.ndarray, where: Mask) -> float:
    """dB, both (h, w, 3) in [0, 1]."""
    square = ((np.clip(picture, 0, 1).astype(np.float64) - truth) ** 2)[where]
    return float(-10 * np.log10(max(square.mean(), 1e-12)))
