"""The window's last picture below the interface: copied as long as nothing of it changes.

Where OpenGL is emulated, drawing it takes longer than all of the interface, and most frames only
move the pointer.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import moderngl

from objectmorpher_core.arrays import U8

from ..view import View
from .scene import Colour, Scene

PLAIN = (int, float, str, bool)


class KeptCanvas:
    """A framebuffer as large as the window."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._size = (0, 0)
        self._color: moderngl.Texture | None = None
        self.buffer: moderngl.Framebuffer | None = None
        self._scene: Scene | None = None  # what it shows, and how
        self._place: tuple[Any, ...] = ()

    def shows(self, scene: Scene, view: View, place: tuple[Any, ...]) -> bool:
        """Whether it shows this already; `place`: where, and on what colour."""
        place = (*place, *view.place, view.scale)
        is_same = self._scene is not None and place == self._place and same(scene, self._scene)
        self._scene, self._place = scene, place
        return is_same

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


def same(a: Any, b: Any) -> bool:
    """Whether two parts of scenes are the same: arrays and documents by identity."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, PLAIN):
        return a == b
    if is_dataclass(a) and type(a).__module__ == Scene.__module__:  # made anew for each frame
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    return False
