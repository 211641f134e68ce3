"""Puts a rendered object out of focus on the GPU, as `compose.defocus.blurred` does."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import moderngl

from .shaders import Programs, set_uniforms

if TYPE_CHECKING:
    from .splat_pass import SplatPicture

_UNITS = {"picture": 0}


class DefocusPass:
    """Two passes, across and down; its pictures are valid until the next call."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs = Programs(context, "fullscreen.vert", "defocus.frag", _UNITS)
        self._targets: tuple[moderngl.Framebuffer, ...] = ()

    def draw(self, picture: SplatPicture, blur: float) -> SplatPicture:
        """The picture, its colour and alpha blurred by so many of its px."""
        from objectmorpher_core.compose.light.defocus import reach_of

        program, array = self._programs()
        source = picture.color
        self._context.enable_only(moderngl.NOTHING)
        for target, step in zip(self._sized(source.size), ((1, 0), (0, 1)), strict=True):
            target.use()
            source.use(_UNITS["picture"])
            set_uniforms(program, way=step, reach=reach_of(blur), blur=blur)
            array.render(moderngl.TRIANGLES, 3)
            source = target.color_attachments[0]
            assert isinstance(source, moderngl.Texture)
        return replace(picture, color=source)

    def _sized(self, size: tuple[int, int]) -> tuple[moderngl.Framebuffer, ...]:
        """What is drawn into; made anew when the canvas has changed."""
        if not self._targets or self._targets[0].size != size:
            for target in self._targets:
                for texture in target.color_attachments:
                    texture.release()
                target.release()
            textures = [self._context.texture(size, 4, dtype="f2") for _ in range(2)]
            for texture in textures:
                texture.filter = moderngl.NEAREST, moderngl.NEAREST
            self._targets = tuple(self._context.framebuffer([texture]) for texture in textures)
        return self._targets
