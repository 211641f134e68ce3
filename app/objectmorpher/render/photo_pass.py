"""Draws the photo, the plate over it, the veil and the hatching."""

from __future__ import annotations

from typing import Any

import moderngl

from ..editor.view import ViewState
from .gpu_memory import BLEND, ORIGINAL, PictureTexture, blend_cells
from .scene import Hatch, Scene
from .shaders import Programs, set_uniforms

PHOTO, PLATE, MASK = range(3)  # texture units; BLEND is bound by the renderer
_UNITS = {"photo": PHOTO, "plate": PLATE, "mask": MASK, "blend": BLEND}


class PhotoPass:
    """Draws one rectangle over the whole canvas."""

    def __init__(self, context: moderngl.Context) -> None:
        self._programs = Programs(context, "quad.vert", "photo.frag", _UNITS)
        self._photo = PictureTexture(context)
        self._plate = PictureTexture(context)
        self._mask = PictureTexture(context)

    def draw(self, scene: Scene, view: ViewState) -> None:
        """Draw into the current viewport, which is the canvas."""
        self._photo.upload(scene.photo, zoom=view.zoom)
        self._plate.upload(scene.plate.pixels if scene.plate else None, zoom=view.zoom)
        self._mask.upload(scene.mask, scene.touched, view.zoom)
        self._photo.use(PHOTO, view.zoom)
        self._plate.use(PLATE, view.zoom)
        self._mask.use(MASK, view.zoom)
        self.use_photo(view)
        height, width = scene.photo.shape[:2]
        plate_box = scene.plate.box if scene.plate else (0, 0, -1, -1)
        program, quad = self._programs(*_defines(scene))
        set_uniforms(
            program,
            canvas=(view.width, view.height),
            box=(0, 0, view.width, view.height),
            corner=(view.left, view.top),
            zoom=view.zoom,
            photo_size=(width, height),
            plate_box=tuple(float(v) for v in plate_box),
            split=scene.split * view.width,
            surround=scene.surround,
            veil=scene.veil,
            hatch=0.0 if scene.hatch is None else 1.0,
            **hatch_uniforms(scene.hatch, view),
            **_paper_uniforms(scene),
            cells=blend_cells(scene),
        )
        quad.render(moderngl.TRIANGLE_STRIP, 4)

    def use_photo(self, view: ViewState) -> None:
        """Bind what was uploaded last, for the layers over it."""
        self._photo.use(ORIGINAL, view.zoom)


def hatch_uniforms(hatch: Hatch | None, view: ViewState) -> dict[str, Any]:
    """Return the uniforms of shaders/hatch.glsl."""
    if hatch is None:
        return {"unit": view.scale}
    return {
        "unit": view.scale, "ink": hatch.ink, "strength": hatch.strength,
        "brightness": hatch.brightness, "slant": hatch.slant,
    }  # fmt: skip


def _paper_uniforms(scene: Scene) -> dict[str, Any]:
    if scene.paper is None:
        return {}
    return {"paper": scene.paper[0], "checked": scene.paper[1]}


def _defines(scene: Scene) -> list[str]:
    """What of photo.frag the scene needs."""
    parts = {
        "HAS_PLATE": scene.plate, "HAS_MASK": scene.mask, "HAS_BLEND": scene.blend,
        "HAS_PAPER": scene.paper,
    }  # fmt: skip
    return [name for name, part in parts.items() if part is not None]
