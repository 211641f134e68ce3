"""The moved objects as the canvas shows them, in the time that a frame has.

Where the rasteriser needs longer, a frame shows a *draft*: the object from fewer Gaussians at a
fraction of the canvas's resolution, made sharp by looking up the photo at all of it (`sharpening`).
When nothing has changed for a moment, the worker is asked for the exact picture, which replaces it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.base.camera import Camera

from ..editor.view import Shown, ViewState
from .derived import Derived
from .layer import (
    Box,
    CanvasLayer,
    ExactPicture,
    FrameObject,
    ObjectPart,
    Rendered,
    as_u8,
    in_light,
)

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.reference import Picture3D
    from objectmorpher_core.raster.texture import TextureLevels
    from objectmorpher_core.raster.tiles import Drawable


FRAME = 0.008  # s, what rendering may take of a frame
STILL = 0.12  # s without a change, after which the exact picture is asked for
COARSEST = 6  # canvas px per px of a draft
FIRST_RATE = 2.5e-7  # s per px, before anything has been measured


@dataclass(eq=False)
class _Work:
    """The picture of a part."""

    source: PosedSplats  # the object as it is
    splats: PosedSplats  # what is drawn of it
    view: tuple[float, ...]
    request: ExactPicture  # for the exact one
    box: Box  # canvas px
    shown: CanvasLayer
    since: float  # s, monotonic, when the splats or the view changed last
    is_asked: bool = False
    lit: tuple[CanvasLayer, Lit, CanvasLayer] | None = (
        None  # `shown`, light and grain, and `shown` in them
    )


Ask = Callable[[ExactPicture, Callable[[Rendered], None]], None]


class Layers:
    """Renders objects, remembers the pictures of each view, and keeps within the frame's time."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._works: dict[ObjectPart, _Work] = {}  # its last picture
        self._drawn: list[_Work] = []  # in the last frame
        self._rates: dict[tuple[Shown, bool], float] = {}  # s per px, exact or draft
        self._sharpening = 0.0  # s per px of the view, of a draft; measured
        self.ask: Ask | None = None  # renders elsewhere and calls back

    @property
    def is_waiting(self) -> bool:
        """Whether an exact picture is still to be asked for."""
        return any(w.shown.is_draft and not w.is_asked for w in self._drawn)

    def draw(
        self, objects: Sequence[FrameObject], camera: Camera, view: ViewState, seconds: float
    ) -> dict[ObjectPart, CanvasLayer]:
        """The pictures of what is on the canvas of `objects`, made in about so many seconds.

        `camera` is the photo's.
        """
        missing = [o for o in objects if not self._is_there(o, view)]
        for own in missing:
            self._render(own, camera, view, seconds / len(missing))
        self._drawn = [self._works[o.part] for o in objects if o.part in self._works]
        for work in self._drawn:
            self._want_exact(work)
        return {o.part: _lit(self._works[o.part], o.lit) for o in objects if o.part in self._works}

    def forget(self, lifted: set[int], posed: Callable[[int], PosedSplats]) -> None:
        """Drops the pictures of objects other than these, or not as they were."""
        self._works = {
            part: work
            for part, work in self._works.items()
            if part.k in lifted and posed(part.k) is work.source
        }

    def _is_there(self, own: FrameObject, view: ViewState) -> bool:
        work = self._works.get(own.part)
        return work is not None and work.splats is own.splats and work.view == view.place

    def _render(self, own: FrameObject, camera: Camera, view: ViewState, seconds: float) -> None:
        """A new picture of the object, in about so many seconds."""
        layer = self._draw(own, camera, view, self._factor(own, camera, view, seconds))
        if layer is None:
            self._works.pop(own.part, None)
            return
        x0, y0, x1, y1 = layer.box
        box = (int(x0), int(y0), int(x1), int(y1))
        window = view.camera(camera, box)
        paint = own.shape.paint if own.part.is_marked else None
        request = ExactPicture(own.splats, own.shape.texture, window, camera, own.part, paint)
        self._works[own.part] = _Work(
            own.posed, own.splats, view.place, request, box, layer, time.monotonic()
        )

    def _factor(self, own: FrameObject, camera: Camera, view: ViewState, seconds: float) -> int:
        """Canvas px per px of what can be drawn in so many seconds; 1 is exact."""
        points = own.item.pose.points if own.item.pose else own.shape.puppet.lifted.control_points
        matrix = own.posed.world_from_object
        world = points @ matrix[:3, :3].T + matrix[:3, 3]
        seen = view.canvas_from_image(camera.project(world))
        corners = np.array([seen.min(0), seen.max(0)]).clip(0, (view.width, view.height))
        pixels = float(np.ptp(corners, axis=0).prod())
        look = own.part.look
        if pixels * self._rates.get((look, False), FIRST_RATE) <= seconds:
            return 1
        left = seconds - pixels * self._sharpening  # which takes as long at any factor
        excess = pixels * self._rates.get((look, True), FIRST_RATE) / max(left, 1e-9)
        return int(np.clip(math.ceil(math.sqrt(excess)), 2, COARSEST))

    def _draw(
        self, own: FrameObject, camera: Camera, view: ViewState, factor: int
    ) -> CanvasLayer | None:
        """The picture of an object, or None where nothing of it is on the canvas."""
        from objectmorpher_core.raster import tiles

        part, texture = own.part, own.shape.texture
        start = time.perf_counter()
        if factor == 1 and not part.is_painted:  # it is picked in, too
            drawable = self._derived.drawable_of(part.k, own.posed, camera, view)
        else:
            splats = own.splats if part.is_painted else own.draft
            drawable = _prepare(splats, _coarser(view.camera(camera), factor), camera)
        box = drawable.box()
        if box is None:
            return None
        pixels, sharpened = (box[2] - box[0]) * (box[3] - box[1]), 0.0
        painted = None
        if part.is_marked and (paint := own.shape.paint) is not None:
            window = _coarser(view.camera(camera), factor)
            painted = paint.draw(paint.prepare(drawable.splats, window, camera), box)
        if factor == 1:
            layer = _layer(box, _rendered(drawable, texture, part, box, painted), part)
        elif part.is_painted:
            layer = _coarse_layer(drawable, texture, part, box, factor)
        else:
            picture = tiles.draw(drawable, texture, box)
            drawn = time.perf_counter()
            layer = _sharp_layer(picture, texture, part, box, factor, view, painted, drawable)
            sharpened = time.perf_counter() - drawn
            self._sharpening = _mean_rate(self._sharpening, sharpened, factor**2 * pixels)
        seconds = time.perf_counter() - start - sharpened
        kind = (part.look, factor > 1)
        self._rates[kind] = _mean_rate(self._rates.get(kind, FIRST_RATE), seconds, pixels)
        return layer

    def _want_exact(self, work: _Work) -> None:
        """Asks for the exact picture of what has not changed for a moment."""
        if self.ask is None or not work.shown.is_draft or work.is_asked:
            return
        if time.monotonic() - work.since < STILL:
            return
        work.is_asked = True

        def accept(rendered: Rendered) -> None:
            work.shown = _layer(work.box, rendered, work.request.part)

        self.ask(work.request, accept)


def _mean_rate(before: float, seconds: float, pixels: float) -> float:
    """A moving average of s per px, so that one disturbed frame decides little."""
    mean = 0.7 * before + 0.3 * seconds / max(pixels, 1.0)
    return float(np.clip(mean, 1e-9, 1e-5))


def render(request: ExactPicture) -> Rendered:
    """The exact picture."""
    drawable = _prepare(request.splats, request.window, request.camera)
    painted = None
    if (paint := request.paint) is not None:
        prepared = paint.prepare(request.splats, request.window, request.camera)
        painted = paint.draw(prepared, None)
    return _rendered(drawable, request.texture, request.part, painted=painted)


def _prepare(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> Drawable:
    from objectmorpher_core.raster import tiles

    return tiles.prepare(splats, camera, photo_camera)


def _rendered(
    drawable: Drawable,
    texture: TextureLevels,
    part: ObjectPart,
    box: Box | None = None,
    painted: F32 | None = None,
) -> Rendered:
    """All of the view or the part `box` of it; `painted` (h, w) is how much of that is paint."""
    from objectmorpher_core.raster import tiles

    if not part.is_marked:
        return Rendered(tiles.draw_rgba(drawable, texture, box))
    picture = tiles.draw(drawable, texture, box)
    rgba = np.dstack([picture.color, picture.alpha])
    from_photo = picture.from_photo
    if painted is not None:
        from_photo = from_photo * (1 - np.minimum(painted / np.maximum(picture.alpha, 1e-6), 1))
    return Rendered(as_u8(rgba), as_u8(picture.alpha - from_photo))


def _layer(box: Box, rendered: Rendered, part: ObjectPart) -> CanvasLayer:
    return CanvasLayer(_floats(box), rendered.rgba, rendered.invented, is_tint=_is_tint(part))


def _coarse_layer(
    drawable: Drawable, texture: TextureLevels, part: ObjectPart, box: Box, factor: int
) -> CanvasLayer:
    """A painted object, smooth already; `box` in px of the drawable, `factor` canvas px wide."""
    from objectmorpher_core.raster import tiles

    rgba = tiles.draw_rgba(drawable, texture, box)
    x0, y0, x1, y1 = box
    covered = _floats((factor * x0, factor * y0, factor * x1, factor * y1))
    return CanvasLayer(covered, rgba, is_draft=True, is_coarse=True, is_tint=_is_tint(part))


def _sharp_layer(
    picture: Picture3D,
    texture: TextureLevels,
    part: ObjectPart,
    box: Box,
    factor: int,
    view: ViewState,
    painted: F32 | None,
    drawable: Drawable,
) -> CanvasLayer:
    """An object that shows the photo, see `sharpening`; `box` as above, `painted` of it.

    It is the photo that the object carries, which may be another one.
    """
    from objectmorpher_core.raster.sharpening import sharpen

    x0, y0, x1, y1 = (factor * v for v in box)
    covered = (x0, y0, min(x1, view.width), min(y1, view.height))
    coarse, photo = drawable.camera, drawable.photo_camera
    step = photo.focal / coarse.focal  # photo px per px of the draft
    corner = (photo.cx - step * coarse.cx, photo.cy - step * coarse.cy)
    rgba, invented = sharpen(
        picture, texture, factor, covered, corner, factor / step, is_marked=part.is_marked
    )
    if painted is not None and invented is not None:
        wide = cv2.resize(painted, None, fx=factor, fy=factor)[: len(rgba), : rgba.shape[1]]
        invented = np.maximum(invented, np.minimum(as_u8(wide), rgba[..., 3]))
    return CanvasLayer(_floats(covered), rgba, invented, is_draft=True)


def _lit(work: _Work, look: Lit) -> CanvasLayer:
    """Its picture in the light of where the object is; varying over it, in focus, with grain."""
    shown = work.shown
    if work.request.part.is_painted:
        return shown
    is_plain = look.relit is None and look.grain is None and look.saturation == 1
    if is_plain and look.blur <= 0 and look.sharpness <= 0 and look.opacity == 1:
        is_same = look.gain == shown.gain and look.mode == shown.mode
        return shown if is_same else replace(shown, gain=look.gain, mode=look.mode)
    kept = work.lit
    if kept is None or kept[0] is not shown or kept[1] is not look:
        kept = work.lit = shown, look, in_light(shown, look, work.view)
    return kept[2]


def _floats(box: Box) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = box
    return float(x0), float(y0), float(x1), float(y1)


def _is_tint(part: ObjectPart) -> bool:
    return part.look is Shown.STRAIN


def _coarser(window: Camera, coarse: int) -> Camera:
    """The same window with `coarse` times fewer px across and down."""
    if coarse == 1:
        return window
    width, height = -(-window.width // coarse), -(-window.height // coarse)
    return window.windowed(0.0, 0.0, width, height, 1.0 / coarse)
