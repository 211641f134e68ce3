"""Arrays and pictures on the GPU, and buffers that are refilled."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

import cv2
import moderngl
import numpy as np

from objectmorpher_core.base.brush import Box

from ..canvas.blend import CELL
from .scene import Scene
from .shaders import buffer_layout


class Releasable(Protocol):
    """An object that holds GPU memory until it is released."""

    def release(self) -> Any: ...


T = TypeVar("T", bound=Releasable)

MOST_KEPT = 1024  # copies: a frame of a hundred objects; what nobody sweeps away ends there


class Uploads:
    """Copies of things that do not change, until they are not asked for any more."""

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most = most
        self._kept: dict[tuple[str, int], tuple[Any, Releasable]] = {}
        self._used: set[tuple[str, int]] = set()

    def __call__(self, kind: str, thing: Any, build: Callable[[], T]) -> T:
        """The copy of `thing`, made by `build` the first time."""
        key = (kind, id(thing))
        entry = self._kept.pop(key, None) or (thing, build())  # held: no other can get its id
        self._kept[key] = entry
        self._used.add(key)
        while len(self._kept) > self._most:
            self._kept.pop(next(iter(self._kept)))[1].release()
        copy: Any = entry[1]
        return copy

    def sweep(self) -> None:
        """Releases what nobody has asked for since the last time."""
        for key in [key for key in self._kept if key not in self._used]:
            self._kept.pop(key)[1].release()
        self._used.clear()

    def __len__(self) -> int:
        return len(self._kept)


class Stream:
    """A buffer that is filled anew for each frame, and grows when it has to."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.buffer = context.buffer(reserve=4, dynamic=True)

    def reserve(self, size: int) -> bool:
        """Room for so many bytes; whether that made a new buffer. What was there is lost."""
        if self.buffer.size >= size:
            self.buffer.orphan()
            return False
        self.buffer.release()
        self.buffer = self._context.buffer(reserve=size, dynamic=True)
        return True


# Projected Gaussians in a buffer on the GPU, each drawn as a rectangle or a triangle.

Columns = tuple[tuple[str, str], ...]  # name and format of each column of a buffer


class Instances:
    """Rows of `columns`, for the programs that draw them."""

    def __init__(self, context: moderngl.Context, columns: Columns) -> None:
        self.columns = columns
        self.count = 0
        self._context = context
        self._stream = Stream(context)
        self._arrays: dict[int, moderngl.VertexArray] = {}

    @property
    def row_size(self) -> int:
        """Bytes."""
        return 4 * sum(int(form[0]) for _, form in self.columns)

    def reserve(self, count: int) -> moderngl.Buffer:
        """Room for so many rows."""
        self.count = count
        if self._stream.reserve(max(count, 1) * self.row_size):
            for array in self._arrays.values():
                array.release()
            self._arrays.clear()
        return self._stream.buffer

    def read(self) -> bytes:
        """Read all rows, which waits for the GPU."""
        return self._stream.buffer.read(self.count * self.row_size)

    def draw(self, program: moderngl.Program, corners: int) -> None:
        """Draw each row as a shape of 3 or 4 corners."""
        if self.count == 0:
            return
        if program.glo not in self._arrays:
            layout = buffer_layout(program, self._stream.buffer, self.columns, "/i")
            self._arrays[program.glo] = self._context.vertex_array(program, [layout])
        self._arrays[program.glo].render(moderngl.TRIANGLE_STRIP, corners, instances=self.count)


# Pictures on the GPU, uploaded when the array is not the last one.

SHARP_FROM = 4.0  # magnification from which single pixels are shown


class PictureTexture:
    """A picture of 1, 3 or 4 channels, 8 bits each on the GPU.

    Of a picture that is shown much smaller than it is, a halved copy is uploaded.
    """

    def __init__(self, context: moderngl.Context, has_mipmaps: bool = True) -> None:
        """Mipmaps are for what is shown smaller than it is."""
        self._has_mipmaps = has_mipmaps
        self._context = context
        self._limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._uploaded: np.ndarray | None = None
        self._touched = 0  # of what is painted in place: boxes that are uploaded
        self._is_changing = False
        self._level = 0  # how often the current texture is halved
        self._textures = {0: context.texture((1, 1), 1, b"\0")}  # by that
        self._with_mipmaps: set[int] = set()  # of these

    @property
    def texture(self) -> moderngl.Texture:
        return self._textures[self._level]

    def upload(
        self, pixels: np.ndarray | None, touched: Sequence[Box] = (), zoom: float = 1.0
    ) -> None:
        """`pixels` (h, w) or (h, w, channels): bool, u8, u16 or f32; None is one black px.

        `touched`: of pixels (u8) that are painted in place, the boxes that changed, since they
        were first shown and in this order. Only the new ones are uploaded. `zoom`: view px per px.
        """
        fresh, self._touched = touched[self._touched :], len(touched)
        if pixels is not self._uploaded:
            self.release()
            self._uploaded, self._is_changing = pixels, bool(touched)
        elif fresh:
            self._is_changing = True
            if list(self._textures) == [0] and pixels is not None:
                self._refresh(pixels, fresh)
            else:
                self.release()
        self._level = self._level_at(zoom)
        if self._level not in self._textures:
            shown = np.zeros((1, 1), np.uint8) if pixels is None else _as_u8(pixels)
            halved = _halved(shown, self._level)
            self._textures[self._level] = made_texture(self._context, halved, moderngl.LINEAR)

    def _level_at(self, zoom: float) -> int:
        """The most halved copy that still has as many px as are shown."""
        if self._uploaded is None:
            return 0
        longer = max(self._uploaded.shape[:2])
        least = max(math.ceil(math.log2(longer / self._limit)), 0)  # for the GPU to take it
        if self._is_changing or not self._has_mipmaps or zoom >= 1:
            return least
        return max(least, min(int(math.log2(1 / zoom)), int(math.log2(longer))))

    def _refresh(self, pixels: np.ndarray, boxes: Sequence[Box]) -> None:
        """The part around `boxes` once more. Mipmaps wait until the picture is another one."""
        x0, y0 = min(b[0] for b in boxes), min(b[1] for b in boxes)
        x1, y1 = max(b[2] for b in boxes), max(b[3] for b in boxes)
        part = np.ascontiguousarray(pixels[y0:y1, x0:x1])
        self._textures[0].write(part, viewport=(x0, y0, x1 - x0, y1 - y0), alignment=1)

    def release(self) -> None:
        """Give the memory back."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self._with_mipmaps.clear()

    @property
    def glo(self) -> int:
        """OpenGL's number of the texture."""
        return self.texture.glo

    def use(self, unit: int, zoom: float) -> None:
        """Binds it: single pixels at high magnification, smooth below."""
        above = moderngl.NEAREST if zoom >= SHARP_FROM else moderngl.LINEAR
        below = above
        # Where nothing is shrunk no mipmap is read; emulated, looking for one doubles the time.
        if zoom < 1 and self._has_mipmaps and not self._is_changing:
            below = moderngl.LINEAR_MIPMAP_LINEAR
            if self._level not in self._with_mipmaps:
                self._with_mipmaps.add(self._level)
                self.texture.build_mipmaps()
        self.texture.filter = (below, above)
        self.texture.use(unit)


def made_texture(context: moderngl.Context, pixels: np.ndarray, near: int) -> moderngl.Texture:
    """(h, w) or (h, w, channels), u8 or what f32 holds; `near`: how it is looked up between px."""
    height, width = pixels.shape[:2]
    is_u8 = pixels.dtype == np.uint8
    data = np.ascontiguousarray(pixels, None if is_u8 else np.float32)
    channels, kind = data.size // (height * width), "f1" if is_u8 else "f4"
    texture = context.texture((width, height), channels, data, alignment=1, dtype=kind)
    texture.repeat_x = texture.repeat_y = False
    texture.filter = near, near
    return texture


def _halved(pixels: np.ndarray, times: int) -> np.ndarray:
    for _ in range(times):
        size = (max(pixels.shape[1] // 2, 1), max(pixels.shape[0] // 2, 1))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    return pixels


def _as_u8(pixels: np.ndarray) -> np.ndarray:
    if pixels.dtype == np.uint16:
        return (pixels >> 8).astype(np.uint8)
    if pixels.dtype == np.bool_:
        return pixels.view(np.uint8) * np.uint8(255)
    if pixels.dtype == np.float32:
        return (pixels * 255 + 0.5).astype(np.uint8)
    return pixels


# Where the edit is shown and where the photo, for the passes that ask.

BLEND, ORIGINAL = 7, 8  # texture units, bound for all passes: the blend, the photo
ALL = np.ones((1, 1), np.float32)  # the edit everywhere


def blend_cells(scene: Scene) -> tuple[float, float]:
    """Canvas px that the blend covers."""
    if scene.blend is None:
        return 1.0, 1.0
    height, width = scene.blend.shape
    return float(width * CELL), float(height * CELL)
