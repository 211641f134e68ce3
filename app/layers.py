"""The moved objects as the canvas shows them, in the time that a frame has.

Where the rasteriser needs longer, a frame shows a *draft*: the object at a fraction of the
canvas's resolution, together with where each of its pixels looks in the photo. That map is smooth,
so the renderer samples the photo through it at full resolution and the draft stays sharp. While
nothing changes, the exact picture is made strip by strip, a few in each frame, and replaces it.
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
    from objectmorpher_core.raster.posed import PosedSplats, TextureLevels
    from objectmorpher_core.raster.reference import Picture3D

    from .derived import Derived

FRAME = 0.028  # s, what rendering may take of a frame
STRIP_TIME = 0.016  # s, of one strip of the exact picture
STRIP_ROWS = 16  # px, the rasteriser's tile
COARSEST = 6  # canvas px per px of a draft
FIRST_RATE = 2.5e-7  # s per px, before anything has been measured
MARGIN = 8.0  # px around the Gaussians' centres, besides their own size


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
    rgba: F32  # (h, w, 4) premultiplied sRGB
    draft: Draft | None = None  # None: `rgba` is exact, px for px


@dataclass(eq=False)
class _Work:
    """An object's picture in the making."""

    splats: PosedSplats
    view: tuple[float, ...]
    box: tuple[int, int, int, int]  # canvas px
    shown: Layer
    exact: F32 | None = None  # (h, w, 4) filled down to `rows`
    rows: int = 0

    @property
    def is_done(self) -> bool:
        return self.shown.draft is None


class Layers:
    """Renders objects, remembers the pictures, and keeps within the frame's time."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._works: dict[int, _Work] = {}  # object index -> its last picture
        self._rate = FIRST_RATE  # s per px, measured
        self.frame_time = FRAME  # s; infinite where only the last frame counts
        self.is_finished = True  # whether all that is shown is exact

    def draw(self, document: Document, view: View) -> tuple[Layer, ...]:
        """The moved objects' pictures, back to front."""
        order = self.order(document)
        self._works = {k: w for k, w in self._works.items() if k in order}
        layers = [self._layer(document, k, splats, view) for k, splats in order.items()]
        self.is_finished = all(w.is_done for w in self._works.values())
        return tuple(layer for layer in layers if layer is not None)

    def order(self, document: Document) -> dict[int, PosedSplats]:
        """The moved objects that are visible, back to front."""
        moved = {
            k: self._derived.posed(document, k)
            for k, o in enumerate(document.objects)
            if o.lifted and o.is_moved and o.is_visible
        }
        return dict(sorted(moved.items(), key=lambda kv: -float(np.median(kv[1].means[:, 2]))))

    def _layer(self, document: Document, k: int, splats: PosedSplats, view: View) -> Layer | None:
        key = (view.left, view.top, view.zoom, view.width, view.height)
        thing, camera = document.objects[k], document.photo.camera
        texture = self._derived.shape(document.photo, thing).texture

        def render(box: tuple[int, int, int, int], coarse: int = 1) -> Picture3D:
            return _render(splats, texture, _window(view, camera, box, coarse), camera)

        work = self._works.get(k)
        if work is not None and work.splats is splats and work.view == key:
            if not work.is_done:
                self._refine(work, render)
            return work.shown
        box = _bounds(splats, camera, view)
        if box is None:
            self._works.pop(k, None)
            return None
        shown = self._first(box, render, texture)
        self._works[k] = _Work(splats, key, box, shown)
        return shown

    def _first(
        self, box: tuple[int, int, int, int], render: Callable[..., Picture3D],
        texture: TextureLevels,
    ) -> Layer:  # fmt: skip
        """Exact where the time allows, else a draft."""
        pixels = (box[2] - box[0]) * (box[3] - box[1])
        excess = pixels * self._rate / self.frame_time
        coarse = 1 if excess <= 1 else min(max(math.ceil(math.sqrt(excess)), 2), COARSEST)
        start = time.perf_counter()
        picture = render(box, coarse)
        self._learn(time.perf_counter() - start, pixels / coarse**2)
        rgba = np.dstack([picture.color, picture.alpha])
        height, width = picture.alpha.shape
        covered = (box[0], box[1], box[0] + width * coarse, box[1] + height * coarse)
        if coarse == 1:
            return Layer(covered, rgba)
        crop = texture.levels[0]
        draft = Draft(_looks(picture), crop, texture.left, texture.top)
        return Layer(covered, rgba, draft)

    def _refine(self, work: _Work, render: Callable[..., Picture3D]) -> None:
        """Another strip or more of the exact picture; it is shown when it is complete."""
        x0, y0, x1, y1 = work.box
        if work.exact is None:
            work.exact = np.zeros((y1 - y0, x1 - x0, 4), np.float32)
        width, height = x1 - x0, y1 - y0
        rows = int(STRIP_TIME / (self._rate * width)) // STRIP_ROWS * STRIP_ROWS
        end = min(work.rows + max(rows, STRIP_ROWS), height)
        start = time.perf_counter()
        picture = render((x0, y0 + work.rows, x1, y0 + end))
        self._learn(time.perf_counter() - start, (end - work.rows) * width)
        work.exact[work.rows : end] = np.dstack([picture.color, picture.alpha])
        work.rows = end
        if end == height:
            work.shown = Layer((x0, y0, x1, y1), work.exact)

    def _learn(self, seconds: float, pixels: float) -> None:
        """A moving average, so that one disturbed frame decides little."""
        rate = seconds / max(pixels, 1.0)
        self._rate = float(np.clip(0.7 * self._rate + 0.3 * rate, 1e-9, 1e-5))


def _render(
    splats: PosedSplats, texture: TextureLevels, window: Camera, camera: Camera
) -> Picture3D:
    from objectmorpher_core.raster import tiles

    return tiles.render(splats, texture, window, camera)


def _window(view: View, camera: Camera, box: tuple[int, int, int, int], coarse: int) -> Camera:
    """The photo's camera through a part of the canvas, at a fraction of its resolution."""
    x0, y0, x1, y1 = box
    left, top = view.left + x0 / view.zoom, view.top + y0 / view.zoom
    width, height = -(-(x1 - x0) // coarse), -(-(y1 - y0) // coarse)
    return camera.windowed(left, top, width, height, view.zoom / coarse)


def _bounds(
    splats: PosedSplats, camera: Camera, view: View
) -> tuple[int, int, int, int] | None:  # fmt: skip
    """The part of the canvas that the object may touch, canvas px; None outside it."""
    means = splats.means[splats.means[:, 2] > 0]
    if len(means) == 0:
        return None
    xy = view.canvas_from_image(camera.project(means))
    margin = MARGIN + 2 * splats.gap * camera.focal / float(means[:, 2].min()) * view.zoom
    low = np.floor(xy.min(0) - margin).clip(0, (view.width, view.height)).astype(int)
    high = np.ceil(xy.max(0) + margin).clip(0, (view.width, view.height)).astype(int)
    if (high <= low).any():
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


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
