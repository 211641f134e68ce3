"""A picture copied into the window as memory, where OpenGL is emulated.

The rows of an emulated window run from the top down, its colours are blue, green, red. From a
texture that has both alike the driver copies rows; from any other it draws every pixel, which took
a sixth of a frame. moderngl names neither the order of colours nor the ends of a copy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import glcontext
import moderngl

TEXTURE_2D, RGBA, BGRA, UNSIGNED_BYTE = 0x0DE1, 0x1908, 0x80E1, 0x1401
READ_FRAMEBUFFER, COLOR_BUFFER_BIT, NEAREST = 0x8CA8, 0x4000, 0x2600
INT, NUMBER = ctypes.c_int, ctypes.c_uint


@dataclass(frozen=True)
class RowCopy:
    """Three functions of the current OpenGL context."""

    _tex_image: Callable[..., None]
    _bind: Callable[..., None]
    _blit: Callable[..., None]

    @classmethod
    def found(cls) -> RowCopy | None:
        """Of the window's context; None where it is of another kind."""
        try:
            context: Any = glcontext.default_backend()(mode="detect", glversion=330)
        except Exception:  # whatever a driver says: the usual copy is as good
            return None

        def function(name: str, *types: Any) -> Callable[..., None]:
            return ctypes.CFUNCTYPE(None, *types)(context.load(name))

        image = NUMBER, *[INT] * 5, NUMBER, NUMBER, ctypes.c_void_p
        return cls(
            function("glTexImage2D", *image),
            function("glBindFramebuffer", NUMBER, NUMBER),
            function("glBlitFramebuffer", *[INT] * 8, NUMBER, NUMBER),
        )

    def make_alike(self, texture: moderngl.Texture) -> None:
        """Give an empty texture of four bytes the window's order of colours."""
        texture.use(0)
        self._tex_image(TEXTURE_2D, 0, RGBA, *texture.size, 0, BGRA, UNSIGNED_BYTE, None)

    def copy_upright(
        self, source: moderngl.Framebuffer, target: moderngl.Framebuffer, size: tuple[int, int]
    ) -> None:
        """Copy a picture of that size whose rows run from the top down."""
        target.use()
        self._bind(READ_FRAMEBUFFER, source.glo)
        width, height = size
        self._blit(0, 0, *size, 0, height, width, 0, COLOR_BUFFER_BIT, NEAREST)
        target.use()
