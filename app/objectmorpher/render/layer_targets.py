"""The off-screen pictures in which the layers of an object are put together."""

from __future__ import annotations

import moderngl

from objectmorpher_core.raster.rules import LAYERS

FAR = 1e30  # depth of a pixel without a front
CELL = 16  # px, of which one texel says whether anything is left for the next layer


class LayerTargets:
    """As large as a band of the picture: a canvas of any size needs no more memory.

    232 bytes a pixel.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int]) -> None:
        self.size = size
        self.cells = (-(-size[0] // CELL), -(-size[1] // CELL))
        self._context = context
        self._textures: list[moderngl.Texture] = []
        texture, build = self._texture, context.framebuffer
        self._depth = context.depth_renderbuffer(size)
        self.fronts = [texture(4) for _ in range(LAYERS - 1)]
        self.sums = [texture(4) for _ in range(4)] + [texture(1)]
        self.color, self.detail, self.median = texture(4), texture(4), texture(4)
        # what a layer has to know of the one before: two sets in turn
        self.looks, self.covers = [texture(4) for _ in range(2)], [texture(4) for _ in range(2)]
        self.lefts = [texture(1, self.cells, "f2") for _ in range(2)]
        states = list(zip(self.looks, self.covers, strict=True))
        self.front_buffers = [build([front], self._depth) for front in self.fronts]
        self.sum_buffer = build(self.sums)
        pixels = [self.color, self.detail, self.median]
        self.layer_buffers = [build([*pixels, *state]) for state in states]
        self.reset_buffers = [build([*self.sums, *state]) for state in states]
        self.left_buffers = [build([left]) for left in self.lefts]

    def _texture(
        self, components: int, size: tuple[int, int] | None = None, bits: str = "f4"
    ) -> moderngl.Texture:
        texture = self._context.texture(size or self.size, components, dtype=bits)
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self._textures.append(texture)
        return texture

    def release(self) -> None:
        for buffer in (
            *self.front_buffers, self.sum_buffer, *self.layer_buffers, *self.reset_buffers,
            *self.left_buffers,
        ):  # fmt: skip
            buffer.release()
        for texture in self._textures:
            texture.release()
        self._depth.release()
