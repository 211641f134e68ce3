"""The moved objects as the canvas shows them, in the time that a frame has.

Where the rasteriser needs longer, a frame shows a *draft*: the object at a fraction of the
canvas's resolution, together with where each of its pixels looks in the photo. That map is smooth,
so the renderer samples the photo through it at full resolution and the draft stays sharp. When
nothing has changed for a moment, the worker is asked for the exact picture, which replaces it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.arrays import F32
from objectmorpher_core.camera import Camera
from objectmorpher_core.document import Document

from .view import View

if TYPE_CHECKING:
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.reference import Picture3D
    from objectmorpher_core.raster.texture import TextureLevels
    from objectmorpher_core.raster.tiles import Drawable

    from .derived import Derived

FRAME = 0.028  # s, what rendering may take of a frame
STILL = 0.12  # s without a change, after which the exact picture is asked for
COARSEST = 6  # canvas px per px of a draft
FIRST_RATE = 2.5e-7  # s per px, before anything has been measured


@dataclass(frozen=True, eq=False)
class Draft:
    """What makes a coarse layer sharp: for each px where it looks in the photo."""

    looks: F32  # (h, w, 4): x, y in photo px relative to where the pixel is; share; unused
    texture: F32  # (H, W, 4) straight colour and alpha, a crop of the photo
    left: float  # photo px, the crop's corner
    top: float


@dataclass(frozen=True, eq=False)
class Layer:
    """A rendered object on the canvas."""

    box: tuple[float, float, float, float]  # x0, y0, x1, y1 canvas px
    rgba: np.ndarray  # (h, w, 4) premultiplied sRGB, f32 in [0, 1] or u8
    draft: Draft | None = None  # None: `rgba` is exact, px for px


@dataclass(frozen=True, eq=False)
class Request:
    """An exact picture to be rendered."""

    splats: PosedSplats
    texture: TextureLevels
    window: Camera
    camera: Camera  # the photo's


@dataclass(eq=False)
class _Work:
    """An object's picture."""

    splats: PosedSplats
    view: tuple[float, ...]
    request: Request  # for the exact one
    box: tuple[int, int, int, int]  # canvas px
    shown: Layer
    since: float  # s, monotonic, when the splats or the view changed last
    is_asked: bool = False


Ask = Callable[[Request, Callable[[np.ndarray], None]], None]


class Layers:
    """Renders objects, remembers the pictures, and keeps within the frame's time."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._works: dict[int, _Work] = {}  # object index -> its last picture
        self._rate = FIRST_RATE  # s per px, measured
        self.frame_time = FRAME  # s; infinite where only the last frame counts
        self.ask: Ask | None = None  # renders elsewhere and calls back

    @property
    def is_waiting(self) -> bool:
        """Whether an exact picture is still to be asked for."""
        return any(w.shown.draft is not None and not w.is_asked for w in self._works.values())

    def draw(self, document: Document, view: View) -> tuple[Layer, ...]:
        """The moved objects' pictures, back to front."""
        order = self.order(document)
        self._works = {k: w for k, w in self._works.items() if k in order}
        layers = [self._layer(document, k, splats, view) for k, splats in order.items()]
        return tuple(layer for layer in layers if layer is not None)

    def order(self, document: Document) -> dict[int, PosedSplats]:
        """The moved objects that are visible, back to front."""
        moved = {
            k: self._derived.posed(document, k)
            for k, o in enumerate(document.objects)
            if o.lifted and o.is_moved and o.is_visible
        }
        return dict(sorted(moved.items(), key=lambda kv: -kv[1].middle_depth))

    def _layer(self, document: Document, k: int, splats: PosedSplats, view: View) -> Layer | None:
        key = (view.left, view.top, view.zoom, view.width, view.height)
        thing, camera = document.objects[k], document.photo.camera
        work = self._works.get(k)
        if work is not None and work.splats is splats and work.view == key:
            self._want_exact(work)
            return work.shown
        drawable = self._derived.drawable(document, k, view)
        box = drawable.box()
        if box is None:
            self._works.pop(k, None)
            return None
        texture = self._derived.shape(document.photo, thing).texture
        request = Request(splats, texture, view.camera(camera, box), camera)
        shown = self._first(request, box, drawable)
        self._works[k] = _Work(splats, key, request, box, shown, time.monotonic())
        return shown

    def _first(
        self, request: Request, box: tuple[int, int, int, int], drawable: Drawable
    ) -> Layer:
        """Exact where the time allows, else a draft."""
        from objectmorpher_core.raster import tiles

        pixels = (box[2] - box[0]) * (box[3] - box[1])
        excess = pixels * self._rate / self.frame_time
        coarse = 1 if excess <= 1 else min(max(math.ceil(math.sqrt(excess)), 2), COARSEST)
        start = time.perf_counter()
        if coarse == 1:
            rgba = tiles.draw_rgba(drawable, request.texture, box)
            self._learn(time.perf_counter() - start, pixels)
            x0, y0, x1, y1 = box
            return Layer((float(x0), float(y0), float(x1), float(y1)), rgba)
        window = _coarser(request.window, coarse)
        picture = tiles.render(request.splats, request.texture, window, request.camera)
        self._learn(time.perf_counter() - start, pixels / coarse**2)
        height, width = picture.alpha.shape
        covered = (box[0], box[1], box[0] + width * coarse, box[1] + height * coarse)
        texture = request.texture
        draft = Draft(_looks(picture), texture.levels[0], texture.left, texture.top)
        return Layer(covered, np.dstack([picture.color, picture.alpha]), draft)

    def _want_exact(self, work: _Work) -> None:
        """Asks for the exact picture of what has not changed for a moment."""
        if self.ask is None or work.shown.draft is None or work.is_asked:
            return
        if time.monotonic() - work.since < STILL:
            return
        work.is_asked = True

        def accept(rgba: np.ndarray) -> None:
            work.shown = Layer(work.box, rgba)

        self.ask(work.request, accept)

    def _learn(self, seconds: float, pixels: float) -> None:
        """A moving average, so that one disturbed frame decides little."""
        rate = seconds / max(pixels, 1.0)
        self._rate = float(np.clip(0.7 * self._rate + 0.3 * rate, 1e-9, 1e-5))


def render(request: Request) -> np.ndarray:
    """The exact picture, (h, w, 4) u8 premultiplied."""
    from objectmorpher_core.raster import tiles

    drawable = tiles.prepare(request.splats, request.window, request.camera)
    return tiles.draw_rgba(drawable, request.texture)


def _coarser(window: Camera, coarse: int) -> Camera:
    """The same window with `coarse` times fewer px across and down."""
    width, height = -(-window.width // coarse), -(-window.height // coarse)
    return window.windowed(0.0, 0.0, width, height, 1.0 / coarse)


def _looks(picture: Picture3D) -> F32:
    """The draft's map, continued a little beyond the object so that it can be interpolated."""
    is_seen = (picture.alpha > 0.02) & (picture.from_photo > 0)
    weight = is_seen.astype(np.float32)
    shift = picture.shift * weight[..., None]
    for _ in range(2):
        around = cv2.blur(weight, (3, 3))
        spread = cv2.blur(shift, (3, 3)) / np.maximum(around, 1e-6)[..., None]
        is_new = (weight == 0) & (around > 0)
        shift[is_new], weight[is_new] = spread[is_new], 1.0
    share = np.clip(picture.from_photo / np.maximum(picture.alpha, 1e-3), 0, 1)
    return np.dstack([shift, share, np.zeros_like(share)]).astype(np.float32)
