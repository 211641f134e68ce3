"""The moved objects as the canvas shows them, in the time that a frame has.

Where the rasteriser needs longer, a frame shows a *draft*: the object from fewer Gaussians at a
fraction of the canvas's resolution, made sharp by looking up the photo at all of it (`sharpening`).
When nothing has changed for a moment, the worker is asked for the exact picture, which replaces it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import U8
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document

from ..editor.view import Shown, View
from .painter import PAINTED

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit
    from objectmorpher_core.raster.posed import PosedSplats
    from objectmorpher_core.raster.reference_layers import Picture3D
    from objectmorpher_core.raster.texture import TextureLevels
    from objectmorpher_core.raster.tiles import Drawable

    from .derived import Derived


FRAME = 0.009  # s, what rendering may take of a frame
STILL = 0.12  # s without a change, after which the exact picture is asked for
COARSEST = 6  # canvas px per px of a draft
FIRST_RATE = 2.5e-7  # s per px, before anything has been measured


@dataclass(frozen=True, eq=False)
class Layer:
    """A rendered object on the canvas."""

    box: tuple[float, float, float, float]  # x0, y0, x1, y1 canvas px
    rgba: np.ndarray  # (h, w, 4) premultiplied sRGB, f32 in [0, 1] or u8
    invented: np.ndarray | None = None  # (h, w) u8, what of alpha is not the photo's: hatched
    is_coarse: bool = False  # with fewer px than its box; else px for px
    is_draft: bool = False  # to be replaced by the exact picture
    is_tint: bool = False  # lies over everything, translucent
    is_weighed: bool = False  # by the edit's share already: the blend does not count
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of its colours

    @property
    def pixels(self) -> U8:
        """(h, w, 4) u8."""
        return self.rgba if self.rgba.dtype == np.uint8 else _as_u8(self.rgba)


@dataclass(frozen=True, eq=False)
class Rendered:
    """An exact picture."""

    rgba: np.ndarray  # (h, w, 4) u8, premultiplied
    invented: np.ndarray | None = None  # (h, w) u8, see `Layer`


@dataclass(frozen=True, eq=False)
class Request:
    """An exact picture to be rendered."""

    splats: PosedSplats
    texture: TextureLevels
    window: Camera
    camera: Camera  # the photo's
    part: Part


@dataclass(frozen=True)
class Part:
    """An object, and how it is shown: as it is, with what of it is invented, or painted."""

    k: int
    look: Shown

    @property
    def is_painted(self) -> bool:
        return self.look in PAINTED

    @property
    def is_marked(self) -> bool:
        return self.look is Shown.PROVENANCE


@dataclass(eq=False)
class _Work:
    """The picture of a part."""

    source: PosedSplats  # the object as it is
    splats: PosedSplats  # what is drawn of it
    view: tuple[float, ...]
    request: Request  # for the exact one
    box: Box  # canvas px
    shown: Layer
    since: float  # s, monotonic, when the splats or the view changed last
    is_asked: bool = False
    lit: tuple[Layer, Lit, Layer] | None = None  # `shown`, light and grain, and `shown` in them


Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px
Ask = Callable[[Request, Callable[[Rendered], None]], None]


class Layers:
    """Renders objects, remembers the pictures of each view, and keeps within the frame's time."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._works: dict[Part, _Work] = {}  # its last picture
        self._drawn: list[_Work] = []  # in the last frame
        self._rates: dict[tuple[Shown, bool], float] = {}  # s per px, exact or draft
        self._sharpening = 0.0  # s per px of the view, of a draft; measured
        self.frame_time = FRAME  # s; infinite where only the last frame counts
        self.ask: Ask | None = None  # renders elsewhere and calls back

    @property
    def is_waiting(self) -> bool:
        """Whether an exact picture is still to be asked for."""
        if self._derived.lights.is_waiting:
            return True
        return any(w.shown.is_draft and not w.is_asked for w in self._drawn)

    def draw(
        self, document: Document, view: View, shown: Shown = Shown.COMPOSITE
    ) -> tuple[Layer, ...]:
        """The pictures of the objects that a view shows, back to front."""
        self._forget(document)
        parts = self.parts(document, shown)
        rendered = [part for part in parts if not is_front(document, part.k)]
        missing = [part for part in rendered if not self._is_there(document, part, view)]
        for part in missing:
            self._render(document, part, view, self.frame_time / len(missing))
        self._drawn = [self._works[part] for part in rendered if part in self._works]
        for work in self._drawn:
            self._want_exact(work)
        found = (self._shown(document, part, view) for part in parts)
        return tuple(layer for layer in found if layer is not None)

    def _shown(self, document: Document, part: Part, view: View) -> Layer | None:
        """The picture of a part that is rendered, or stays in front."""
        if is_front(document, part.k):
            return self._derived.fronts.layer(document.objects[part.k], view)
        return self._lit(document, self._works[part]) if part in self._works else None

    def _lit(self, document: Document, work: _Work) -> Layer:
        """Its picture in the light of where it is."""
        part = work.request.part
        if part.is_painted:
            return work.shown
        look = self._derived.lights.of(document, part.k)
        if look.relit is not None or look.grain is not None or look.blur > 0:
            return _lit(work, look)
        return work.shown if look.gain == work.shown.gain else replace(work.shown, gain=look.gain)

    def parts(self, document: Document, shown: Shown) -> list[Part]:
        """What a view is put together from, back to front."""
        order = self.order(document, shown)
        if shown is Shown.OBJECT:
            return [Part(k, Shown.COMPOSITE) for k in order]
        if shown is not Shown.STRAIN:
            return [Part(k, shown) for k in order]
        parts, drawn = [], self.order(document)
        for k in order:  # the tint right over its object, so that nearer ones cover both
            if k in drawn:
                parts.append(Part(k, Shown.COMPOSITE))
            parts.append(Part(k, Shown.STRAIN))
        return parts + [Part(k, Shown.COMPOSITE) for k in drawn if is_front(document, k)]

    def order(
        self, document: Document, shown: Shown = Shown.COMPOSITE
    ) -> Mapping[int, PosedSplats | None]:
        """The visible objects back to front; over the photo only those that the export draws.

        What stays in front has no Gaussians.
        """
        from objectmorpher_core.compose.order import back_to_front, stack

        objects = document.objects
        posed = partial(self._derived.posed, document)
        if shown in (Shown.COMPOSITE, Shown.PROVENANCE):
            drawn = stack(document, posed)
            return {k: splats for k, splats in drawn.items() if objects[k].is_visible}
        is_there = [o.lifted is not None and o.is_visible and not is_front(document, k)
                    for k, o in enumerate(objects)]  # fmt: skip
        there = {k: posed(k) for k, here in enumerate(is_there) if here}
        return {k: there[k] for k in back_to_front(objects, there)}

    def _forget(self, document: Document) -> None:
        """Drops the pictures of objects that are not as they were."""
        lifted = {k for k, o in enumerate(document.objects) if o.lifted}
        self._derived.make_room(len(document.objects))
        self._works = {
            part: work
            for part, work in self._works.items()
            if part.k in lifted and self._derived.posed(document, part.k) is work.source
        }
        self._derived.forget(lifted)
        self._derived.painter.forget(len(document.objects))

    def _is_there(self, document: Document, part: Part, view: View) -> bool:
        work = self._works.get(part)
        splats = self._derived.painter.painted(document, part.k, part.look)
        return work is not None and work.splats is splats and work.view == view.place

    def _render(self, document: Document, part: Part, view: View, seconds: float) -> None:
        """A new picture of the part, in about so many seconds."""
        k, camera, derived = part.k, document.photo.camera, self._derived
        factor = self._factor(document, part, view, seconds)
        layer = self._draw(document, part, view, factor)
        if layer is None:
            self._works.pop(part, None)
            return
        x0, y0, x1, y1 = layer.box
        box = (int(x0), int(y0), int(x1), int(y1))
        splats = derived.painter.painted(document, k, part.look)
        texture = derived.shape(document.photo, document.objects[k]).texture
        request = Request(splats, texture, view.camera(camera, box), camera, part)
        source, now = derived.posed(document, k), time.monotonic()
        self._works[part] = _Work(source, splats, view.place, request, box, layer, now)

    def _factor(self, document: Document, part: Part, view: View, seconds: float) -> int:
        """Canvas px per px of what can be drawn in so many seconds; 1 is exact."""
        low, high = self._derived.frame(document, part.k).corners[[0, 2]]
        corners = view.canvas_from_image(np.array([low, high]))
        sides = np.ptp(corners.clip(0, (view.width, view.height)), axis=0)
        pixels = float(sides.prod())
        if pixels * self._rates.get((part.look, False), FIRST_RATE) <= seconds:
            return 1
        left = seconds - pixels * self._sharpening  # which takes as long at any factor
        excess = pixels * self._rates.get((part.look, True), FIRST_RATE) / max(left, 1e-9)
        return int(np.clip(math.ceil(math.sqrt(excess)), 2, COARSEST))

    def _draw(self, document: Document, part: Part, view: View, factor: int) -> Layer | None:
        """The picture of a part, or None where nothing of it is on the canvas."""
        from objectmorpher_core.raster import tiles

        derived, camera, k = self._derived, document.photo.camera, part.k
        texture = derived.shape(document.photo, document.objects[k]).texture
        start = time.perf_counter()
        if part.is_painted:
            drawable = _prepare(
                derived.painter.painted(document, k, part.look),
                _coarser(view.camera(camera), factor), camera,
            )  # fmt: skip
        elif factor == 1:
            drawable = derived.drawable(document, k, view)
        else:
            splats = derived.draft(document, k)
            drawable = _prepare(splats, _coarser(view.camera(camera), factor), camera)
        box = drawable.box()
        if box is None:
            return None
        pixels, sharpened = (box[2] - box[0]) * (box[3] - box[1]), 0.0
        if factor == 1:
            layer = _layer(box, _rendered(drawable, texture, part, box), part)
        elif part.is_painted:
            layer = _coarse_layer(drawable, texture, part, box, factor)
        else:
            picture = tiles.draw(drawable, texture, box)
            drawn = time.perf_counter()
            layer = _sharp_layer(picture, texture, part, box, factor, view)
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


def is_front(document: Document, k: int) -> bool:
    """Whether object `k` stays in front, and is shown as the photo has it."""
    from objectmorpher_core.compose.order import stands_in_front

    return stands_in_front(document.objects[k])


def _mean_rate(before: float, seconds: float, pixels: float) -> float:
    """A moving average of s per px, so that one disturbed frame decides little."""
    mean = 0.7 * before + 0.3 * seconds / max(pixels, 1.0)
    return float(np.clip(mean, 1e-9, 1e-5))


def render(request: Request) -> Rendered:
    """The exact picture."""
    drawable = _prepare(request.splats, request.window, request.camera)
    return _rendered(drawable, request.texture, request.part)


def _prepare(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> Drawable:
    from objectmorpher_core.raster import tiles

    return tiles.prepare(splats, camera, photo_camera)


def _rendered(
    drawable: Drawable, texture: TextureLevels, part: Part, box: Box | None = None
) -> Rendered:
    """All of the view or the part `box` of it."""
    from objectmorpher_core.raster import tiles

    if not part.is_marked:
        return Rendered(tiles.draw_rgba(drawable, texture, box))
    picture = tiles.draw(drawable, texture, box)
    rgba = np.dstack([picture.color, picture.alpha])
    return Rendered(_as_u8(rgba), _as_u8(picture.alpha - picture.from_photo))


def _layer(box: Box, rendered: Rendered, part: Part) -> Layer:
    return Layer(_floats(box), rendered.rgba, rendered.invented, is_tint=_is_tint(part))


def _coarse_layer(
    drawable: Drawable, texture: TextureLevels, part: Part, box: Box, factor: int
) -> Layer:
    """A painted object, smooth already; `box` in px of the drawable, `factor` canvas px wide."""
    from objectmorpher_core.raster import tiles

    rgba = tiles.draw_rgba(drawable, texture, box)
    x0, y0, x1, y1 = box
    covered = _floats((factor * x0, factor * y0, factor * x1, factor * y1))
    return Layer(covered, rgba, is_draft=True, is_coarse=True, is_tint=_is_tint(part))


def _sharp_layer(
    picture: Picture3D, texture: TextureLevels, part: Part, box: Box, factor: int, view: View
) -> Layer:
    """An object that shows the photo, see `sharpening`; `box` as above."""
    from objectmorpher_core.raster.sharpening import sharpen

    x0, y0, x1, y1 = (factor * v for v in box)
    covered = (x0, y0, min(x1, view.width), min(y1, view.height))
    corner = (view.left, view.top)
    rgba, invented = sharpen(
        picture, texture, factor, covered, corner, view.zoom, is_marked=part.is_marked
    )
    return Layer(_floats(covered), rgba, invented, is_draft=True)


def _lit(work: _Work, look: Lit) -> Layer:
    """What is shown of a part, in a light that varies over it, in focus or not, and with grain."""
    shown, kept = work.shown, work.lit
    if kept is None or kept[0] is not shown or kept[1] is not look:
        kept = work.lit = shown, look, in_light(shown, look, work.view)
    return kept[2]


def _floats(box: Box) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = box
    return float(x0), float(y0), float(x1), float(y1)


def _is_tint(part: Part) -> bool:
    return part.look is Shown.STRAIN


def _as_u8(values: np.ndarray) -> U8:
    return (values * 255 + 0.5).clip(0, 255).astype(np.uint8)


def _coarser(window: Camera, coarse: int) -> Camera:
    """The same window with `coarse` times fewer px across and down."""
    if coarse == 1:
        return window
    width, height = -(-window.width // coarse), -(-window.height // coarse)
    return window.windowed(0.0, 0.0, width, height, 1.0 / coarse)


# A rendered object's picture in the light of its new place: focus, shading, colour and grain.

NEUTRAL = (1.0, 1.0, 1.0)


def in_light(shown: Layer, look: Lit, place: tuple[float, ...]) -> Layer:
    """What the export does, in its order; `place` is the `View.place` of the picture."""
    from objectmorpher_core.compose.light.harmonize import lit_rgba

    left, top, zoom = place[:3]
    if look.blur > 0 and shown.invented is None:  # where what is the photo's is marked, it is exact
        shown = _out_of_focus(shown, look.blur * zoom, (int(place[3]), int(place[4])))
    x0, y0 = shown.box[:2]
    corner = (left + x0 / zoom, top + y0 / zoom, zoom)
    rgba, gain = shown.pixels, look.gain
    if look.relit is not None:
        rgba = look.relit.lit_rgba(rgba, *corner)
    if look.grain is not None:  # last: it is as strong as the photo's at the brightness shown
        rgba, gain = look.grain.grained_rgba(lit_rgba(rgba, gain), *corner), NEUTRAL
    return replace(shown, rgba=rgba, gain=gain)


def _out_of_focus(shown: Layer, blur: float, size: tuple[int, int]) -> Layer:
    """A picture px for px, blurred by so many canvas px, on a canvas of that `size`."""
    from objectmorpher_core.compose.light.defocus import blurred_rgba, reach_of

    rim = reach_of(blur)
    x0, y0, x1, y1 = (round(v) for v in shown.box)
    wide = max(x0 - rim, 0), max(y0 - rim, 0), min(x1 + rim, size[0]), min(y1 + rim, size[1])
    around = ((y0 - wide[1], wide[3] - y1), (x0 - wide[0], wide[2] - x1), (0, 0))
    rgba: U8 = np.pad(shown.pixels, np.maximum(around, 0))
    x0, y0, x1, y1 = (float(v) for v in wide)
    return replace(shown, box=(x0, y0, x1, y1), rgba=blurred_rgba(rgba, blur))
