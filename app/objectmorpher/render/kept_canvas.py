"""The window's last picture below the interface: copied as long as nothing of it changes.

Where OpenGL is emulated, drawing it takes longer than all of the interface, and most frames only
move the pointer.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, TypeAlias

import moderngl

from objectmorpher_core.base.arrays import U8

from ..canvas.memo import same
from .scene import Colour, Scene

Place: TypeAlias = tuple[Any, ...]  # where the canvas is, what part of the picture, on what colour


class KeptCanvas:
    """A framebuffer as large as the window."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._size = (0, 0)
        self._color: moderngl.Texture | None = None
        self.buffer: moderngl.Framebuffer | None = None
        self._scene: Scene | None = None  # what it shows, and how
        self._place: Place = ()

    def shows(self, scene: Scene, place: Place) -> bool:
        """Whether it shows this already."""
        before, self._scene = self._scene, scene
        is_there, self._place = place == self._place, place
        return is_there and before is not None and same_scene(scene, before)

    def begin(self, size: tuple[int, int], surround: Colour) -> moderngl.Framebuffer:
        """Empties it, to be drawn anew; the whole window in one colour."""
        if self.buffer is None or size != self._size:
            self.forget()
            self._size, self._color = size, self._context.texture(size, 4)
            self.buffer = self._context.framebuffer([self._color])
        self.buffer.clear(*surround, 1.0)
        return self.buffer

    def write(self, pixels: U8, viewport: tuple[int, int, int, int]) -> None:
        """A picture of the canvas (h, w, 4), bottom row first, in place of what it shows there."""
        assert self._color is not None
        self._color.write(pixels, viewport=viewport)

    def forget(self) -> None:
        """Nothing is kept."""
        if self.buffer is not None and self._color is not None:
            self.buffer.release()
            self._color.release()
        self.buffer = self._color = self._scene = None


def same_scene(a: Any, b: Any) -> bool:
    """Whether two scenes, or parts of them, are the same; they are made anew for each frame."""
    if type(a) is type(b) and is_dataclass(a) and type(a).__module__ == Scene.__module__:
        return all(same_scene(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same_scene, a, b))
    return same(a, b)
