"""Draws rendered objects, premultiplied, over the photo."""

from __future__ import annotations

import moderngl
import numpy as np

from ..layers import Draft, Layer
from ..view import View
from .blend_texture import BLEND, blend_cells
from .scene import Scene
from .shaders import build_program, set_uniforms
from .textures import PictureTexture

LAYER, LOOKS, CROP = range(3)  # texture units
KEPT_CROPS = 4


class LayerPass:
    """One rectangle an object. Textures are replaced when the layer is not the last one."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._exact = build_program(context, "quad.vert", "layer.frag")
        self._draft = build_program(context, "quad.vert", "draft.frag")
        self._exact_quad = context.vertex_array(self._exact, [])
        self._draft_quad = context.vertex_array(self._draft, [])
        self._uploaded: dict[int, tuple[Layer, list[moderngl.Texture]]] = {}
        self._crops: dict[int, tuple[np.ndarray, PictureTexture]] = {}
        set_uniforms(self._exact, layer=LAYER, blend=BLEND)
        set_uniforms(self._draft, layer=LAYER, looks=LOOKS, crop=CROP, blend=BLEND)

    def draw(self, scene: Scene, view: View) -> None:
        """Into the current viewport, which is the canvas."""
        self._forget(scene.layers)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        for layer in scene.layers:
            for unit, texture in enumerate(self._textures(layer)):
                texture.use(unit)
            program = self._exact if layer.draft is None else self._draft
            set_uniforms(
                program,
                canvas=(view.width, view.height),
                box=layer.box,
                photo_box=_photo_box(scene, view),
                cells=blend_cells(scene),
                split=scene.split * view.width,
            )
            if layer.draft is not None:
                self._use_draft(layer.draft, view)
            quad = self._exact_quad if layer.draft is None else self._draft_quad
            quad.render(moderngl.TRIANGLE_STRIP, 4)
        self._context.disable(moderngl.BLEND)

    def draw_texture(self, texture: moderngl.Texture, scene: Scene, view: View) -> None:
        """A picture of the whole canvas that is on the GPU already."""
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        texture.use(LAYER)
        set_uniforms(
            self._exact,
            canvas=(view.width, view.height),
            box=(0, 0, view.width, view.height),
            photo_box=_photo_box(scene, view),
            cells=blend_cells(scene),
            split=scene.split * view.width,
        )
        self._exact_quad.render(moderngl.TRIANGLE_STRIP, 4)
        self._context.disable(moderngl.BLEND)

    def _use_draft(self, draft: Draft, view: View) -> None:
        height, width = draft.texture.shape[:2]
        crop_box = (draft.left, draft.top, draft.left + width, draft.top + height)
        corner = (view.left, view.top)
        set_uniforms(self._draft, crop_box=crop_box, corner=corner, zoom=view.zoom)
        if id(draft.texture) not in self._crops:
            picture = PictureTexture(self._context)
            picture.upload(_as_u8(draft.texture))
            kept = list(self._crops.items())[: KEPT_CROPS - 1]
            self._crops = {id(draft.texture): (draft.texture, picture), **dict(kept)}
        self._crops[id(draft.texture)][1].use(CROP, min(view.zoom, 1.0))

    def _forget(self, layers: tuple[Layer, ...]) -> None:
        """Releases what is not shown any more."""
        kept = {id(layer) for layer in layers}
        for key in [key for key in self._uploaded if key not in kept]:
            for texture in self._uploaded.pop(key)[1]:
                texture.release()

    def _textures(self, layer: Layer) -> list[moderngl.Texture]:
        if id(layer) not in self._uploaded:
            height, width = layer.rgba.shape[:2]
            size = (width, height)
            textures = [self._context.texture(size, 4, _as_u8(layer.rgba), alignment=1)]
            if layer.draft is not None:
                looks = np.ascontiguousarray(layer.draft.looks)
                textures.append(self._context.texture(size, 4, looks, dtype="f4"))
            near = moderngl.NEAREST if layer.draft is None else moderngl.LINEAR
            for texture in textures:
                texture.filter = near, near
                texture.repeat_x = texture.repeat_y = False
            self._uploaded[id(layer)] = (layer, textures)
        return self._uploaded[id(layer)][1]


def _photo_box(scene: Scene, view: View) -> tuple[float, float, float, float]:
    """The photo on the canvas: what lies beyond it is not exported."""
    height, width = scene.photo.shape[:2]
    (x0, y0), (x1, y1) = view.canvas_from_image(np.array([[0, 0], [width, height]]))
    return float(x0), float(y0), float(x1), float(y1)


def _as_u8(rgba: np.ndarray) -> np.ndarray:
    if rgba.dtype == np.uint8:
        return rgba
    return (rgba * 255 + 0.5).clip(0, 255).astype(np.uint8)
