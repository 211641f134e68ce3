"""The pictures under the objects of a still view: the photo, and the edit's background."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeAlias

import moderngl

from objectmorpher_core.base.arrays import U8

from ..canvas.memo import same
from ..editor.view import ViewState
from .layer_pass import photo_box
from .scene import Colour, Scene

Draw = Callable[[Scene], U8]  # (h, w, 4) of the canvas, upright


class StillView:
    """Two pictures of a view, for `flattening`."""

    def __init__(self) -> None:
        self._place: Place = ()
        self._pictures: dict[str, tuple[Scene, U8]] = {}  # with what they were drawn from

    def flat(self, scene: Scene, view: ViewState, place: Place, draw: Draw) -> U8 | None:
        """The canvas, its rows from the bottom up; None where the shaders have to draw it.

        That is when the view moves, and where the scene is more than an edited photo. `draw`
        makes a picture by the shaders.
        """
        is_still, self._place = place == self._place, place
        if not is_still:
            self._pictures.clear()
        if not is_still or scene.blend is None or not _is_plain(scene):
            return None
        from .flattening import flatten

        under = Scene(scene.photo, scene.surround)
        photo = self._picture("photo", under, draw)
        back = photo
        if scene.plate is not None or scene.mask is not None:
            behind = replace(under, plate=scene.plate, mask=scene.mask, hatch=scene.hatch)
            back = self._picture("back", behind, draw)
        return flatten(
            photo, back, scene.blend, scene.shades + scene.layers, photo_box(scene, view)
        )  # fmt: skip

    def _picture(self, name: str, scene: Scene, draw: Draw) -> U8:
        kept = self._pictures.get(name)
        if kept is None or not same_scene(kept[0], scene):
            kept = self._pictures[name] = (scene, draw(scene))
        return kept[1]


def _is_plain(scene: Scene) -> bool:
    """Whether there is nothing but the photo, a background, shadows and objects."""
    if scene.objects or scene.paper is not None or scene.split > 0 or scene.veil > 0:
        return False
    layers = scene.shades + scene.layers
    return not any(layer.is_tint or layer.invented is not None for layer in layers)


# The window's last picture below the interface: copied as long as nothing of it changes.

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
        """Forget everything."""
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
