"""Photo-textured Gaussians and surfaces in layers: steps 4 to 7 of `raster/reference.py`.

A layer is three passes: its front, the nearest sample of each pixel, by the depth test; its sums,
by additive blending in any order; and its pixels. Nothing is sorted. Rectangles where nothing is
left for a later layer are not drawn.
"""

from __future__ import annotations

import logging
import math
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import moderngl
import numpy as np

from objectmorpher_core.base.arrays import F32, U16
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.rules import LAYERS, RULES
from objectmorpher_core.raster.texture import MOST_LEVELS, TextureLevels

from .gpu_memory import Instances, Uploads
from .shaders import build_program, set_uniforms

MOST_PIXELS = 2**20  # of a band
LEAST_GAP = 1e-12  # world units and px; of one Gaussian alone it is 0

# Texture units of the passes over Gaussians, and of those over pixels.
FRONTS, COVER, LEFT = range(3), 3, 8
SUMS, LOOK_BEFORE, COVER_BEFORE, PHOTO = range(5), 5, 6, 7
DETAIL, MEDIAN = 0, 1
SAMPLERS: dict[str, Any] = {
    **{f"front{k}": k for k in FRONTS}, "cover": COVER, "left": LEFT,
    "sum_cover": 0, "sum_place": 1, "sum_photo": 2, "sum_color": 3, "sum_left": 4,
    "look_before": LOOK_BEFORE, "cover_before": COVER_BEFORE, "photo": PHOTO,
    "sum_detail": DETAIL, "sum_median": MEDIAN,
}  # fmt: skip

Uniforms = dict[str, Any]


class LayeredPass:
    """Draws the projected Gaussians of one object into a picture, band by band."""

    def __init__(self, context: moderngl.Context, uploads: Uploads, limit: int) -> None:
        """`limit`: px, the longest side of a texture."""
        self._context, self._uploads = context, uploads
        self._programs: dict[tuple[str, ...], moderngl.Program] = {}
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._queries = [context.query(any_samples=True) for _ in range(LAYERS - 1)]
        self._targets: LayerTargets | None = None
        self._limit = limit

    def draw(
        self, instances: Instances, splats: PosedSplats, texture: TextureLevels,
        cameras: tuple[Camera, Camera], picture: moderngl.Framebuffer,
    ) -> None:  # fmt: skip
        """Draw into `picture`, colour and detail; `cameras` are the view's and the photo's.

        Its first row is the topmost.
        """
        camera = cameras[0]
        rows = max(min(camera.height, MOST_PIXELS // camera.width), 1)
        targets = self._sized((camera.width, rows))
        photo = self._uploads(
            "photo", texture, lambda: PhotoLevels(self._context, texture, self._limit)
        )
        photo.reach(_magnified(splats, *cameras))
        for top in range(0, camera.height, rows):
            values = {
                **_uniforms(splats), **photo.uniforms, **_looks(texture, *cameras, top),
                "resolution": targets.size, "top": float(top),
            }  # fmt: skip
            photo.use(PHOTO)
            for layer in range(LAYERS):
                targets.left_buffers[layer % 2].clear()  # also where the layer is skipped
                with self._if_any(layer):
                    self._draw_layer(targets, instances, layer, values)
            picture.viewport = (0, top, camera.width, min(rows, camera.height - top))
            self._finish(targets, picture, top)

    def _if_any(self, layer: int) -> AbstractContextManager[Any]:
        """Lets the GPU skip what is drawn inside, if it knows that nothing is left."""
        skip: Any = self._queries[layer - 1].crender if layer > 0 else nullcontext()
        return skip

    def _draw_layer(
        self, targets: LayerTargets, instances: Instances, layer: int, values: Uniforms
    ) -> None:
        is_last = layer == LAYERS - 1
        kind = ["IS_SURFACE"] if values["is_surface"] else []
        kind += ["IS_LAST"] if is_last else []
        values, own, before = {**values, "front": layer}, layer % 2, (layer + 1) % 2
        self._empty(targets, layer, values)
        for front, unit in zip(targets.fronts, FRONTS, strict=True):
            front.use(unit)
        targets.covers[before].use(COVER)
        targets.lefts[before].use(LEFT)
        if not is_last:
            targets.front_buffers[layer].use()
            self._context.enable_only(moderngl.DEPTH_TEST)
            self._context.depth_func = "<"
            defines = (f"LAYER {layer}", "IS_FRONT")
            instances.draw(self._program("splat.vert", "splat_front.frag", defines, values), 4)
        targets.sum_buffer.use()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        defines = (f"LAYER {layer}", *kind)
        instances.draw(self._program("splat.vert", "splat_sum.frag", defines, values), 4)

        targets.layer_buffers[own].use()
        for texture, unit in zip(targets.sums, SUMS, strict=True):
            texture.use(unit)
        targets.looks[before].use(LOOK_BEFORE)
        targets.covers[before].use(COVER_BEFORE)
        self._fill_open(targets, layer, "splat_resolve.frag", tuple(kind), values)
        if not is_last:
            self._find_left(targets, layer)

    def _empty(self, targets: LayerTargets, layer: int, values: Uniforms) -> None:
        """All that the layer is drawn into; of later ones only the open cells."""
        own = layer % 2
        if layer == 0:
            targets.sum_buffer.clear()
            targets.layer_buffers[own].clear()
            targets.front_buffers[0].clear(FAR, depth=1.0)
            return
        targets.lefts[(layer + 1) % 2].use(LEFT)
        targets.reset_buffers[own].use()
        self._context.enable_only(moderngl.NOTHING)
        self._fill_open(targets, layer, "splat_reset.frag", (), values)
        if layer < LAYERS - 1:
            targets.front_buffers[layer].use()
            self._context.enable_only(moderngl.DEPTH_TEST)
            self._context.depth_func = "1"
            self._fill_open(targets, layer, "splat_reset.frag", ("IS_FRONT",), values)

    def _find_left(self, targets: LayerTargets, layer: int) -> None:
        """Where anything is left for the next layer, cell by cell, and whether anywhere."""
        own = layer % 2
        targets.left_buffers[own].use()
        self._context.enable_only(moderngl.NOTHING)
        targets.covers[own].use(COVER)
        with self._queries[layer]:
            self._fill("splat_left.frag", (f"LAYER {layer}",), {})

    def _finish(self, targets: LayerTargets, picture: moderngl.Framebuffer, top: int) -> None:
        picture.use()
        self._context.enable_only(moderngl.NOTHING)
        targets.color.use(SAMPLERS["sum_color"])
        targets.detail.use(DETAIL)
        targets.median.use(MEDIAN)
        self._fill("splat_finish.frag", (), {"corner": (0, top)})

    def _fill(self, fragment: str, defines: tuple[str, ...], values: Uniforms) -> None:
        """All pixels of the target by one program."""
        program = self._program("fullscreen.vert", fragment, defines, values)
        self._array(program).render(moderngl.TRIANGLES, 3)

    def _fill_open(
        self, targets: LayerTargets, layer: int, fragment: str, defines: tuple[str, ...],
        values: Uniforms,
    ) -> None:  # fmt: skip
        """The pixels where anything is left for this layer."""
        if layer == 0:
            self._fill(fragment, ("LAYER 0", *defines), values)
            return
        program = self._program("splat_cells.vert", fragment, (f"LAYER {layer}", *defines), values)
        across, down = targets.cells
        self._array(program).render(moderngl.TRIANGLE_STRIP, 4, instances=across * down)

    def _array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Of a program that reads no vertices."""
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self._context.vertex_array(program, [])
        return self._arrays[program.glo]

    def _program(
        self, vertex: str, fragment: str, defines: tuple[str, ...], values: Uniforms
    ) -> moderngl.Program:
        """A program with its uniforms; compiled when it is first needed."""
        key = (vertex, fragment, *defines)
        if key not in self._programs:
            self._programs[key] = build_program(self._context, vertex, fragment, *defines)
            set_uniforms(self._programs[key], **SAMPLERS, **RULES._asdict())
        set_uniforms(self._programs[key], **values)
        return self._programs[key]

    def _sized(self, size: tuple[int, int]) -> LayerTargets:
        """Targets of this size; made anew when the canvas has changed."""
        if self._targets is None or self._targets.size != size:
            if self._targets is not None:
                self._targets.release()
                self._targets = None
            self._targets = LayerTargets(self._context, size)
        return self._targets


def _uniforms(splats: PosedSplats) -> Uniforms:
    """The kind of asset, and what is said in units of the object."""
    size = splats.scale * splats.rest.lifted.scale
    return {
        **splats.rest.splatting._asdict(),
        "gaps": tuple(max(gap, LEAST_GAP) ** -2 for gap in (splats.gap, splats.texture_gap)),
        "depth_range": (float(splats.world_from_object[2, 3]), size),
    }


def _magnified(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> float:
    """Pixels of the photo that one of the view shows, of the object as a whole."""
    there, here = splats.rest.world_from_object[2, 3], splats.world_from_object[2, 3]
    return photo_camera.focal / camera.focal * float(here / there) / splats.scale


def _looks(texture: TextureLevels, camera: Camera, photo_camera: Camera, top: int) -> Uniforms:
    """From the pixels of a band to those of the photo's crop."""
    ratio = photo_camera.focal / camera.focal
    left, upper = texture.left, texture.top
    x = photo_camera.cx - left - camera.cx * ratio
    y = photo_camera.cy - upper + (top - camera.cy) * ratio
    box = (-left, -upper, photo_camera.width - left, photo_camera.height - upper)
    return {"unmoved": (ratio, x, y), "photo_box": box}


# The off-screen pictures in which the layers of an object are put together.

FAR = 1e30  # depth of a pixel without a front
CELL = 16  # px, of which one texel says whether anything is left for the next layer


class LayerTargets:
    """Targets as large as a band of the picture: a canvas of any size needs no more memory.

    244 bytes a pixel.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int]) -> None:
        self.size = size
        self.cells = (-(-size[0] // CELL), -(-size[1] // CELL))
        self._context = context
        self._textures: list[moderngl.Texture] = []
        texture, build = self._texture, context.framebuffer
        self._depth = context.depth_renderbuffer(size)
        self.fronts = [texture(4) for _ in range(LAYERS - 1)]
        self.sums = [texture(4) for _ in range(5)]
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


# The photo's crop with its halved copies on the GPU, as `raster.texture` has made them.

log = logging.getLogger(__name__)

BITS_16 = 65535.0
BORDER = 2  # px around the photo's own size, which is looked up by cubics
ROWS = 16  # of a level, converted at a time


class PhotoLevels:
    """16 bits a channel, level by level; looked up by shaders/splat_photo.glsl.

    Levels that are finer than what is shown are not uploaded before they are: where 10,000 px fit
    into 1,000 that is a sixteenth. OpenGL rounds odd sizes down when it halves them and
    `build_levels` rounds them up, so the texture is larger than its contents.
    """

    def __init__(self, context: moderngl.Context, texture: TextureLevels, limit: int) -> None:
        """`limit`: px, the longest side that the GPU takes."""
        levels = texture.levels
        fitting = [
            k for k, level in enumerate(levels) if max(_padded(level, len(levels) - k)) <= limit
        ]
        if not fitting:
            raise moderngl.Error(f"a texture of {limit} px is too small for the photo")
        self._context, self._levels, self._least = context, levels, fitting[0]
        self._finest = len(levels)
        self._texture: moderngl.Texture | None = None
        if self._least > 0:
            log.warning(
                "The object is shown at 1/%d of the photo's detail: OpenGL takes %d px at most",
                2**self._least, limit,
            )  # fmt: skip

    def reach(self, magnified: float) -> None:
        """Has what a view needs that shows so many px of the photo as one.

        Some of it may be nearer than the whole: it is sharp to twice the size.
        """
        wanted = int(np.clip(math.floor(math.log2(max(magnified, 1.0))) - 1, self._least,
                             max(len(self._levels) - 1, self._least)))  # fmt: skip
        if wanted < self._finest:
            self.release()
            self._finest = wanted
            self._texture = self._uploaded()

    def _uploaded(self) -> moderngl.Texture:
        levels = self._levels[self._finest :]
        height, width = _padded(levels[0], len(levels))
        texture = self._context.texture((width, height), 4, dtype="nu2")
        texture.build_mipmaps(0, len(levels) - 1)  # makes room for them
        for k, level in enumerate(levels):
            pixels = _as_u16(level, BORDER if k == self._finest == 0 else 0)
            box = (0, 0, pixels.shape[1], pixels.shape[0])
            texture.write(pixels, box, level=k)
        texture.filter = moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST
        texture.repeat_x = texture.repeat_y = False
        return texture

    def use(self, unit: int) -> None:
        """Binds what `reach` has uploaded."""
        assert self._texture is not None, "nothing is uploaded before it is known what is shown"
        self._texture.use(unit)

    @property
    def uniforms(self) -> dict[str, object]:
        """Return the shader's uniforms."""
        sizes = [(level.shape[1], level.shape[0]) for level in self._levels[self._finest :]]
        all_sizes = sizes + sizes[-1:] * (MOST_LEVELS - len(sizes))
        return {"sizes": all_sizes, "levels": len(sizes), "finest": float(self._finest)}

    def release(self) -> None:
        if self._texture is not None:
            self._texture.release()
            self._texture = None


def _padded(level: F32, count: int) -> tuple[int, int]:
    """Height and width of a texture that holds `level` with its border, and halved copies.

    `count` levels in all.
    """
    unit = 2 ** (count - 1)
    height, width = (-(-(n + 2 * BORDER) // unit) * unit for n in level.shape[:2])
    return height, width


def _as_u16(level: F32, border: int) -> U16:
    """With so many px around it that repeat the colours and are clear."""
    height, width = level.shape[:2]
    whole = np.empty((height + 2 * border, width + 2 * border, 4), np.uint16)
    inside = whole[border : border + height, border : border + width]
    for top in range(0, height, ROWS):  # few at a time, which stay in the processor's cache
        rows = level[top : top + ROWS] * np.float32(BITS_16)
        rows += np.float32(0.5)
        np.clip(rows, 0, BITS_16, out=rows)
        inside[top : top + ROWS] = rows
    if border:
        whole[border:-border, :border] = inside[:, :1]
        whole[border:-border, -border:] = inside[:, -1:]
        whole[:border], whole[-border:] = whole[border], whole[-border - 1]
        whole[:border, :, 3] = whole[-border:, :, 3] = 0
        whole[:, :border, 3] = whole[:, -border:, 3] = 0
    return whole
