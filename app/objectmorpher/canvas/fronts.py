"""Things that stay in front of the edit, drawn from the photo's pixels by their matte."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.document.model import Document, EditObject, Matte
from objectmorpher_core.document.settings import Refined

from ..editor.view import ViewState
from .layer import CanvasLayer, as_u8
from .memo import Memo

if TYPE_CHECKING:
    from objectmorpher_core.raster.texture import TextureLevels


MOST = 12  # pictures that are remembered
PIXELS_FROM = 4.0  # magnification from which the photo shows single pixels, and so does this


class Fronts:
    """The pictures of each view, remembered."""

    def __init__(self) -> None:
        self._levels, self._most = Memo(MOST), MOST
        self._kept: dict[int, tuple[Matte, tuple[float, ...], CanvasLayer | None]] = {}

    def make_room(self, count: int) -> None:
        """Remembers so many, which are shown together."""
        self._most = max(MOST, count)
        self._levels.make_room(count)

    def layer(self, item: EditObject, view: ViewState) -> CanvasLayer | None:
        """Px for px; None where nothing of it is on the canvas."""
        matte = item.matte
        assert matte is not None, "what stays in front has one"
        kept = self._kept.get(id(matte))
        if kept is None or kept[0] is not matte or kept[1] != view.place:
            levels = self._levels(lambda: _levels(matte), matte)
            self._kept.pop(id(matte), None)
            while len(self._kept) >= self._most:
                del self._kept[next(iter(self._kept))]  # the oldest
            kept = self._kept[id(matte)] = (matte, view.place, drawn(levels, view))
        return kept[2]


def _levels(matte: Matte) -> TextureLevels:
    """Premultiplied, with halved copies for what is shown smaller than it is."""
    from objectmorpher_core.raster.texture import build_levels

    own = matte.foreground * matte.alpha[..., None]
    return build_levels(own, matte.alpha, matte.left, matte.top)


def drawn(levels: TextureLevels, view: ViewState, strength: float = 1.0) -> CanvasLayer | None:
    """Draw the photo's pixels as its texture is looked up: linearly, single ones when near.

    `levels` hold premultiplied colours, of which `strength` in [0, 1] is shown.
    None where nothing of it is on the canvas.
    """
    height, width = levels.levels[0].shape[:2]
    corner = np.array([levels.left, levels.top])
    low = np.floor(view.canvas_from_image(corner)).astype(int)
    high = np.ceil(view.canvas_from_image(corner + (width, height))).astype(int)
    x0, y0 = (max(int(v), 0) for v in low)
    x1, y1 = min(int(high[0]), view.width), min(int(high[1]), view.height)
    if x0 >= x1 or y0 >= y1:
        return None
    times = min(max(int(math.log2(1 / view.zoom)), 0), len(levels.levels) - 1)
    step = 1 / (view.zoom * 2**times)  # px of the level for each canvas px
    start = (view.image_from_canvas((x0 + 0.5, y0 + 0.5)) - corner) / 2**times - 0.5
    matrix = np.array([[step, 0, start[0]], [0, step, start[1]]])
    way = cv2.INTER_NEAREST if view.zoom >= PIXELS_FROM else cv2.INTER_LINEAR
    level = np.ascontiguousarray(levels.levels[times])
    shown = cv2.warpAffine(level, matrix, (x1 - x0, y1 - y0), flags=way | cv2.WARP_INVERSE_MAP)
    box = (float(x0), float(y0), float(x1), float(y1))
    return CanvasLayer(box, as_u8(shown * np.float32(strength)))


# The document's refinement on the canvas: over the edit, as `compose/composite.py` mixes it.


class RefinedView:
    """Its picture in the last view, remembered."""

    def __init__(self) -> None:
        self._levels = Memo()
        self._kept: tuple[Refined, tuple[object, ...], CanvasLayer | None] | None = None

    def layers(
        self, document: Document, view: ViewState, is_marked: bool = False
    ) -> tuple[CanvasLayer, ...]:
        """Return layers of the photo's own pixels; none where the edit is unrefined or out of view.

        `is_marked`: all of it is the network's, which a view tells by hatching.
        """
        refined = document.refined
        if refined is None or refined.strength == 0:
            return ()
        kept = self._kept
        place = (*view.place, is_marked)
        if kept is None or kept[0] is not refined or kept[1] != place:
            # Of another strength they are the same: it is dragged.
            levels = self._levels(lambda: _refined_levels(refined), refined.pixels, refined.alpha)
            layer = drawn(levels, view, refined.strength)
            if layer is not None:
                invented = layer.rgba[..., 3] if is_marked else None
                layer = replace(layer, is_weighed=True, invented=invented)
            kept = self._kept = (refined, place, layer)
        return () if kept[2] is None else (kept[2],)


def _refined_levels(refined: Refined) -> TextureLevels:
    """At full strength: premultiplied, with halved copies for what is shown smaller than it is."""
    from objectmorpher_core.base.arrays import unit_pixels
    from objectmorpher_core.raster.texture import build_levels

    weights = refined.alpha.astype(np.float32) / np.float32(255)
    premultiplied = np.asarray(unit_pixels(refined.pixels) * weights[..., None], np.float32)
    return build_levels(premultiplied, weights, refined.left, refined.top)
