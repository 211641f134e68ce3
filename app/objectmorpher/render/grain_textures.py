"""Grain on the GPU, for shaders/grain.glsl."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np

from ..editor.view import View

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.grain import Grain
    from objectmorpher_core.compose.light.noise import Noise


class GrainTextures:
    """The noise of a photo, and how much of it one object is given."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._noise: Noise | None = None
        self._level = -1  # how often the tile is halved
        self._tile: moderngl.TextureArray | None = None
        self._deviations: moderngl.Texture | None = None
        self._amounts: moderngl.Texture | None = None

    def use(self, grain: Grain, view: View, units: tuple[int, int, int]) -> dict[str, Any]:
        """Binds amounts, tile and deviations to texture units; what the shader asks for."""
        from objectmorpher_core.compose.light.grain import tile_level

        level = tile_level(view.zoom)
        if grain.noise is not self._noise or level != self._level:
            self._upload_noise(grain.noise, level)
        if self._amounts is not None:
            self._amounts.release()
        self._amounts = self._texture(grain.padded)
        self._amounts.filter = moderngl.LINEAR, moderngl.LINEAR
        self._amounts.repeat_x = self._amounts.repeat_y = False
        assert self._tile is not None and self._deviations is not None
        for texture, unit in zip((self._amounts, self._tile, self._deviations), units, strict=True):
            texture.use(unit)
        rows, columns = grain.padded.shape[:2]
        corner = np.array([grain.left, grain.top]) - grain.pitch
        low = view.canvas_from_image(corner)
        high = view.canvas_from_image(corner + grain.pitch * np.array([columns, rows]))
        return {
            "amounts_box": (float(low[0]), float(low[1]), float(high[0]), float(high[1])),
            "corner": (view.left, view.top), "zoom": view.zoom, "grain_texel": float(2**level),
        }  # fmt: skip

    def _upload_noise(self, noise: Noise, level: int) -> None:
        for texture in (self._tile, self._deviations):
            if texture is not None:
                texture.release()
        tile = noise.levels[level]
        bands, height, width = tile.shape[:3]
        data = np.ascontiguousarray(tile, np.float32)
        size = (width, height, bands)
        self._tile = self._context.texture_array(size, 3, data, alignment=1, dtype="f4")
        self._tile.filter = moderngl.NEAREST, moderngl.NEAREST
        self._deviations = self._texture(noise.deviation[None])
        self._deviations.filter = moderngl.NEAREST, moderngl.NEAREST
        self._noise, self._level = noise, level

    def _texture(self, values: np.ndarray) -> moderngl.Texture:
        """(h, w, channels) f32."""
        height, width, channels = values.shape
        data = np.ascontiguousarray(values, np.float32)
        return self._context.texture((width, height), channels, data, alignment=1, dtype="f4")
