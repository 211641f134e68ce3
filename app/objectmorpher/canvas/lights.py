"""Shadows, light and grain of the document's objects, remembered; and where repairs are shown.

While something is dragged, a shadow is a coarse one, made in the time that a frame has; once the
pointer rests, it is the one that is exported.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.document.model import Document, Matte, Placement, Plate
from objectmorpher_core.document.settings import AS_IN_THE_PHOTO

from ..editor.view import ViewState
from .layer import CanvasLayer, PosedObject
from .memo import Memo, same

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lighting, Lit
    from objectmorpher_core.compose.shadow.fall import Caster

STILL = 0.12  # s without a change, after which the shadow is the exact one
SEEN = 1 / 255  # of a factor: less is not seen
LOOKED = 500  # Gaussians of an object, that show whether a shadow comes near it
SMALL = 1024  # px, longer side of the picture of what was repaired


@dataclass(eq=False)
class _Kept:
    """What was computed of an object last, and from what."""

    sources: tuple[Any, ...]
    lit: Lit
    since: float  # s, monotonic
    is_sketch: bool
    is_asked: bool = False  # for the exact one
    shade: CanvasLayer | None = None


Casters = Sequence[tuple[PosedObject, "Caster"]]
Ask = Callable[[int, Callable[[], "Lit"], Callable[["Lit"], None]], None]


class Lights:
    """Light and shadow of each moved object."""

    def __init__(self) -> None:
        self._kept: dict[int, _Kept] = {}
        self._lightings, self._painted, self._rests = Memo(), Memo(), Memo()
        self._casters = Memo()
        self.ask: Ask | None = None  # computes an object's elsewhere and calls back

    @property
    def is_waiting(self) -> bool:
        """Whether an exact shadow is still to be asked for."""
        return any(kept.is_sketch and not kept.is_asked for kept in self._kept.values())

    def forget(self, moved: Collection[int]) -> None:
        """Drops what is kept of objects other than these."""
        self._kept = {k: kept for k, kept in self._kept.items() if k in moved}

    def casters(self, document: Document, there: Iterable[PosedObject]) -> Casters:
        """The objects that throw a shadow, each with a sketch of it."""
        lighting, horizon = self._lighting(document), document.horizon
        found = []
        for own in there:
            item = own.item
            if item.is_moved and item.is_visible and item.shadow.strength > 0:
                caster = self._casters(
                    lambda own=own: lighting.caster(own.item, own.draft, horizon, is_sketch=True),
                    own.draft, item.shadow, item.finish.opacity, item.seen_from, horizon, lighting,
                )  # fmt: skip
                if caster is not None:
                    found.append((own, caster))
        self._casters.make_room(len(found))
        return found

    def of(
        self, document: Document, own: PosedObject, is_hurried: bool, casters: Casters = ()
    ) -> Lit:
        """Light and shadow of an object as the window shows them now.

        `is_hurried`: a frame has only so much time, and what is new is a sketch for now.
        `casters`: of the frame's objects, whose shadows may fall on it.
        """
        from objectmorpher_core.compose.light.lighting import NOTHING

        k, item = own.k, own.item
        shares = (item.harmony, item.relight, item.grain, item.defocus)
        has_any = item.shadow.strength or any(shares) or item.finish != AS_IN_THE_PHOTO
        own_points = own.draft.means[:: max(len(own.draft.means) // LOOKED, 1)]
        near = [(o, c) for o, c in casters if o.k == k or c.reaches(own_points)]
        others = [o for o, _ in near if o.k != k]
        if not item.is_visible or not (others or (item.is_moved and has_any)):
            self._kept.pop(k, None)
            return NOTHING
        around = document.plate, document.horizon, document.depth
        sources = (own.posed, item.shadow, item.seen_from, *shares, item.finish, *around)
        for o in others:
            sources += o.posed, o.item.shadow, o.item.finish.opacity, o.item.seen_from
        kept, now = self._kept.get(k), time.monotonic()
        if kept is None or not same(kept.sources, sources):
            lit = self._work(document, own, is_hurried, near)()
            self._kept[k] = _Kept(sources, lit, now, is_hurried)
        elif kept.is_sketch and not kept.is_asked and now - kept.since >= STILL:
            self._make_exact(document, own, kept, near)
        return self._kept[k].lit

    def _make_exact(self, document: Document, own: PosedObject, kept: _Kept, near: Casters) -> None:
        """Replaces what is kept of an object, now or when it is answered."""
        k, kept.is_asked = own.k, True

        def accept(lit: Lit) -> None:
            if self._kept.get(k) is kept:
                self._kept[k] = _Kept(kept.sources, lit, time.monotonic(), False)

        work = self._work(document, own, False, near)
        if self.ask is None:
            accept(work())
        else:
            self.ask(k, work, accept)

    def _work(
        self, document: Document, own: PosedObject, is_sketch: bool, near: Casters
    ) -> Callable[[], Lit]:
        """What computes light and shadow of an object, in any thread."""
        item, puppet, texture = own.item, own.shape.puppet, own.shape.texture
        lighting = self._lighting(document)
        is_coarse = is_sketch and puppet.has_draft
        splats = own.draft if is_coarse else own.posed
        posed = puppet.draft if is_coarse else puppet.posed
        rest = self._rests(lambda: posed(None, Placement()), puppet, is_coarse)
        horizon = document.horizon

        def work() -> Lit:
            casters = [
                (o.k, sketch if is_sketch else lighting.caster(o.item, o.posed, horizon))
                for o, sketch in near
            ]
            told = [(k, caster) for k, caster in casters if caster is not None]
            return lighting.of(item, splats, lambda: rest, horizon, texture, is_sketch, told, own.k)

        return work

    def _lighting(self, document: Document) -> Lighting:
        from objectmorpher_core.compose.light.lighting import Lighting

        has_depth = document.depth is not None
        lifted = (o.mask for o in document.objects if has_depth and o.lifted is not None)
        return self._lightings(
            lambda: Lighting(document), document.photo, document.plate, document.depth, *lifted
        )

    # The picture

    def layers(self, looks: Mapping[int, Lit], view: ViewState) -> tuple[CanvasLayer, ...]:
        """The shadows on the canvas, of objects in these lights."""
        found = []
        for k, look in looks.items():
            if look.shade is None:
                continue
            kept = self._kept[k]
            x0, y0, x1, y1 = look.shade.bounds
            box = view.canvas_box((x0, y0), (x1, y1))
            if kept.shade is None or kept.shade.box != box:
                shade = look.shade
                rgba = kept.shade.rgba if kept.shade else _inked(shade.alpha, shade.colour)
                kept.shade = CanvasLayer(box, rgba, is_coarse=True)
            found.append(kept.shade)
        return tuple(found)

    # Where it is shown

    def touched(
        self,
        plate: Plate | None,
        looks: Iterable[Lit],
        view: ViewState,
        cell: int,
        mattes: Iterable[Matte] = (),
    ) -> F32:
        """(h, w) on a grid of `cell` canvas px: 1 where shadows, repairs or paint are.

        `plate` is the one that the edit shows; None where nothing has moved.
        """
        shape = (-(-view.height // cell), -(-view.width // cell))
        touched = np.zeros(shape, np.float32)
        for look in looks:
            if look.is_shaded and (relit := look.relit) is not None:
                corner, there = (relit.left, relit.top), np.abs(relit.factor) > SEEN
                _mark(touched, there, corner, relit.pitch, (view, cell))
            if (shade := look.shade) is not None:
                corner = (shade.left, shade.top)
                _mark(touched, shade.alpha > 0, corner, shade.pitch, (view, cell))
        if plate is not None and plate.painted is not None:
            small, pitch = self._painted(lambda: _shrunk(plate.painted), plate.painted)
            _mark(touched, small, (plate.left, plate.top), pitch, (view, cell))
        for matte in mattes:
            if matte.paint is not None:
                there = matte.paint.crop(matte.box)[..., 3] > 0
                _mark(touched, there, (matte.left, matte.top), 1.0, (view, cell))
        return touched


def _inked(alpha: F32, colour: tuple[float, float, float]) -> np.ndarray:
    """(h, w, 4) u8, premultiplied."""
    rgba = np.dstack([alpha[..., None] * np.array(colour, np.float32), alpha])
    return (rgba * 255 + 0.5).astype(np.uint8)


def _shrunk(mask: Mask | None) -> tuple[Mask, float]:
    """A mask of at most `SMALL` px, True where any of it is; its px in those of the photo."""
    assert mask is not None
    pitch = max(max(mask.shape) / SMALL, 1.0)
    size = (max(round(mask.shape[1] / pitch), 1), max(round(mask.shape[0] / pitch), 1))
    small = cv2.resize(mask.view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small > 0), pitch


def _mark(
    touched: F32,
    there: Mask,
    corner: tuple[float, float],
    pitch: float,
    grid: tuple[ViewState, int],
) -> None:
    """Sets the cells whose middles are where something is `there`, or close beside it."""
    view, cell = grid
    scale = cell / view.zoom / pitch  # px of the mask for each cell
    near = cv2.dilate(there.astype(np.uint8), np.ones((3, 3), np.uint8))
    if scale > 1:  # a cell is larger than what it looks at
        side = 2 * int(np.ceil(scale / 2)) + 1
        near = cv2.dilate(near, np.ones((side, side), np.uint8))
    left, top = ((view.left - corner[0]) / pitch, (view.top - corner[1]) / pitch)
    matrix = np.array([[scale, 0, left + scale / 2 - 0.5], [0, scale, top + scale / 2 - 0.5]])
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    size = (touched.shape[1], touched.shape[0])
    np.maximum(touched, cv2.warpAffine(near, matrix, size, flags=flags), out=touched)
