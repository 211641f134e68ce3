"""What lies under the objects while the view stands still: the photo, and the edit's background."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from objectmorpher_core.base.arrays import U8

from ..editor.view import View
from .kept_canvas import Place, same_scene
from .layer_pass import photo_box
from .scene import Scene

Draw = Callable[[Scene], U8]  # (h, w, 4) of the canvas, upright


class StillView:
    """Two pictures of a view, for `flattening`."""

    def __init__(self) -> None:
        self._place: Place = ()
        self._pictures: dict[str, tuple[Scene, U8]] = {}  # with what they were drawn from

    def flat(self, scene: Scene, view: View, place: Place, draw: Draw) -> U8 | None:
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
