"""Draws rendered objects, premultiplied, over the photo."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np

from objectmorpher_core.document.bounds import MODES, NORMAL

from ..canvas.layer import CanvasLayer
from ..editor.view import ViewState
from .gpu_memory import BLEND, ORIGINAL, blend_cells, made_texture
from .photo_pass import hatch_uniforms
from .scene import Scene, SplatObject
from .shaders import Programs, set_uniforms

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.grain import Grain
    from objectmorpher_core.compose.light.noise import Noise
    from objectmorpher_core.compose.light.relight import Relit

    from .splat_pass import SplatPicture


# Blurs and sharpens a rendered object on the GPU, as `compose.light.defocus` does.

_BLUR_UNITS = {"picture": 0, "detailed": 1}


class DefocusPass:
    """Passes across and down; its pictures are valid until the next call."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs = Programs(context, "fullscreen.vert", "defocus.frag", _BLUR_UNITS)
        self._targets: tuple[moderngl.Framebuffer, ...] = ()

    def draw(self, picture: SplatPicture, item: SplatObject, zoom: float) -> SplatPicture:
        """The picture as `item` wants it, with so many of its px for one of the photo."""
        from objectmorpher_core.compose.light.defocus import DETAIL

        if item.blur <= 0 and item.sharpness <= 0:
            return picture
        color = picture.color
        first, second, third = self._sized(color.size)
        self._context.enable_only(moderngl.NOTHING)
        if item.blur > 0:
            color = self._blurred(color, (first, second), item.blur * zoom)
        if item.sharpness > 0:
            color.use(_BLUR_UNITS["detailed"])
            color = self._blurred(color, (first, third), DETAIL * zoom, item.sharpness)
        return replace(picture, color=color)

    def _blurred(
        self, source: moderngl.Texture, targets: tuple[moderngl.Framebuffer, ...], blur: float,
        sharpness: float = 0.0,
    ) -> moderngl.Texture:  # fmt: skip
        """Blurred by so many px; or, in the second pass, what is `detailed` made sharper."""
        from objectmorpher_core.compose.light.defocus import reach_of

        for target, way in zip(targets, ((1, 0), (0, 1)), strict=True):
            is_sharper = sharpness > 0 and way[1]
            program, array = self._programs(*(["SHARPEN"] if is_sharper else []))
            target.use()
            source.use(_BLUR_UNITS["picture"])
            set_uniforms(program, way=way, reach=reach_of(blur), blur=blur, sharpness=sharpness)
            array.render(moderngl.TRIANGLES, 3)
            made = target.color_attachments[0]
            assert isinstance(made, moderngl.Texture)
            source = made
        return source

    def _sized(self, size: tuple[int, int]) -> tuple[moderngl.Framebuffer, ...]:
        """What is drawn into; made anew when the canvas has changed."""
        if not self._targets or self._targets[0].size != size:
            for target in self._targets:
                for texture in target.color_attachments:
                    texture.release()
                target.release()
            textures = [self._context.texture(size, 4, dtype="f2") for _ in range(3)]
            for texture in textures:
                texture.filter = moderngl.NEAREST, moderngl.NEAREST
            self._targets = tuple(self._context.framebuffer([texture]) for texture in textures)
        return self._targets


LAYER, MARKS, RELIT, AMOUNTS, NOISE, DEVIATIONS, UNDER = (0, 1, 2, 4, 5, 6, 3)  # texture units
_UNITS = {
    "layer": LAYER, "marks": MARKS, "relit": RELIT, "blend": BLEND,
    "amounts": AMOUNTS, "grain": NOISE, "deviations": DEVIATIONS, "under": UNDER,
    "photo": ORIGINAL,
}  # fmt: skip
TINT = 0.6  # opacity


class LayerPass:
    """Draws one rectangle per object. Textures are replaced when the layer is another one."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs = Programs(context, "quad.vert", "layer.frag", _UNITS)
        self._uploaded: dict[int, tuple[CanvasLayer, dict[int, moderngl.Texture]]] = {}
        self._factors: moderngl.Texture | None = None
        self._under: moderngl.Texture | None = None
        self._grain = GrainTextures(context)

    def draw(self, scene: Scene, view: ViewState) -> None:
        """Draw into the current viewport, which is the canvas."""
        between = tuple(item for item in scene.objects if isinstance(item, CanvasLayer))
        self._forget(scene.shades + scene.layers + between)
        for layer in scene.shades + scene.layers:
            self.draw_layer(layer, scene, view)

    def draw_layer(self, layer: CanvasLayer, scene: Scene, view: ViewState) -> None:
        """Draw one layer over what is there."""
        for unit, texture in self._textures(layer).items():
            texture.use(unit)
        is_over = layer.is_tint or layer.is_weighed
        marks = scene.refined if layer.is_weighed else scene.marks
        defines = _defines(scene, marks is not None and layer.invented is not None, is_over)
        defines += self._mixing(layer, scene)
        program, quad = self._programs(*defines)
        set_uniforms(program, box=layer.box, **_appearance(layer), **hatch_uniforms(marks, view))
        self._render(program, quad, scene, view)

    def draw_picture(
        self, picture: SplatPicture, item: SplatObject, scene: Scene, view: ViewState
    ) -> None:
        """A picture of the whole canvas that is on the GPU already."""
        picture.color.use(LAYER)
        is_marked = item.is_marked and picture.detail is not None and scene.marks is not None
        if picture.detail is not None:
            picture.detail.use(MARKS)
        defines = ["DETAIL", *_defines(scene, is_marked, item.is_tint)]
        defines += self._mixing(item, scene)
        values = _appearance(item) | hatch_uniforms(scene.marks, view)
        if item.relit is not None:
            defines.append("HAS_RELIT")
            values["relit_box"] = self._use_factors(item.relit, view)
        if item.grain is not None:
            defines.append("HAS_GRAIN")
            values |= self._grain.use(item.grain, view, (AMOUNTS, NOISE, DEVIATIONS))
        program, quad = self._programs(*defines)
        set_uniforms(program, box=(0, 0, view.width, view.height), **values)
        self._render(program, quad, scene, view)

    def _mixing(self, thing: CanvasLayer | SplatObject, scene: Scene) -> list[str]:
        """What the shader needs to know of what is there already: most things only cover it."""
        if thing.mode == NORMAL or thing.is_tint or scene.paper is not None:
            return []
        target = self._context.fbo
        if self._under is None or self._under.size != target.size:
            if self._under is not None:
                self._under.release()
            self._under = self._context.texture(target.size, 4)
        self._context.copy_framebuffer(self._under, target)
        self._under.use(UNDER)
        return [f"MODE {MODES.index(thing.mode)}"]

    def _use_factors(self, relit: Relit, view: ViewState) -> tuple[float, float, float, float]:
        """Uploads them, with nothing around them; where on the canvas they lie."""
        factors = np.pad(relit.factor, 1)
        if self._factors is not None:
            self._factors.release()
        self._factors = made_texture(self._context, factors, moderngl.LINEAR)
        self._factors.use(RELIT)
        corner = np.array([relit.left, relit.top]) - relit.pitch
        return view.canvas_box(corner, corner + relit.pitch * np.array(factors.shape[::-1]))

    def _render(
        self, program: moderngl.Program, quad: moderngl.VertexArray, scene: Scene, view: ViewState
    ) -> None:
        set_uniforms(
            program,
            canvas=(view.width, view.height),
            photo_box=photo_box(scene, view),
            cells=blend_cells(scene),
            split=scene.split * view.width,
            corner=(view.left, view.top),
            zoom=view.zoom,
            photo_size=scene.photo.shape[1::-1],
        )
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        quad.render(moderngl.TRIANGLE_STRIP, 4)
        self._context.disable(moderngl.BLEND)

    def _forget(self, layers: tuple[CanvasLayer, ...]) -> None:
        """Releases what is not shown any more."""
        kept = {id(layer.rgba) for layer in layers}
        for key in [key for key in self._uploaded if key not in kept]:
            for texture in self._uploaded.pop(key)[1].values():
                texture.release()

    def _textures(self, layer: CanvasLayer) -> dict[int, moderngl.Texture]:
        """The layer's textures by their unit."""
        key = id(layer.rgba)  # it stays the same where the light changes
        if key not in self._uploaded:
            near = moderngl.LINEAR if layer.is_coarse else moderngl.NEAREST
            textures = {LAYER: made_texture(self._context, layer.pixels, near)}
            if layer.invented is not None:
                textures[MARKS] = made_texture(self._context, layer.invented, near)
            self._uploaded[key] = (layer, textures)
        return self._uploaded[key][1]


def _appearance(thing: CanvasLayer | SplatObject) -> dict[str, Any]:
    opacity, saturation = 1.0, 1.0
    if isinstance(thing, SplatObject):
        opacity, saturation = thing.opacity, thing.saturation
    if thing.is_tint:
        opacity = TINT
    return {"opacity": opacity, "saturation": saturation, "gain": thing.gain}


def _defines(scene: Scene, is_marked: bool, is_over: bool) -> list[str]:
    """What of the shaders is needed: a tint lies over photo and edit alike."""
    defines = ["HAS_MARKS"] if is_marked else []
    return defines + (["HAS_BLEND"] if scene.blend is not None and not is_over else [])


def photo_box(scene: Scene, view: ViewState) -> tuple[float, float, float, float]:
    """The photo on the canvas: what lies beyond it is not exported."""
    height, width = scene.photo.shape[:2]
    return view.canvas_box((0, 0), (width, height))


# Grain on the GPU, for shaders/grain.glsl.


class GrainTextures:
    """The noise of a photo, and how much of it one object is given."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._noise: Noise | None = None
        self._level = -1  # how often the tile is halved
        self._tile: moderngl.TextureArray | None = None
        self._deviations: moderngl.Texture | None = None
        self._amounts: moderngl.Texture | None = None

    def use(self, grain: Grain, view: ViewState, units: tuple[int, int, int]) -> dict[str, Any]:
        """Binds amounts, tile and deviations to texture units; what the shader asks for."""
        from objectmorpher_core.compose.light.grain import tile_level

        level = tile_level(view.zoom)
        if grain.noise is not self._noise or level != self._level:
            self._upload_noise(grain.noise, level)
        if self._amounts is not None:
            self._amounts.release()
        self._amounts = made_texture(self._context, grain.padded, moderngl.LINEAR)
        assert self._tile is not None and self._deviations is not None
        for texture, unit in zip((self._amounts, self._tile, self._deviations), units, strict=True):
            texture.use(unit)
        rows, columns = grain.padded.shape[:2]
        corner = np.array([grain.left, grain.top]) - grain.pitch
        box = view.canvas_box(corner, corner + grain.pitch * np.array([columns, rows]))
        return {"amounts_box": box, "grain_texel": float(2**level)}

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
        self._deviations = made_texture(self._context, noise.deviation[None], moderngl.NEAREST)
        self._noise, self._level = noise, level
