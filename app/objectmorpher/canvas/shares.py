"""Where the changed pixels of an edit come from, counted on a small picture of it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document

from ..editor.view import ViewState
from .blend import CELL
from .frame import Cache, Frame, build_frame
from .layer import CanvasLayer, FrameObject

SMALL = 320  # px, longer side of the picture on which shares are counted
LEAST = 0.02  # of a pixel that something new covers: with less it counts as unchanged


@dataclass(frozen=True)
class CanvasShares:
    """Origins of the changed pixels; they sum to 1, or are 0 where nothing changed."""

    from_photo: float = 0.0
    from_lifter: float = 0.0
    from_inpainter: float = 0.0
    from_refiner: float = 0.0
    from_paint: float = 0.0
    changed: float = 0.0  # of all pixels of the photo


def shares(document: Document, cache: Cache) -> CanvasShares:
    """Where the changed pixels come from; remembered.

    The export counts at the photo's own size and reports the exact figures.
    """
    return cache.counted(lambda: _count(document, cache), document)


def count_changed(document: Document, cache: Cache) -> int:
    """About how many pixels of the photo the edit changes: two figures of the number."""
    if not any(o.is_moved for o in document.objects):
        return 0
    width, height = document.photo.size
    count = round(shares(document, cache).changed * width * height)
    return round(count, 2 - len(str(count)))


def _count(document: Document, cache: Cache) -> CanvasShares:
    view = _small_view(document)
    frame = build_frame(document, view, cache, renderer="gl")
    assert frame.blend is not None, "the composite has one"
    across, down = frame.blend.shape[1] * CELL, frame.blend.shape[0] * CELL
    edited = cv2.resize(frame.blend, (across, down))[: view.height, : view.width]
    hole, size = cache.derived.invented_background(document), (view.width, view.height)
    inpainted = np.zeros(size[::-1], np.float32)
    if hole is not None:
        cv2.resize(hole.astype(np.float32), size, inpainted, interpolation=cv2.INTER_AREA)
    seen = _through_objects(document, frame, view, inpainted)
    through = seen.unchanged
    is_changed = (edited > 0) & (through < 1 - LEAST)
    if not is_changed.any():
        return CanvasShares()
    # The cells of the blend are coarse: beside the edge of an edit a part of a pixel is changed.
    parts, whole = (seen.lifted, seen.inpainted, seen.painted), float(edited[is_changed].sum())
    by_lifter, by_inpainter, by_paint = (
        float((p * edited)[is_changed].sum()) / whole for p in parts
    )
    by_refiner = float(_alpha(frame.refined, view)[is_changed].mean())
    rest = 1 - by_refiner  # as the composite's figures: a refinement lies over all the others
    by_lifter, by_inpainter, by_paint = rest * by_lifter, rest * by_inpainter, rest * by_paint
    from_photo = rest - by_lifter - by_inpainter - by_paint
    changed = float(is_changed.mean())
    return CanvasShares(from_photo, by_lifter, by_inpainter, by_refiner, by_paint, changed)


def _small_view(document: Document) -> ViewState:
    width, height = document.photo.size
    view = ViewState(zoom=min(SMALL / max(width, height), 1.0))
    view.width, view.height = round(width * view.zoom), round(height * view.zoom)
    return view


@dataclass(frozen=True, eq=False)
class _Seen:
    """What each pixel (h, w) shows of each origin."""

    lifted: F32
    inpainted: F32
    painted: F32
    unchanged: F32


def _through_objects(document: Document, frame: Frame, view: ViewState, inpainted: F32) -> _Seen:
    """What is seen of the origins, of which `inpainted` (h, w) lies behind the objects."""
    from objectmorpher_core.raster import tiles

    camera = document.photo.camera
    lifted, painted = np.zeros_like(inpainted), np.zeros_like(inpainted)
    unchanged = 1 - inpainted
    for own in frame.objects:
        still, paint = np.float32(0), None  # what of the object is where and as it was
        if isinstance(own, CanvasLayer):
            through, invented = 1 - _alpha((own,), view), np.float32(0)
        else:
            picture = tiles.render(own.draft, own.shape.texture, view.camera(camera), camera)
            through = 1 - np.minimum(picture.alpha, 1)
            invented = np.maximum(picture.alpha - picture.from_photo, 0)
            paint = _paint_on(own, view.camera(camera), camera)
            if paint is not None:
                alpha = np.maximum(picture.alpha, np.float32(1e-6))
                paint = np.minimum(paint, picture.alpha)
                invented = invented * (1 - paint / alpha)
                if own.item.is_only_painted:
                    still = np.minimum(picture.alpha, 1) - paint
        lifted = through * lifted + invented
        painted = through * painted
        if paint is not None:
            painted = painted + paint
        inpainted, unchanged = through * inpainted, still + through * unchanged
    return _Seen(lifted, inpainted, painted, unchanged)


def _paint_on(own: FrameObject, window: Camera, camera: Camera) -> F32 | None:
    """How much of an object's picture is paint; None where nothing is painted."""
    if (paint := own.shape.paint) is None:
        return None
    return paint.draw(paint.prepare(own.posed, window, camera), None)


def _alpha(layers: tuple[CanvasLayer, ...], view: ViewState) -> F32:
    """(h, w) of pictures that lie over the canvas, px for px."""
    alpha = np.zeros((view.height, view.width), np.float32)
    for layer in layers:
        x0, y0, x1, y1 = (int(v) for v in layer.box)
        alpha[y0:y1, x0:x1] = layer.rgba[..., 3] / np.float32(255)
    return alpha
