"""The photo's crop with its halved copies on the GPU, as `raster.texture` has made them."""

from __future__ import annotations

import logging
import math

import moderngl
import numpy as np

from objectmorpher_core.base.arrays import F32, U16
from objectmorpher_core.raster.texture import MOST_LEVELS, TextureLevels

log = logging.getLogger(__name__)

BITS_16 = 65535.0
BORDER = 2  # px around the photo's own size, which is looked up by cubics
ROWS = 16  # of a level, converted at a time


class PhotoLevels:
    """16 bits a channel, level by level; looked up by shaders/splat_photo.glsl.

    Levels that are finer than what is shown are not uploaded before they are: where 10,000 px fit
    into 1,000 that is a sixteenth. OpenGL rounds odd sizes down when it halves them and
    `build_levels` rounds them up, so the texture is larger than its contents.
    """

    def __init__(self, context: moderngl.Context, texture: TextureLevels, limit: int) -> None:
        """`limit`: px, the longest side that the GPU takes."""
        levels = texture.levels
        fitting = [
            k for k, level in enumerate(levels) if max(_padded(level, len(levels) - k)) <= limit
        ]
        if not fitting:
            raise moderngl.Error(f"a texture of {limit} px is too small for the photo")
        self._context, self._levels, self._least = context, levels, fitting[0]
        self._finest = len(levels)
        self._texture: moderngl.Texture | None = None
        if self._least > 0:
            log.warning(
                "The object is shown at 1/%d of the photo's detail: OpenGL takes %d px at most",
                2**self._least, limit,
            )  # fmt: skip

    def reach(self, magnified: float) -> None:
        """Has what a view needs that shows so many px of the photo as one.

        Some of it may be nearer than the whole: it is sharp to twice the size.
        """
        wanted = int(np.clip(math.floor(math.log2(max(magnified, 1.0))) - 1, self._least,
                             max(len(self._levels) - 1, self._least)))  # fmt: skip
        if wanted < self._finest:
            self.release()
            self._finest = wanted
            self._texture = self._uploaded()

    def _uploaded(self) -> moderngl.Texture:
        levels = self._levels[self._finest :]
        height, width = _padded(levels[0], len(levels))
        texture = self._context.texture((width, height), 4, dtype="nu2")
        texture.build_mipmaps(0, len(levels) - 1)  # makes room for them
        for k, level in enumerate(levels):
            pixels = _as_u16(level, BORDER if k == self._finest == 0 else 0)
            box = (0, 0, pixels.shape[1], pixels.shape[0])
            texture.write(pixels, box, level=k)
        texture.filter = moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST
        texture.repeat_x = texture.repeat_y = False
        return texture

    def use(self, unit: int) -> None:
        """Binds what `reach` has uploaded."""
        assert self._texture is not None, "nothing is uploaded before it is known what is shown"
        self._texture.use(unit)

    @property
    def uniforms(self) -> dict[str, object]:
        """What the shader has to know of it."""
        sizes = [(level.shape[1], level.shape[0]) for level in self._levels[self._finest :]]
        all_sizes = sizes + sizes[-1:] * (MOST_LEVELS - len(sizes))
        return {"sizes": all_sizes, "levels": len(sizes), "finest": float(self._finest)}

    def release(self) -> None:
        if self._texture is not None:
            self._texture.release()
            self._texture = None


def _padded(level: F32, count: int) -> tuple[int, int]:
    """Height and width of a texture that holds `level` with its border, and halved copies.

    `count` levels in all.
    """
    unit = 2 ** (count - 1)
    height, width = (-(-(n + 2 * BORDER) // unit) * unit for n in level.shape[:2])
    return height, width


def _as_u16(level: F32, border: int) -> U16:
    """With so many px around it that repeat the colours and are clear."""
    height, width = level.shape[:2]
    whole = np.empty((height + 2 * border, width + 2 * border, 4), np.uint16)
    inside = whole[border : border + height, border : border + width]
    for top in range(0, height, ROWS):  # few at a time, which stay in the processor's cache
        rows = level[top : top + ROWS] * np.float32(BITS_16)
        rows += np.float32(0.5)
        np.clip(rows, 0, BITS_16, out=rows)
        inside[top : top + ROWS] = rows
    if border:
        whole[border:-border, :border] = inside[:, :1]
        whole[border:-border, -border:] = inside[:, -1:]
        whole[:border], whole[-border:] = whole[border], whole[-border - 1]
        whole[:border, :, 3] = whole[-border:, :, 3] = 0
        whole[:, :border, 3] = whole[:, -border:, 3] = 0
    return whole
