"""Photo-textured Gaussians on the GPU: surface splatting in three passes (raster/reference.py).

The front surface's depth, then the sums of its layer in any order (so nothing is sorted), then
one look-up of the photo per pixel. What lies behind the first layer is peeled the same way once
more: two layers are all that a solid object shows through a soft edge.

OpenGL 3.3 core, without storage buffers or compute, so that macOS runs it.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from objectmorpher_core.camera import Camera
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.rules import RULES
from objectmorpher_core.raster.texture import TextureLevels

from .shaders import build_program, set_uniforms

# The projected Gaussian's columns as the vertex shader takes them.
COLUMNS = (
    tiles.CX, tiles.CY, tiles.QXX, tiles.QXY, tiles.QYY, tiles.EX, tiles.EY, tiles.Z, tiles.ZX,
    tiles.ZY, tiles.SX, tiles.SY, tiles.AXX, tiles.AXY, tiles.AYX, tiles.AYY, tiles.LOD,
    tiles.PHOTO, tiles.BODY, tiles.SEEN, tiles.RED, tiles.GREEN, tiles.BLUE, tiles.MATTED,
    tiles.SOLID,
)  # fmt: skip
FORMAT = "2f 3f 2f 3f 2f 4f 4f 3f 2f /i"
ATTRIBUTES = (
    "centre", "conic", "extent", "plane", "shift", "shift_slope", "weights", "color", "edge",
)  # fmt: skip
LEAST_FRONT = 0.01  # kernel weight from which a Gaussian makes a surface
CHAIN = 2.0  # x gap: a steep surface is one layer down to here behind its front
LAYERS = 2


@dataclass(eq=False)
class _Targets:
    """The off-screen pictures of one canvas size."""

    size: tuple[int, int]
    fronts: list[moderngl.Texture]  # R32F, depth of each layer's front
    depth_buffers: list[moderngl.Framebuffer]
    sums: list[moderngl.Texture]  # RGBA32F
    sum_buffer: moderngl.Framebuffer
    results: list[moderngl.Texture]  # RGBA16F, one per layer
    looks: list[moderngl.Texture]  # RGBA32F, where each layer looks in the photo
    result_buffers: list[moderngl.Framebuffer]

    def release(self) -> None:
        for item in (*self.depth_buffers, self.sum_buffer, *self.result_buffers):
            item.release()
        for texture in (*self.fronts, *self.sums, *self.results, *self.looks):
            texture.release()


class SplatPass:
    """Draws one object after the other into textures, front layer and the one behind."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._depth = build_program(context, "splat.vert", "splat_depth.frag")
        self._sum = build_program(context, "splat.vert", "splat_sum.frag")
        self._resolve = build_program(context, "fullscreen.vert", "splat_resolve.frag")
        self._cover = context.vertex_array(self._resolve, [])
        self._instances: moderngl.Buffer | None = None
        self._arrays: dict[str, moderngl.VertexArray] = {}
        self._texture: moderngl.Texture | None = None
        self._uploaded: TextureLevels | None = None
        self._targets: _Targets | None = None
        for program in (self._depth, self._sum):
            set_uniforms(program, cutoff=RULES.cutoff, tail=RULES.tail, front=0, before=1)
        set_uniforms(self._depth, least=LEAST_FRONT)
        set_uniforms(
            self._resolve, sum_shift=0, sum_color=1, sum_slope=2, sum_edge=3, photo=4,
            look_before=5, result_before=6, same_point=RULES.same_point,
            level=RULES.surface_level, edge_width=RULES.edge_width,
        )  # fmt: skip

    def draw(
        self, splats: PosedSplats, texture: TextureLevels, camera: Camera, photo_camera: Camera
    ) -> tuple[moderngl.Texture, ...]:
        """The object as `camera` sees it: premultiplied RGBA16F, front layer first.

        Row 0 of the textures is the top row of the picture. They stay valid until the next call.
        """
        targets = self._sized(camera.width, camera.height)
        projected = tiles.project(splats, camera, photo_camera)
        count = self._upload(projected)
        self._upload_texture(texture)
        depths = projected[projected[:, tiles.Z] > 0, tiles.Z]
        near, far = (depths.min(), depths.max()) if len(depths) else (0.0, 1.0)
        margin = 4 * splats.gap
        for program in (self._depth, self._sum):
            set_uniforms(
                program, size=targets.size, near_far=(float(near - margin), float(far + margin)),
                gap=CHAIN * splats.gap,
            )  # fmt: skip
        set_uniforms(
            self._resolve, view=(camera.focal, camera.cx, camera.cy),
            photo_camera=(photo_camera.focal, photo_camera.cx, photo_camera.cy),
            corner=(texture.left, texture.top),
        )  # fmt: skip
        for layer in range(LAYERS):
            self._draw_layer(targets, layer, count)
        return tuple(targets.results)

    def _draw_layer(self, targets: _Targets, layer: int, count: int) -> None:
        context = self._context
        before = targets.fronts[max(layer - 1, 0)]
        buffer = targets.depth_buffers[layer]
        buffer.use()
        buffer.clear(-1e30, depth=1.0)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        before.use(0)
        set_uniforms(self._depth, peels=layer > 0)
        self._arrays["depth"].render(moderngl.TRIANGLE_STRIP, 4, instances=count)

        targets.sum_buffer.use()
        targets.sum_buffer.clear()
        context.enable_only(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        targets.fronts[layer].use(0)
        before.use(1)
        set_uniforms(self._sum, peels=layer > 0)
        self._arrays["sum"].render(moderngl.TRIANGLE_STRIP, 4, instances=count)

        buffer = targets.result_buffers[layer]
        buffer.use()
        buffer.clear()
        context.enable_only(moderngl.NOTHING)
        for unit, texture in enumerate(targets.sums):
            texture.use(unit)
        assert self._texture is not None
        self._texture.use(4)
        if layer > 0:
            targets.looks[layer - 1].use(5)
            targets.results[layer - 1].use(6)
        set_uniforms(self._resolve, peels=layer > 0)
        self._cover.render(moderngl.TRIANGLES, 3)

    def _upload(self, projected: np.ndarray) -> int:
        """Projected Gaussians (N, ...) as instance attributes; returns N."""
        data = np.ascontiguousarray(projected[:, COLUMNS], np.float32)
        if self._instances is None or self._instances.size < data.nbytes:
            for array in self._arrays.values():
                array.release()
            if self._instances is not None:
                self._instances.release()
            self._instances = self._context.buffer(reserve=max(data.nbytes, 4), dynamic=True)
            self._arrays = {
                name: self._context.vertex_array(program, [_layout(program, self._instances)])
                for name, program in (("depth", self._depth), ("sum", self._sum))
            }
        self._instances.orphan()
        self._instances.write(data)
        return len(data)

    def _upload_texture(self, texture: TextureLevels) -> None:
        if texture is self._uploaded:
            return
        if self._texture is not None:
            self._texture.release()
        height, width = texture.levels[0].shape[:2]
        data = texture.levels[0].astype(np.float16)
        self._texture = self._context.texture((width, height), 4, data.tobytes(), dtype="f2")
        self._texture.repeat_x = self._texture.repeat_y = False
        self._texture.build_mipmaps()
        self._texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        self._uploaded = texture

    def _sized(self, width: int, height: int) -> _Targets:
        """Targets of this size; made anew when the canvas changed."""
        if self._targets is not None and self._targets.size == (width, height):
            return self._targets
        if self._targets is not None:
            self._targets.release()
        context, size = self._context, (width, height)
        fronts = [context.texture(size, 1, dtype="f4") for _ in range(LAYERS)]
        sums = [context.texture(size, 4, dtype="f4") for _ in range(4)]
        results = [context.texture(size, 4, dtype="f2") for _ in range(LAYERS)]
        looks = [context.texture(size, 4, dtype="f4") for _ in range(LAYERS)]
        for texture in (*fronts, *sums, *results, *looks):
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self._targets = _Targets(
            size, fronts,
            [context.framebuffer([f], context.depth_renderbuffer(size)) for f in fronts],
            sums, context.framebuffer(sums), results, looks,
            [context.framebuffer(list(pair)) for pair in zip(results, looks, strict=True)],
        )  # fmt: skip
        return self._targets


def _layout(program: moderngl.Program, buffer: moderngl.Buffer) -> tuple[object, ...]:
    """The buffer's description; attributes that a program does not read are skipped."""
    words = FORMAT.removesuffix(" /i").split()
    used = [name in program for name in ATTRIBUTES]
    padded = [w if u else f"{4 * int(w[0])}x" for w, u in zip(words, used, strict=True)]
    names = [n for n, u in zip(ATTRIBUTES, used, strict=True) if u]
    return (buffer, " ".join(padded) + " /i", *names)
