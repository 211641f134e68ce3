"""One frame in one pass: everything that one picture of the canvas shows, each part computed once.

In order of dependence: the visible objects are posed, then lit, then drawn; from those come the
shadows, and where the canvas shows the edit at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.document.model import Document, Plate

from ..editor.view import Shown, ViewState
from .blend import CELL, build_blend
from .derived import Derived, SurfaceFacts
from .fronts import Fronts, RefinedView
from .layer import CanvasLayer, FrameObject, ObjectPart, PosedObject, is_front
from .layers import FRAME, Layers
from .lights import Lights
from .memo import Memo
from .painter import Painter

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit
    from objectmorpher_core.raster.posed import PosedSplats

OVER_PHOTO = (Shown.COMPOSITE, Shown.PROVENANCE)  # what the export draws, over the photo
UNLIT = (Shown.DEPTH, Shown.NORMALS)  # colours that mean something
BARE = (Shown.OBJECT, *UNLIT)  # views without the photo

Blended = tuple[Document, tuple[object, ...], F32]  # from which document and what else, and it


class Cache:
    """What is computed for the canvas, and remembered from frame to frame by identity."""

    def __init__(self) -> None:
        self.derived = Derived()
        self.facts = SurfaceFacts(self.derived)
        self.painter = Painter(self.derived)
        self.lights, self.layers = Lights(), Layers(self.derived)
        self.fronts, self.refined = Fronts(), RefinedView()
        self.frame_time = FRAME  # s; infinite where only the last frame counts
        self.counted = Memo()  # see `shares.py`
        self.blended: Blended | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether an exact picture or shadow is still to be asked for."""
        return self.lights.is_waiting or self.layers.is_waiting

    def keep(self, document: Document, posed: Callable[[int], PosedSplats]) -> None:
        """Drops what is remembered of objects that are not in `document`.

        `posed` gives an object's Gaussians where the edit has put them.
        """
        lifted = {k for k, o in enumerate(document.objects) if o.lifted}
        self.derived.make_room(len(document.objects))
        self.fronts.make_room(len(document.objects))
        self.derived.forget(lifted)
        self.layers.forget(lifted, posed)
        self.painter.forget(len(document.objects))


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of the canvas; over the photo, or alone where the view is bare."""

    # Back to front; what stays in front of the edit is a picture already.
    objects: tuple[FrameObject | CanvasLayer, ...]
    plate: Plate | None = None  # behind the objects
    shades: tuple[CanvasLayer, ...] = ()  # their shadows
    refined: tuple[CanvasLayer, ...] = ()  # the refinement, over them all
    blend: F32 | None = None  # (h, w) over the canvas: 1 shows the edit, 0 the photo

    @property
    def layers(self) -> tuple[CanvasLayer, ...]:
        """The pictures of the objects, back to front, where the processor has drawn them."""
        pictures = [own if isinstance(own, CanvasLayer) else own.layer for own in self.objects]
        return tuple(layer for layer in pictures if layer is not None)


def build_frame(
    document: Document, view: ViewState, cache: Cache, shown: Shown = Shown.COMPOSITE,
    renderer: str = "tiles",
) -> Frame:  # fmt: skip
    """Compute all that the canvas shows of a document.

    `renderer`: "tiles" draws the objects here, "gl" leaves that to the GPU, which does not know
    what of an object is paint: where paint is marked, it is drawn here, too.
    """
    there: dict[int, PosedObject] = {}

    def posed(k: int) -> PosedSplats:
        if k not in there:
            there[k] = _posed(document, k, cache.derived)
        return there[k].posed

    cache.keep(document, posed)
    parts = _parts(document, shown, posed)
    moved = [k for k, o in enumerate(document.objects) if o.is_moved and o.lifted]
    for k in moved:
        posed(k)
    lit = _lit(document, there, cache, shown)
    objects = tuple(
        _front(document, part.k, view, cache)
        if is_front(document, part.k)
        else _painted(document, there[part.k], part.look, lit, cache)
        for part in parts
    )
    objects = tuple(own for own in objects if own is not None)
    objects = _drawn(document, objects, view, cache, renderer)
    if shown in BARE:
        return Frame(objects)
    shades = cache.lights.layers(lit, view)
    refined = ()
    if shown in OVER_PHOTO:  # the other views show what is below it
        refined = cache.refined.layers(document, view, shown is Shown.PROVENANCE)
    plate = cache.derived.plate(document) if moved else None
    shaded = [look for k, look in lit.items() if look.is_shaded and k not in moved]
    blend = _blend(document, [(there[k], lit[k]) for k in moved], shaded, plate, view, cache)
    return Frame(objects, plate, shades, refined, blend)


def drawn_order(document: Document, shown: Shown, posed: Callable[[int], PosedSplats]) -> list[int]:
    """The visible objects back to front; over the photo only those that the export draws."""
    from objectmorpher_core.compose.order import back_to_front, stack

    objects = document.objects
    if shown in OVER_PHOTO:
        return [k for k in stack(document, posed) if objects[k].is_visible]
    there = {
        k: posed(k)
        for k, o in enumerate(objects)
        if o.lifted is not None and o.is_visible and not is_front(document, k)
    }
    return back_to_front(document, there)


def _parts(
    document: Document, shown: Shown, posed: Callable[[int], PosedSplats]
) -> list[ObjectPart]:
    """What a view is put together from, back to front."""
    order = drawn_order(document, shown, posed)
    if shown is Shown.OBJECT:
        return [ObjectPart(k, Shown.COMPOSITE) for k in order]
    if shown is not Shown.STRAIN:
        return [ObjectPart(k, shown) for k in order]
    parts, drawn = [], drawn_order(document, Shown.COMPOSITE, posed)
    for k in order:  # the tint right over its object, so that nearer ones cover both
        if k in drawn:
            parts.append(ObjectPart(k, Shown.COMPOSITE))
        parts.append(ObjectPart(k, Shown.STRAIN))
    return parts + [ObjectPart(k, Shown.COMPOSITE) for k in drawn if is_front(document, k)]


def _posed(document: Document, k: int, derived: Derived) -> PosedObject:
    item = document.objects[k]
    shape, posed = derived.shape(document.photo, item), derived.posed(document, k)
    draft = derived.draft(document, k) if shape.puppet.has_draft else posed
    return PosedObject(k, item, shape, posed, draft)


def _lit(
    document: Document, there: Mapping[int, PosedObject], cache: Cache, shown: Shown
) -> dict[int, Lit]:
    """The light of each object that is there, in the document's order."""
    from objectmorpher_core.compose.light.lighting import NOTHING

    if shown in UNLIT:
        return dict.fromkeys(there, NOTHING)
    cache.lights.forget(there)
    is_hurried = math.isfinite(cache.frame_time)
    casters = cache.lights.casters(document, there.values())
    return {k: cache.lights.of(document, there[k], is_hurried, casters) for k in sorted(there)}


def _front(document: Document, k: int, view: ViewState, cache: Cache) -> CanvasLayer | None:
    return cache.fronts.layer(document.objects[k], view)


def _painted(
    document: Document, own: PosedObject, look: Shown, lit: Mapping[int, Lit], cache: Cache
) -> FrameObject:
    splats = cache.painter.painted(document, own, look)
    return FrameObject(**vars(own), look=look, lit=lit[own.k], splats=splats)


def _drawn(
    document: Document,
    objects: tuple[FrameObject | CanvasLayer, ...],
    view: ViewState,
    cache: Cache,
    renderer: str,
) -> tuple[FrameObject | CanvasLayer, ...]:
    """The objects with the pictures that are drawn here, in the time that a frame has."""
    missing = [
        own
        for own in objects
        if isinstance(own, FrameObject)
        if renderer == "tiles" or (own.part.is_marked and own.shape.paint is not None)
    ]
    if not missing:
        return objects
    layers = cache.layers.draw(missing, document.photo.camera, view, cache.frame_time)
    return tuple(
        own if isinstance(own, CanvasLayer) else replace(own, layer=layers.get(own.part))
        for own in objects
    )


def _blend(
    document: Document, moved: list[tuple[PosedObject, Lit]], shaded: list[Lit],
    plate: Plate | None, view: ViewState, cache: Cache,
) -> F32:  # fmt: skip
    """Where the canvas shows the edit, remembered; `plate` is the one that it shows.

    `shaded`: what rests, where shadows fall on it.
    """
    looks = [look for _, look in moved] + shaded
    shades = ((look.shade, look.relit if look.is_shaded else None) for look in looks)
    key = (*view.place, *(id(part) for pair in shades for part in pair), *(x.blur for x in looks))
    if cache.blended is None or cache.blended[0] is not document or cache.blended[1] != key:
        mattes = [own.item.matte for own, _ in moved if own.item.matte is not None]
        touched = cache.lights.touched(plate, looks, view, CELL, mattes)
        cache.blended = (document, key, build_blend(document, moved, view, touched))
    return cache.blended[2]
