"""The passes in their order."""

from __future__ import annotations

import logging

import moderngl

from ..view import View
from .layer_pass import LayerPass
from .photo_pass import PhotoPass
from .scene import Scene

log = logging.getLogger(__name__)

SOFTWARE = ("llvmpipe", "softpipe", "swr", "software")


class Renderer:
    """Draws scenes into the canvas's part of the window."""

    def __init__(self, context: moderngl.Context, wanted: str) -> None:
        """`wanted`: "gl", "tiles" or "auto" (tiles where OpenGL is emulated)."""
        self.gl_name = str(context.info["GL_RENDERER"])
        is_software = any(word in self.gl_name.lower() for word in SOFTWARE)
        self.kind = ("tiles" if is_software else "gl") if wanted == "auto" else wanted
        self._context = context
        self._photo_pass = PhotoPass(context)
        self._layer_pass = LayerPass(context)
        log.info("OpenGL by %s; objects drawn by %s", self.gl_name, self.kind)

    def draw(self, scene: Scene, view: View, viewport: tuple[int, int, int, int]) -> None:
        """`viewport`: left, bottom, width, height of the canvas, framebuffer px."""
        self._context.viewport = viewport
        self._context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._photo_pass.draw(scene, view)
        self._layer_pass.draw(scene, view)
