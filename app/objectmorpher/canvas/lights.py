"""Shadows, light and grain of the document's objects, remembered; and where repairs are shown.

While something is dragged, a shadow is a coarse one, made in the time that a frame has; once the
pointer rests, it is the one that is exported.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.document.model import Document, Placement

from ..editor.view import View
from .layers import Layer
from .memo import Memo, same

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lighting, Lit
    from objectmorpher_core.document.settings import Shadow

    from .derived import Derived

STILL = 0.12  # s without a change, after which the shadow is the exact one
SMALL = 1024  # px, longer side of the picture of what was repaired


@dataclass(eq=False)
class _Kept:
    """What was computed of an object last, and from what."""

    sources: tuple[Any, ...]
    lit: Lit
    since: float  # s, monotonic
    is_sketch: bool
    is_asked: bool = False  # for the exact one
    shade: Layer | None = None


Ask = Callable[[int, Callable[[], "Lit"], Callable[["Lit"], None]], None]


class Lights:
    """Light and shadow of each moved object."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._kept: dict[int, _Kept] = {}
        self._lightings, self._painted = Memo(), Memo()
        self._hidden, self._rests = Memo(), Memo()
        self.ask: Ask | None = None  # computes an object's elsewhere and calls back

    @property
    def _is_hurried(self) -> bool:
        """Whether a frame has only so much time."""
        return bool(np.isfinite(self._derived.layers.frame_time))

    @property
    def is_waiting(self) -> bool:
        """Whether an exact shadow is still to be asked for."""
        return any(kept.is_sketch and not kept.is_asked for kept in self._kept.values())

    def of(self, document: Document, k: int) -> Lit:
        """Object `k`'s light and shadow as the window shows them now."""
        from objectmorpher_core.compose.light.lighting import NOTHING

        item = document.objects[k]
        shares = (item.harmony, item.relight, item.grain, item.defocus)
        has_any = item.shadow.strength or any(shares)
        if not item.is_moved or not item.is_visible or not has_any:
            self._kept.pop(k, None)
            return NOTHING
        splats, now = self._derived.posed(document, k), time.monotonic()
        sources = (splats, item.shadow, *shares, document.plate, document.horizon)
        kept = self._kept.get(k)
        if kept is None or not same(kept.sources, sources):
            lit = self._work(document, k, self._is_hurried)()
            kept = self._kept[k] = _Kept(sources, lit, now, self._is_hurried)
        elif kept.is_sketch and not kept.is_asked and now - kept.since >= STILL:
            self._make_exact(document, k, kept)
        return self._kept[k].lit

    def _make_exact(self, document: Document, k: int, kept: _Kept) -> None:
        """Replaces what is kept of object `k`, now or when it is answered."""
        kept.is_asked = True

        def accept(lit: Lit) -> None:
            if self._kept.get(k) is kept:
                self._kept[k] = _Kept(kept.sources, lit, time.monotonic(), False)

        work = self._work(document, k, is_sketch=False)
        if self.ask is None:
            accept(work())
        else:
            self.ask(k, work, accept)

    def _work(self, document: Document, k: int, is_sketch: bool) -> Callable[[], Lit]:
        """What computes object `k`'s light and shadow, in any thread."""
        item, derived = document.objects[k], self._derived
        shape, lighting = derived.shape(document.photo, item), self._lighting(document)
        puppet = shape.puppet
        is_coarse = is_sketch and puppet.has_draft
        splats = (derived.draft if is_coarse else derived.posed)(document, k)
        posed = puppet.draft if is_coarse else puppet.posed
        rest = self._rests(lambda: posed(None, Placement()), puppet, is_coarse)
        return lambda: lighting.of(
            item, splats, lambda: rest, document.horizon, shape.texture, is_sketch
        )

    def _lighting(self, document: Document) -> Lighting:
        from objectmorpher_core.compose.light.lighting import Lighting

        return self._lightings(lambda: Lighting(document), document.photo, document.plate)

    # The picture

    def state(self, document: Document) -> tuple[float, ...]:
        """Changes where a shadow or a blur does."""
        looks = [self.of(document, k) for k in range(len(document.objects))]
        return (*(id(look.shade) for look in looks), *(look.blur for look in looks))

    def layers(self, document: Document, view: View) -> tuple[Layer, ...]:
        """The shadows on the canvas."""
        found = []
        self._kept = {k: kept for k, kept in self._kept.items() if k < len(document.objects)}
        for k in range(len(document.objects)):
            shade = self.of(document, k).shade
            if shade is None:
                continue
            kept = self._kept[k]
            x0, y0, x1, y1 = shade.bounds
            low = view.canvas_from_image(np.array([x0, y0]))
            high = view.canvas_from_image(np.array([x1, y1]))
            box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
            if kept.shade is None or kept.shade.box != box:
                rgba = kept.shade.rgba if kept.shade else _inked(shade.alpha, shade.colour)
                kept.shade = Layer(box, rgba, is_coarse=True)
            found.append(kept.shade)
        return tuple(found)

    def ground(self, document: Document, k: int, shadow: Shadow) -> float:
        """From how many degrees above the ground one looks at object `k` on it."""
        from objectmorpher_core.compose.light.lighting import ground_seen_from

        lifted = document.objects[k].lifted
        assert lifted is not None
        return ground_seen_from(lifted, document.photo.camera, document.horizon, shadow)

    def hidden(self, document: Document) -> Mask:
        """(H, W) what the objects hide."""
        from objectmorpher_core.compose.plate.plate import plate_cover

        return self._hidden(lambda: plate_cover(document), *(o.matte for o in document.objects))

    # Where it is shown

    def touched(self, document: Document, view: View, cell: int) -> F32:
        """(h, w) on a grid of `cell` canvas px: 1 where shadows or repairs are."""
        shape = (-(-view.height // cell), -(-view.width // cell))
        touched = np.zeros(shape, np.float32)
        for k in range(len(document.objects)):
            if (shade := self.of(document, k).shade) is not None:
                corner = (shade.left, shade.top)
                _mark(touched, shade.alpha > 0, corner, shade.pitch, (view, cell))
        plate = self._derived.plate(document) if _is_edited(document) else None
        if plate is not None and plate.painted is not None:
            small, pitch = self._painted(lambda: _shrunk(plate.painted), plate.painted)
            _mark(touched, small, (plate.left, plate.top), pitch, (view, cell))
        return touched


def _is_edited(document: Document) -> bool:
    return any(o.is_moved for o in document.objects)


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
    touched: F32, there: Mask, corner: tuple[float, float], pitch: float, grid: tuple[View, int]
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
