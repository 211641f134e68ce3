"""The photo's crop with its halved copies on the GPU, as `raster.texture` has made them."""

from __future__ import annotations

import logging

import moderngl
import numpy as np

from objectmorpher_core.arrays import F32
from objectmorpher_core.raster.texture import MOST_LEVELS, TextureLevels

log = logging.getLogger(__name__)

BITS_16 = 65535.0
BORDER = 2  # px around the first level


class PhotoLevels:
    """16 bits a channel, level by level; looked up by shaders/splat_photo.glsl.

    OpenGL rounds odd sizes down when it halves them and `build_levels` rounds them up, so the
    texture is larger than its contents.
    """

    def __init__(self, context: moderngl.Context, texture: TextureLevels, limit: int) -> None:
        """`limit`: px, the longest side that the GPU takes."""
        levels = texture.levels
        fitting = [
            k for k, level in enumerate(levels) if max(_padded(level, len(levels) - k)) <= limit
        ]
        if not fitting:
            raise moderngl.Error(f"a texture of {limit} px is too small for the photo")
        self._finest = fitting[0]
        if self._finest > 0:
            log.warning(
                "The object is shown at 1/%d of the photo's detail: OpenGL takes %d px at most",
                2**self._finest, limit,
            )  # fmt: skip
        levels = levels[self._finest :]
        self._sizes = [(level.shape[1], level.shape[0]) for level in levels]
        height, width = _padded(levels[0], len(levels))
        self._texture = context.texture((width, height), 4, dtype="nu2")
        self._texture.build_mipmaps(0, len(levels) - 1)  # makes room for them
        for k, level in enumerate(levels):
            pixels = _as_u16(level, BORDER if k == 0 else 0)
            box = (0, 0, pixels.shape[1], pixels.shape[0])
            self._texture.write(pixels, box, level=k)
        self._texture.filter = moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST
        self._texture.repeat_x = self._texture.repeat_y = False

    def use(self, unit: int) -> None:
        self._texture.use(unit)

    @property
    def uniforms(self) -> dict[str, object]:
        """What the shader has to know of it."""
        sizes = self._sizes + [self._sizes[-1]] * (MOST_LEVELS - len(self._sizes))
        return {"sizes": sizes, "levels": len(self._sizes), "finest": float(self._finest)}

    def release(self) -> None:
        self._texture.release()


def _padded(level: F32, count: int) -> tuple[int, int]:
    """Height and width of a texture that holds `level` with its border, and halved copies.

    `count` levels in all.
    """
    unit = 2 ** (count - 1)
    height, width = (-(-(n + 2 * BORDER) // unit) * unit for n in level.shape[:2])
    return height, width


def _as_u16(level: F32, border: int) -> np.ndarray:
    """With so many px around it that repeat the colours and are clear."""
    inside = (level * np.float32(BITS_16) + np.float32(0.5)).clip(0, BITS_16).astype(np.uint16)
    sides = (border, border)
    whole = np.pad(inside, (sides, sides, (0, 0)), mode="edge")
    whole[..., 3] = np.pad(inside[..., 3], border)
    return whole
