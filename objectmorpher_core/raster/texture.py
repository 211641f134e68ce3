"""The photo as the Gaussians carry it: straight colour and alpha, with halved copies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..arrays import F32, frozen

LEAST_LEVEL = 4  # px, shorter side of a picture that is halved again
MOST_LEVELS = 8


@dataclass(frozen=True, eq=False)
class TextureLevels:
    """The object's straight colours and alpha, with halved copies for minification."""

    levels: tuple[F32, ...]  # each (h, w, 4), level l halved l times
    left: float  # px in the photo, corner of the crop
    top: float

    @cached_property
    def texels(self) -> F32:
        """(4 T,) all levels, one after the other, rows of pixels as they come."""
        return frozen(np.concatenate([v.reshape(-1) for v in self.levels]))

    @cached_property
    def shapes(self) -> np.ndarray:
        """(levels, 3) height, width and first texel of each level."""
        sizes = np.array([level.shape[:2] for level in self.levels], np.int64)
        starts = np.concatenate([[0], np.cumsum(sizes.prod(1))[:-1]])
        return frozen(np.column_stack([sizes, starts]))


def build_levels(foreground: F32, alpha: F32, left: float, top: float) -> TextureLevels:
    """Texture from straight `foreground` (h, w, 3) in [0, 1] and `alpha` (h, w).

    `left`, `top`: px in the photo of the crop's corner, which may lie outside it.
    """
    level = np.dstack([foreground, alpha]).astype(np.float32)
    levels = [level]
    while min(level.shape[:2]) >= LEAST_LEVEL and len(levels) < MOST_LEVELS:
        height, width = level.shape[:2]
        padded = cv2.copyMakeBorder(level, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
        size = (padded.shape[1] // 2, padded.shape[0] // 2)
        level = cv2.resize(padded, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        levels.append(level)
    return TextureLevels(tuple(frozen(v) for v in levels), left, top)


def sample_texture(texture: TextureLevels, look: np.ndarray, lod: np.ndarray) -> np.ndarray:
    """Straight colour and alpha (n, 4) at photo px (n, 2), filtered for `lod` (n,).

    The two nearest levels are mixed; the full-size one is sampled bicubically (Catmull-Rom: it
    returns a pixel's own value at its centre), halved ones bilinearly. Outside the crop alpha
    is 0.
    """
    lod = np.clip(lod, 0, len(texture.levels) - 1)
    lower = np.floor(lod).astype(int)
    result = np.zeros((len(look), 4))
    for level, image in enumerate(texture.levels):
        for use, mix in ((lower == level, 1 - (lod - lower)), (lower + 1 == level, lod - lower)):
            at = np.flatnonzero(use & (mix > 0))
            if len(at):
                xy = (look[at] - [texture.left, texture.top]) / 2**level - 0.5
                values = _cubic(image, xy) if level == 0 else _linear(image, xy)
                result[at] += mix[at, None] * values
    return result


def _linear(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    return _taps(image, xy, (0, 1), lambda t: [1 - t, t])


def _cubic(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    def weights(t: np.ndarray) -> list[np.ndarray]:
        return [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ]

    return np.clip(_taps(image, xy, (-1, 0, 1, 2), weights), 0, 1)


def _taps(image, xy, offsets, weights):
    height, width = image.shape[:2]
    base = np.floor(xy).astype(int)
    wx, wy = weights(xy[:, 0] - base[:, 0]), weights(xy[:, 1] - base[:, 1])
    result = np.zeros((len(xy), 4))
    for oy, a in zip(offsets, wy, strict=True):
        for ox, b in zip(offsets, wx, strict=True):
            j, i = base[:, 0] + ox, base[:, 1] + oy
            is_inside = (j >= 0) & (j < width) & (i >= 0) & (i < height)
            value = image[i.clip(0, height - 1), j.clip(0, width - 1)].astype(np.float64)
            value[~is_inside, 3] = 0.0
            result += (a * b)[:, None] * value
    return result
