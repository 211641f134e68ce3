"""The passes in their order."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import glcontext
import moderngl
import numpy as np

from objectmorpher_core.base.arrays import U8
from objectmorpher_core.document.bounds import NORMAL

from ..canvas.layer import CanvasLayer
from ..canvas.memo import same
from ..editor.view import ViewState
from .gpu_memory import ALL, BLEND, PictureTexture
from .layer_pass import DefocusPass, LayerPass, photo_box
from .photo_pass import PhotoPass
from .scene import Colour, Scene, SplatObject
from .shaders import Programs

if TYPE_CHECKING:
    from .splat_pass import SplatPass, SplatPicture


Viewport = tuple[int, int, int, int]  # left, bottom, width, height of the canvas, framebuffer px

# The pictures under the objects of a still view: the photo, and the edit's background.

Part: TypeAlias = tuple[int, int, int, int]  # x0, y0, x1, y1 canvas px
Draw = Callable[[Scene, Part | None], U8]  # (h, w, 4) of the canvas or a part of it, upright
REACH = 8.0  # px of the photo, or of its halved copy: farther away nobody looks at a pixel of it
FEW = 16  # rows that are compared at once: in the processor's cache


class StillView:
    """Two pictures of a view, for `flattening`."""

    def __init__(self) -> None:
        self._place: Place = ()
        self._pictures: dict[str, tuple[Scene, U8]] = {}  # with what they were drawn from

    def flat(self, scene: Scene, view: ViewState, place: Place, draw: Draw) -> U8 | None:
        """The canvas, upright; None where the shaders have to draw it.

        That is when the view moves, and where the scene is more than an edited photo. `draw`
        makes a picture by the shaders.
        """
        is_still, self._place = place == self._place, place
        if not is_still:
            self._pictures.clear()
        if not is_still or scene.blend is None or not _is_plain(scene):
            return None
        from .flattening import flatten

        under = Scene(scene.photo, scene.surround)
        photo = self._picture("photo", under, view, draw)
        back = photo
        if scene.plate is not None or scene.mask is not None:
            behind = replace(under, plate=scene.plate, mask=scene.mask, hatch=scene.hatch)
            back = self._picture("back", behind, view, draw)
        return flatten(
            photo, back, scene.blend, scene.shades + scene.layers, photo_box(scene, view)
        )  # fmt: skip

    def _picture(self, name: str, scene: Scene, view: ViewState, draw: Draw) -> U8:
        """By the shaders, where it is another one than in the frame before: they take their time.

        Of the background a drag changes little, but in one frame of four.
        """
        kept = self._pictures.get(name)
        if kept is not None and same_scene(kept[0], scene):
            return kept[1]
        part = None if kept is None else changed_part(kept[0], scene, view)
        if kept is None or part is None:
            picture = draw(scene, None)
        else:
            picture, (x0, y0, x1, y1) = kept[1], part
            if x0 < x1 and y0 < y1:
                picture[y0:y1, x0:x1] = draw(scene, part)
        self._pictures[name] = (scene, picture)
        return picture


def changed_part(before: Scene, after: Scene, view: ViewState) -> Part | None:
    """Where two scenes look different that differ in their plate only; None of any others."""
    old, new = before.plate, after.plate
    if old is None or new is None or not same_scene(before, replace(after, plate=old)):
        return None
    if old.box != new.box or old.pixels.dtype != new.pixels.dtype:
        return None
    starts = range(0, len(old.pixels), FEW)
    pairs = ((old.pixels[y : y + FEW], new.pixels[y : y + FEW]) for y in starts)
    rows = [y for y, (a, b) in zip(starts, pairs, strict=True) if not np.array_equal(a, b)]
    if not rows:
        return 0, 0, 0, 0
    top, bottom = rows[0], rows[-1] + FEW
    columns = (old.pixels[top:bottom] != new.pixels[top:bottom]).any((0, 2)).nonzero()[0]
    reach, corner = REACH * max(1 / view.zoom, 1.0), np.array([new.left, new.top])
    low = corner + (columns[0], top) - reach
    high = corner + (columns[-1] + 1, bottom) + reach
    x0, y0, x1, y1 = view.canvas_box(low, high)
    size = view.width, view.height
    x0, x1 = (int(np.clip(v, 0, size[0])) for v in (np.floor(x0), np.ceil(x1)))
    y0, y1 = (int(np.clip(v, 0, size[1])) for v in (np.floor(y0), np.ceil(y1)))
    return x0, y0, x1, y1


def _is_plain(scene: Scene) -> bool:
    """Whether there is nothing but the photo, a background, shadows and objects."""
    if scene.objects or scene.paper is not None or scene.split > 0 or scene.veil > 0:
        return False
    layers = scene.shades + scene.layers
    return not any(
        layer.is_tint or layer.invented is not None or layer.mode != NORMAL for layer in layers
    )


# A picture copied into the window as memory, where OpenGL is emulated. The rows of an emulated
# window run from the top down, its colours are blue, green, red. From a texture that has both alike
# the driver copies rows; from any other it draws every pixel, which took a sixth of a frame.
# moderngl names neither the order of colours nor the ends of a copy.

TEXTURE_2D, RGBA, BGRA, UNSIGNED_BYTE = 0x0DE1, 0x1908, 0x80E1, 0x1401
READ_FRAMEBUFFER, COLOR_BUFFER_BIT, NEAREST = 0x8CA8, 0x4000, 0x2600
INT, NUMBER = ctypes.c_int, ctypes.c_uint


@dataclass(frozen=True)
class RowCopy:
    """Three functions of the current OpenGL context."""

    _tex_image: Callable[..., None]
    _bind: Callable[..., None]
    _blit: Callable[..., None]

    @classmethod
    def found(cls) -> RowCopy | None:
        """Of the window's context; None where it is of another kind."""
        try:
            context: Any = glcontext.default_backend()(mode="detect", glversion=330)
        except Exception:  # whatever a driver says: the usual copy is as good
            return None

        def function(name: str, *types: Any) -> Callable[..., None]:
            return ctypes.CFUNCTYPE(None, *types)(context.load(name))

        image = NUMBER, *[INT] * 5, NUMBER, NUMBER, ctypes.c_void_p
        return cls(
            function("glTexImage2D", *image),
            function("glBindFramebuffer", NUMBER, NUMBER),
            function("glBlitFramebuffer", *[INT] * 8, NUMBER, NUMBER),
        )

    def make_alike(self, texture: moderngl.Texture) -> None:
        """Give an empty texture of four bytes the window's order of colours."""
        texture.use(0)
        self._tex_image(TEXTURE_2D, 0, RGBA, *texture.size, 0, BGRA, UNSIGNED_BYTE, None)

    def copy_upright(
        self, source: moderngl.Framebuffer, target: moderngl.Framebuffer, size: tuple[int, int]
    ) -> None:
        """Copy a picture of that size whose rows run from the top down."""
        target.use()
        self._bind(READ_FRAMEBUFFER, source.glo)
        width, height = size
        self._blit(0, 0, *size, 0, height, width, 0, COLOR_BUFFER_BIT, NEAREST)
        target.use()


# The window's last picture below the interface: copied as long as nothing of it changes.

Place: TypeAlias = tuple[Any, ...]  # where the canvas is, what part of the picture, on what colour


class KeptCanvas:
    """A framebuffer as large as the window."""

    def __init__(self, context: moderngl.Context, rows: RowCopy | None = None) -> None:
        """`rows`: see there; None where OpenGL is not emulated."""
        self._context, self._rows = context, rows
        self._size = (0, 0)
        self._color: moderngl.Texture | None = None
        self.buffer: moderngl.Framebuffer | None = None
        self._scene: Scene | None = None  # what it shows, and how
        self._place: Place = ()
        self._is_upright = False  # its rows are from the top down

    def shows(self, scene: Scene, place: Place) -> bool:
        """Whether it shows this already."""
        before, self._scene = self._scene, scene
        is_there, self._place = place == self._place, place
        return is_there and before is not None and same_scene(scene, before)

    def begin(self, size: tuple[int, int], surround: Colour) -> moderngl.Framebuffer:
        """Empties it, to be drawn anew; the whole window in one colour."""
        if self.buffer is None or size != self._size:
            self.forget()
            self._size, self._color = size, self._context.texture(size, 4)
            if self._rows is not None:
                self._rows.make_alike(self._color)
            self.buffer = self._context.framebuffer([self._color])
        self.buffer.clear(*surround, 1.0)
        self._is_upright = False
        return self.buffer

    def write(self, pixels: U8, viewport: Viewport, surround: Colour, is_sampled: bool) -> None:
        """A picture of the canvas (h, w, 4), upright, in place of what it shows there.

        `is_sampled`: shaders will read it, which know it from the bottom up.
        """
        assert self._color is not None and self.buffer is not None
        is_upright = self._rows is not None and not is_sampled
        if is_upright is not self._is_upright:
            self.buffer.clear(*surround, 1.0)
            self._is_upright = is_upright
        left, row, width, height = viewport
        if is_upright:
            row = self._size[1] - row - height
        else:
            pixels = np.ascontiguousarray(pixels[::-1])
        self._color.write(pixels, viewport=(left, row, width, height))

    def copy_to(self, target: moderngl.Framebuffer) -> None:
        """Show all of it in the window."""
        assert self.buffer is not None
        if self._is_upright and self._rows is not None:
            self._rows.copy_upright(self.buffer, target, self._size)
        else:
            self._context.copy_framebuffer(target, self.buffer)

    def read_pixel(self, left: int, bottom: int) -> tuple[int, int, int]:
        """Read a pixel, u8; black before there is any."""
        if self.buffer is None:
            return 0, 0, 0
        row = self._size[1] - 1 - bottom if self._is_upright else bottom
        data = self.buffer.read(viewport=(left, row, 1, 1), components=3, alignment=1)
        return data[0], data[1], data[2]

    def forget(self) -> None:
        if self.buffer is not None and self._color is not None:
            self.buffer.release()
            self._color.release()
        self.buffer = self._color = self._scene = None


def same_scene(a: Any, b: Any) -> bool:
    """Whether two scenes, or parts of them, are the same; they are made anew for each frame."""
    if type(a) is type(b) and is_dataclass(a) and type(a).__module__ == Scene.__module__:
        return all(same_scene(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same_scene, a, b))
    return same(a, b)


class ScreenPass:
    """Draws the canvas in the colours that the screen needs."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        units = {"canvas": 0, "table": 1}
        self._programs = Programs(context, "fullscreen.vert", "screen.frag", units)
        self._kept: tuple[U8, moderngl.Texture3D] | None = None

    def draw(self, canvas: moderngl.Framebuffer, table: U8, part: Viewport) -> None:
        """The `part` of the target that shows the photo; the rest stays as it is."""
        if self._kept is None or self._kept[0] is not table:
            if self._kept is not None:
                self._kept[1].release()
            texture = self._context.texture3d(
                table.shape[:3][::-1], 3, table.tobytes(), alignment=1
            )
            texture.filter = moderngl.LINEAR, moderngl.LINEAR
            texture.repeat_x = texture.repeat_y = texture.repeat_z = False
            self._kept = table, texture
        source = canvas.color_attachments[0]
        assert isinstance(source, moderngl.Texture)
        source.use(0)
        self._kept[1].use(1)
        self._context.viewport = part
        self._programs()[1].render(moderngl.TRIANGLES, 3)


def _part(viewport: Viewport, box: tuple[float, float, float, float]) -> Viewport:
    """Of a viewport what `box` covers, px of the canvas from its left top."""
    left, bottom, width, height = viewport
    x0, x1 = (min(max(round(v), 0), width) for v in box[::2])
    y0, y1 = (min(max(round(v), 0), height) for v in box[1::2])
    return left + x0, bottom + height - y1, x1 - x0, y1 - y0


log = logging.getLogger(__name__)

SOFTWARE = ("llvmpipe", "softpipe", "swr", "software")


class Renderer:
    """Draws scenes into the canvas's part of the window whose GL context is current."""

    def __init__(self, wanted: str) -> None:
        """`wanted`: "gl", "tiles" or "auto" (tiles where OpenGL is emulated)."""
        context = moderngl.create_context(require=330)
        self.gl_name = str(context.info["GL_RENDERER"])
        self._is_emulated = any(word in self.gl_name.lower() for word in SOFTWARE)
        self.kind = ("tiles" if self._is_emulated else "gl") if wanted == "auto" else wanted
        self._context = context
        self._blend = PictureTexture(context, has_mipmaps=False)
        self._photo_pass = PhotoPass(context)
        self._layer_pass = LayerPass(context)
        self._defocus_pass = DefocusPass(context)
        self._splat_pass: SplatPass | None = None
        self._screen_pass = ScreenPass(context)
        self.table: U8 | None = None  # the photo's colours on this screen, see `screen_table`
        rows = RowCopy.found() if self._is_emulated else None
        self._kept, self._still = KeptCanvas(context, rows), StillView()
        self._target = context.screen
        self._surround: Colour = (0.0, 0.0, 0.0)
        self._size = (1, 1)
        log.info("OpenGL by %s; objects drawn by %s", self.gl_name, self.kind)

    def rehearse(self) -> None:
        """Loads what the first drag needs; in a thread, it touches no OpenGL."""
        if self._is_emulated:
            from .flattening import rehearse

            rehearse()

    def begin(self, color: Colour, size: tuple[int, int]) -> None:
        """Begins a frame of `size` px; `color` is the window's where no scene is."""
        self._surround, self._size = color, size
        self._target = self._context.screen

    def clear(self) -> None:
        """The whole window in its colour."""
        self._use((0, 0, self._size[0], self._size[1]))
        self._target.clear(*self._surround, 1.0)

    def draw(self, scene: Scene, view: ViewState, viewport: Viewport) -> None:
        """The whole window: the scene in `viewport`, its colour around it."""
        kept = self._kept
        is_sampled = self.table is not None
        place = (self._surround, self._size, viewport, view.place, view.scale, is_sampled)
        if not kept.shows(scene, place):
            if (flat := self._flat(scene, view, viewport, place)) is not None:
                kept.write(flat, viewport, self._surround, is_sampled)
            else:
                self._target = kept.begin(self._size, self._surround)
                self._draw(scene, view, viewport)
                self._target = self._context.screen
        kept.copy_to(self._target)
        if self.table is not None:
            assert kept.buffer is not None
            self._use(viewport)
            self._screen_pass.draw(kept.buffer, self.table, _part(viewport, photo_box(scene, view)))
        self._use(viewport)

    def _flat(self, scene: Scene, view: ViewState, viewport: Viewport, place: Place) -> U8 | None:
        """The canvas by the processor, where that is faster; None where it is not."""
        if not self._is_emulated:
            return None
        return self._still.flat(
            scene, view, place, lambda under, part: self._read_canvas(under, view, viewport, part)
        )

    def _read_canvas(
        self, scene: Scene, view: ViewState, viewport: Viewport, part: Part | None
    ) -> U8:
        """A scene drawn by the shaders, (h, w, 4) u8, upright; or only a part of the canvas."""
        box = viewport if part is None else _part(viewport, part)
        buffer = self._target = self._kept.begin(self._size, self._surround)
        buffer.scissor = box
        self._draw(scene, view, viewport)
        buffer.scissor = (0, 0, self._size[0], self._size[1])
        self._target = self._context.screen
        data = buffer.read(viewport=box, components=4, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(box[3], box[2], 4)[::-1].copy()

    def _draw(self, scene: Scene, view: ViewState, viewport: Viewport) -> None:
        """Into the target."""
        self._use(viewport)
        self._use_blend(scene)
        self._photo_pass.draw(scene, view)
        self._layer_pass.draw(scene, view)
        for item in scene.objects:
            if isinstance(item, CanvasLayer):
                self._layer_pass.draw_layer(item, scene, view)
                continue
            picture = self._render(item, view)
            if picture is not None:
                if not item.is_marked:
                    picture = self._defocus_pass.draw(picture, item, view.zoom)
                self._use(viewport)
                self._use_blend(scene)
                self._photo_pass.use_photo(view)
                self._layer_pass.draw_picture(picture, item, scene, view)
        if self._splat_pass is not None:
            self._splat_pass.sweep()

    def _render(self, item: SplatObject, view: ViewState) -> SplatPicture | None:
        """The object's picture on the GPU; from the first failure on the processor makes them."""
        if self.kind != "gl":
            return None
        try:
            camera = view.camera(item.camera)
            carried = item.splats.rest.carried(item.camera)
            return self._splats().draw(item.splats, item.texture, camera, carried)
        except moderngl.Error as error:
            self.kind = "tiles"
            reason = str(error).strip().partition("\n")[0]
            log.error("OpenGL cannot draw the object: %s; the processor does from now on", reason)
            return None

    def picture(self, pixels: np.ndarray) -> PictureTexture:
        """A picture for the interface, on the GPU; see `PictureTexture.upload`."""
        picture = PictureTexture(self._context)
        picture.upload(pixels)
        return picture

    def read(self, size: tuple[int, int]) -> np.ndarray:
        """The window's pixels, (h, w, 3) u8, upright."""
        data = self._context.screen.read(viewport=(0, 0, *size), components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(size[1], size[0], 3)[::-1]

    def read_pixel(self, left: int, bottom: int) -> tuple[int, int, int]:
        """Read one of the canvas's pixels, u8, as it is before the screen's colours."""
        return self._kept.read_pixel(left, bottom)

    def _use(self, viewport: Viewport) -> None:
        self._target.use()
        self._context.viewport = viewport
        self._context.enable_only(moderngl.NOTHING)

    def _use_blend(self, scene: Scene) -> None:
        self._blend.upload(ALL if scene.blend is None else scene.blend)
        self._blend.use(BLEND, 1.0)

    def _splats(self) -> SplatPass:
        """Made for the first object: its module needs the compiler."""
        if self._splat_pass is None:
            from .splat_pass import SplatPass

            self._splat_pass = SplatPass(self._context)
        return self._splat_pass
