"""Small pictures in panels: thumbnails, on the GPU as long as they are drawn."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from ...render.renderer import Renderer
from ...render.textures import PictureTexture

KEPT = 24  # pictures, the least recently drawn go first


class Textures:
    """The window's pictures by the identity of their pixels. One instance, `pictures`."""

    def __init__(self) -> None:
        self._renderer: Renderer | None = None
        self._textures: dict[int, tuple[np.ndarray, PictureTexture]] = {}

    def use(self, renderer: Renderer) -> None:
        """The window's renderer, whose context owns the textures."""
        self._renderer, self._textures = renderer, {}

    def texture(self, pixels: np.ndarray) -> imgui.ImTextureRef:
        """Return ImGui's texture of `pixels` (h, w, 3) u8."""
        assert self._renderer is not None, "the window says which renderer"
        found = self._textures.pop(id(pixels), None)
        if found is None:
            found = (pixels, self._renderer.picture(pixels))
        self._textures[id(pixels)] = found
        while len(self._textures) > KEPT:
            oldest = next(iter(self._textures))
            self._textures.pop(oldest)[1].texture.release()
        return imgui.ImTextureRef(found[1].glo)


pictures = Textures()
