"""Where the edit is shown and where the photo, for the passes that ask."""

from __future__ import annotations

import moderngl
import numpy as np

from ..canvas.blend import CELL
from .scene import Scene
from .textures import PictureTexture

BLEND = 7  # texture unit, bound for all passes
ALL = np.ones((1, 1), np.float32)  # the edit everywhere


class BlendTexture:
    """The scene's blend on the GPU."""

    def __init__(self, context: moderngl.Context) -> None:
        self._texture = PictureTexture(context, has_mipmaps=False)

    def use(self, scene: Scene) -> None:
        self._texture.upload(ALL if scene.blend is None else scene.blend)
        self._texture.use(BLEND, 1.0)


def blend_cells(scene: Scene) -> tuple[float, float]:
    """Canvas px that the blend covers."""
    if scene.blend is None:
        return 1.0, 1.0
    height, width = scene.blend.shape
    return float(width * CELL), float(height * CELL)
