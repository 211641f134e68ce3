"""The solids' materials, and the photos behind them.

The surface photos are ones that the shape network's training has not seen; of the backgrounds it
has seen pieces, but for the flower (docs/evaluation-figures.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, RGB

from ...photos import photo
from .lookup import looked_up, triplanar

SURFACES = ("retina", "coins", "camera", "moon", "page", "text", "clock", "flower")
GAMMA = 2.2


@dataclass(frozen=True)
class SolidMaterial:
    """A photo laid around a solid from three sides, or marble through and through."""

    surface: str  # of SURFACES, or "marble"
    scale: float = 300.0  # px of the photo to the solid's extent
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    shine: float = 0.0  # strength of the highlight
    seed: int = 0

    def albedo(self, points: F64, normals: F64) -> F64:
        """Linear (n, 3) in [0, 1] of a solid's points (n, 3) with normals (n, 3), both at rest."""
        if self.surface == "marble":
            return marble(points, self.seed)
        picture, start = surface(self.surface), 40.0 * self.seed
        size = np.array(picture.shape[1::-1]) - 1.0

        def look(places: F64) -> F64:
            at = (places + 0.5) * self.scale + start
            folded = size - np.abs(np.mod(at, 2 * size) - size)  # mirrored at the picture's ends
            return looked_up(picture, folded)

        return np.clip(triplanar(look, points, normals) * self.tint, 0.0, 1.0)


def marble(points: F64, seed: int) -> F64:
    """Linear (n, 3): detail of many sizes."""
    rng = np.random.default_rng(seed)
    base, other = rng.uniform(0.05, 0.8, (2, 3))
    return np.clip(base + (other - base) * veins(points, rng)[:, None], 0.01, 0.95)


def veins(points: F64, rng: np.random.Generator) -> F64:
    """(n,) in [0, 1] of points (n, 3): four octaves of waves that go any way."""
    value = np.zeros(len(points))
    for octave in range(4):
        waves = rng.normal(size=(6, 3))
        waves *= 2 * np.pi * 2.2 * 1.9**octave / np.linalg.norm(waves, axis=1, keepdims=True)
        value += np.sin(points @ waves.T + rng.uniform(0, 2 * np.pi, 6)).sum(1) / 1.6**octave
    return 1 / (1 + np.exp(-1.2 * value))


@cache
def surface(name: str) -> F32:
    """(h, w, 3) linear, its dark frame left out."""
    picture = photo(name)
    if name == "retina":
        picture = picture[350:1050, 350:1050]
    elif name == "text":
        picture = cv2.resize(picture, None, fx=1.5, fy=1.5, interpolation=cv2.INTER_CUBIC)
    share = np.asarray(picture, np.float32) / np.float32(255)
    return np.asarray(np.power(share, np.float32(GAMMA)), np.float32)


@cache
def background(name: str, width: int, height: int) -> RGB:
    """(height, width, 3): the largest part of a photo that has this shape."""
    whole = photo(name)
    scale = max(width / whole.shape[1], height / whole.shape[0])
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    size = (max(round(whole.shape[1] * scale), width), max(round(whole.shape[0] * scale), height))
    large = cv2.resize(whole, size, interpolation=how)
    top, left = (size[1] - height) // 2, (size[0] - width) // 2
    return np.ascontiguousarray(large[top : top + height, left : left + width], np.uint8)
