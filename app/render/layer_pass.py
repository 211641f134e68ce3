"""Draws rendered objects, premultiplied, over the photo."""

from __future__ import annotations

import moderngl
import numpy as np

from ..derived import Layer
from ..view import View
from .scene import Scene
from .shaders import build_program, set_uniforms


class LayerPass:
    """One rectangle an object; its texture is replaced when the layer is not the last one."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = build_program(context, "quad.vert", "layer.frag")
        self._quad = context.vertex_array(self._program, [])
        self._textures: list[tuple[Layer, moderngl.Texture]] = []
        set_uniforms(self._program, layer=0)

    def draw(self, scene: Scene, view: View) -> None:
        """Into the current viewport, which is the canvas."""
        self._upload(scene.layers)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        for layer, texture in self._textures:
            height, width = layer.rgba.shape[:2]
            box = (layer.left, layer.top, layer.left + width, layer.top + height)
            split = scene.split * view.width
            set_uniforms(self._program, canvas=(view.width, view.height), box=box, split=split)
            texture.use(0)
            self._quad.render(moderngl.TRIANGLE_STRIP, 4)
        self._context.disable(moderngl.BLEND)

    def _upload(self, layers: tuple[Layer, ...]) -> None:
        known = {id(layer): texture for layer, texture in self._textures}
        for layer, texture in self._textures:
            if all(layer is not other for other in layers):
                texture.release()
        self._textures = [
            (layer, known[id(layer)] if id(layer) in known else self._texture(layer))
            for layer in layers
        ]

    def _texture(self, layer: Layer) -> moderngl.Texture:
        height, width = layer.rgba.shape[:2]
        data = (layer.rgba * 255 + 0.5).clip(0, 255).astype(np.uint8)
        texture = self._context.texture((width, height), 4, data, alignment=1)
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return texture
