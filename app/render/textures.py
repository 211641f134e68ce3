"""Pictures on the GPU, uploaded when the array is not the last one."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import moderngl
import numpy as np

from objectmorpher_core.brush import Box

SHARP_FROM = 4.0  # magnification from which single pixels are shown


class PictureTexture:
    """A picture of 1, 3 or 4 channels, 8 bits each on the GPU."""

    def __init__(self, context: moderngl.Context, has_mipmaps: bool = True) -> None:
        """Mipmaps are for what is shown smaller than it is; they cost time at each upload."""
        self._has_mipmaps = has_mipmaps
        self._context = context
        self._limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._uploaded: np.ndarray | None = None
        self._touched = 0  # of what is painted in place: boxes that are uploaded
        self._is_changing = False
        self.texture = context.texture((1, 1), 1, b"\0")

    def upload(self, pixels: np.ndarray | None, touched: Sequence[Box] = ()) -> None:
        """`pixels` (h, w) or (h, w, channels): bool, u8, u16 or f32; None is one black px.

        `touched`: of pixels (u8) that are painted in place, the boxes that changed, since they
        were first shown and in this order. Only the new ones are uploaded.
        """
        fresh, self._touched = touched[self._touched :], len(touched)
        if pixels is self._uploaded:
            self._refresh(fresh)
            return
        self.texture.release()
        self._uploaded = pixels
        shown = np.zeros((1, 1), np.uint8) if pixels is None else self._fitting(_as_u8(pixels))
        height, width = shown.shape[:2]
        channels = shown.size // (height * width)
        data = np.ascontiguousarray(shown)
        self.texture = self._context.texture((width, height), channels, data, alignment=1)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._is_changing = bool(touched)
        if self._has_mipmaps:
            self.texture.build_mipmaps()
        self.texture.filter = (self._below, moderngl.LINEAR)

    def _refresh(self, boxes: Sequence[Box]) -> None:
        """The part around `boxes` once more. Mipmaps wait until the picture is another one."""
        pixels = self._uploaded
        if not boxes or pixels is None:
            return
        x0, y0 = min(b[0] for b in boxes), min(b[1] for b in boxes)
        x1, y1 = max(b[2] for b in boxes), max(b[3] for b in boxes)
        self._is_changing = True
        if self.texture.size == (pixels.shape[1], pixels.shape[0]):
            part = np.ascontiguousarray(pixels[y0:y1, x0:x1])
            self.texture.write(part, viewport=(x0, y0, x1 - x0, y1 - y0), alignment=1)
        else:  # a photo larger than the GPU takes, shown halved
            self._uploaded = None
            self.upload(pixels)

    @property
    def glo(self) -> int:
        """OpenGL's number of the texture."""
        return self.texture.glo

    @property
    def _below(self) -> int:
        has_mipmaps = self._has_mipmaps and not self._is_changing
        return moderngl.LINEAR_MIPMAP_LINEAR if has_mipmaps else moderngl.LINEAR

    def use(self, unit: int, zoom: float) -> None:
        """Binds it: single pixels at high magnification, smooth below."""
        above = moderngl.NEAREST if zoom >= SHARP_FROM else moderngl.LINEAR
        # Where nothing is shrunk no mipmap is read; emulated, looking for one doubles the time.
        self.texture.filter = (self._below if zoom < 1 else above, above)
        self.texture.use(unit)

    def _fitting(self, pixels: np.ndarray) -> np.ndarray:
        """Halved until the GPU takes it."""
        while max(pixels.shape[:2]) > self._limit:
            size = (pixels.shape[1] // 2, pixels.shape[0] // 2)
            pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        return pixels


def _as_u8(pixels: np.ndarray) -> np.ndarray:
    if pixels.dtype == np.uint16:
        return (pixels >> 8).astype(np.uint8)
    if pixels.dtype == np.bool_:
        return pixels.view(np.uint8) * np.uint8(255)
    if pixels.dtype == np.float32:
        return (pixels * 255 + 0.5).astype(np.uint8)
    return pixels
