"""A surface's picture, filtered: what a spot of a given size on it looks like.

Colours are linear light, premultiplied with alpha, while they are averaged, as a camera averages
them. Levels of half the size each (mipmaps, Williams 1983) hold the averages.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8

WORKING = 2048  # px, longer side: finer than any sampling of a surface here


class Texture:
    """Premultiplied linear RGBA at any place and level."""

    def __init__(self, rgba: U8) -> None:
        """Of straight sRGB pixels (H, W, 4), top row first."""
        self.height, self.width = rgba.shape[:2]
        whole: np.ndarray = np.empty(rgba.shape, np.float32)
        whole[..., 3] = rgba[..., 3] / np.float32(255)
        whole[..., :3] = LINEAR_OF_BYTE[rgba[..., :3]] * whole[..., 3:]
        self._levels: list[np.ndarray] = [whole]
        while max(whole.shape[:2]) > 1:
            half = (max(1, whole.shape[1] // 2), max(1, whole.shape[0] // 2))
            whole = cv2.resize(whole, half, interpolation=cv2.INTER_AREA)
            self._levels.append(whole)

    def sample(self, uv: F64, footprint: F64) -> F32:
        """Colours (N, 4) around `uv` (N, 2), v up from the bottom row, repeated beyond [0, 1].

        `footprint` (N,) px is the width of what each colour stands for.
        """
        level = np.log2(np.maximum(footprint, 1.0)).clip(0, len(self._levels) - 1)
        lower = np.minimum(level.astype(int), max(len(self._levels) - 2, 0))
        share = (level - lower)[:, None].astype(np.float32)
        colors = np.empty((len(uv), 4), np.float32)
        for k in np.unique(lower):
            rows = lower == k
            fine = _bilinear(self._levels[k], uv[rows])
            coarse = _bilinear(self._levels[min(k + 1, len(self._levels) - 1)], uv[rows])
            colors[rows] = fine + share[rows] * (coarse - fine)
        return colors


def _bilinear(pixels: F32, uv: F64) -> F32:
    height, width = pixels.shape[:2]
    x = (uv[:, 0] % 1.0) * width - 0.5
    y = ((1.0 - uv[:, 1]) % 1.0) * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = ((a - b)[:, None].astype(np.float32) for a, b in ((x, left), (y, top)))
    columns, rows = (left % width, (left + 1) % width), (top % height, (top + 1) % height)
    upper = pixels[rows[0], columns[0]] * (1 - fx) + pixels[rows[0], columns[1]] * fx
    lower = pixels[rows[1], columns[0]] * (1 - fx) + pixels[rows[1], columns[1]] * fx
    return upper * (1 - fy) + lower * fy


def linear_from_srgb(encoded: np.ndarray) -> np.ndarray:
    """Linear light of sRGB values in [0, 1] (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(light: np.ndarray) -> np.ndarray:
    """sRGB values of linear light in [0, 1]."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


LINEAR_OF_BYTE = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)
