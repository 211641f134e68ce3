"""Painting on the object: a colour, or what is seen elsewhere in the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F32, crop, unit_pixels
from objectmorpher_core.base.brush import Stroke
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Document, EditObject, Matte, Plate

from ...canvas.layer import CanvasLayer
from ...system.texts import t
from ...worker.requests import JobError
from ..history import CLOCK
from ..view import PaintWith
from .composing import Answers, stroke_tint

if TYPE_CHECKING:
    from objectmorpher_core.raster.posed import PosedSplats

    from ...canvas.shape import CanvasShape
    from ..state import EditorState

PAINT = "paint"  # kind of chores
ERASING = (0xFF, 0xFF, 0xFF)  # a stroke's colour
MIRRORED = 0.3  # of a stroke: then it is said
CLONING = (0x5A, 0xA9, 0xFF)


@dataclass(frozen=True, eq=False)
class _Laid:
    """A stroke, and with what it is painted."""

    stroke: Stroke
    ink: tuple[float, float, float] | None  # sRGB in [0, 1]; None: it erases, or clones
    source: tuple[float, float] | None = None  # image px from a place to what is cloned there
    strength: float = 1.0

    @property
    def is_erasing(self) -> bool:
        return self.ink is None and self.source is None


@dataclass(frozen=True, eq=False)
class _Painted:
    """An object with a stroke."""

    item: EditObject
    shape: CanvasShape
    is_mirrored: bool  # the stroke is on a back that is the front


@dataclass(frozen=True, eq=False)
class _Canvas:
    """What is painted on: an object as the edit has put it, before a background."""

    item: EditObject
    matte: Matte
    shape: CanvasShape
    splats: PosedSplats
    camera: Camera
    document: Document
    plate: Plate | None
    drawn: tuple[tuple[EditObject, PosedSplats | None], ...]  # what is seen over it, back to front

    def painted(self, laid: _Laid) -> _Painted:
        """It with the stroke; this takes a moment."""
        matte, is_mirrored = self._painted(laid)
        if matte.paint is self.matte.paint:
            return _Painted(self.item, self.shape, is_mirrored)
        item = replace(self.item, matte=matte)
        return _Painted(item, self.shape.changed_to(item), is_mirrored)

    def _painted(self, laid: _Laid) -> tuple[Matte, bool]:
        """Its matte with the stroke, and whether that is on a mirrored back."""
        from objectmorpher_core.compose.paint import look, with_stroke, without_stroke

        box = laid.stroke.box
        assert box is not None
        x0, y0, x1, y1 = box
        coverage = laid.stroke.coverage[y0:y1, x0:x1]
        seen = look(self.splats, self.matte, self.camera, box)
        if laid.is_erasing:
            return without_stroke(self.matte, seen, laid.strength * coverage), False
        colour = np.array(laid.ink, np.float32)
        if laid.source is not None:
            colour, is_there = self._picture(box, laid.source)
            coverage = coverage * is_there
        matte = with_stroke(self.matte, seen, coverage, colour, laid.strength)
        return matte, seen.mirrored(coverage) > MIRRORED

    def _picture(
        self, box: tuple[int, int, int, int], aside: tuple[float, float]
    ) -> tuple[F32, np.ndarray]:
        """(h, w, 3) what is seen `aside` of a box, and where (h, w) there is anything."""
        from objectmorpher_core.compose.plate.plate import plate_crop

        dx, dy = (round(v) for v in aside)
        x0, y0, x1, y1 = box[0] + dx, box[1] + dy, box[2] + dx, box[3] + dy
        width, height = self.document.photo.size
        inner = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
        there = np.zeros((y1 - y0, x1 - x0), bool)
        if inner[0] >= inner[2] or inner[1] >= inner[3]:
            return np.zeros((*there.shape, 3), np.float32), there
        photo = self.document.photo.pixels
        below = photo[inner[1] : inner[3], inner[0] : inner[2]]
        if self.plate is not None:
            below = plate_crop(photo, self.plate, inner)
        shown = unit_pixels(below)
        for item, splats in self.drawn:
            color, alpha = self._seen(item, splats, inner)
            shown = color + (1 - alpha[..., None]) * shown
        there[inner[1] - y0 : inner[3] - y0, inner[0] - x0 : inner[2] - x0] = True
        return crop(np.asarray(shown, np.float32), inner, (x0, y0, x1, y1)), there

    def _seen(
        self, item: EditObject, splats: PosedSplats | None, box: tuple[int, int, int, int]
    ) -> tuple[F32, F32]:
        """(h, w, 3) premultiplied and (h, w) alpha of an object in a box, without its light."""
        from objectmorpher_core.compose.light.lighting import object_texture
        from objectmorpher_core.raster import tiles

        matte = item.matte
        assert matte is not None, "what is drawn has a matte"
        if splats is None or not item.is_moved:
            alpha = np.minimum(crop(matte.alpha, matte.box, box), 1.0)
            return alpha[..., None] * crop(matte.foreground, matte.box, box), alpha
        shown = tiles.prepare(splats, self.camera, self.camera)
        drawn = tiles.draw(shown, object_texture(matte, item.lifted), box)
        return drawn.color, drawn.alpha


class Painting:
    """Strokes on the current object."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self._stroke: _Laid | None = None  # being painted
        self._waiting: list[tuple[int, _Laid]] = []  # on which object; the first is worked on
        self.newest = 0  # number of the last one, as of the history's steps
        self._aside: tuple[float, float] | None = None  # image px from the brush to its source
        self._answers = Answers(editor)

    def forget(self) -> None:
        """Another document is opened."""
        self._stroke, self._waiting, self._aside = None, [], None
        self._answers.forget()
        self._editor.view.compose.source = None

    def toggle(self) -> None:
        """Dragging paints on the object, or not any more."""
        view = self._editor.view.compose
        view.is_painting, view.is_bare = not view.is_painting, False

    def pick(self, canvas_xy: np.ndarray) -> None:
        """The colour under the pointer is painted with, or what is there is cloned."""
        editor, view = self._editor, self._editor.view
        x, y = (float(v) for v in view.image_from_canvas(canvas_xy))
        if not editor.is_on_photo(canvas_xy) or (canvas := self._canvas(editor.current)) is None:
            return
        if view.compose.paint_with is PaintWith.CLONE:
            view.compose.source, self._aside = (x, y), None
            return
        box = int(x), int(y), int(x) + 1, int(y) + 1
        r, g, b = (float(v) for v in canvas._picture(box, (0.0, 0.0))[0][0, 0].clip(0, 1))
        view.compose.ink = r, g, b

    def start_stroke(self, canvas_xy: np.ndarray, is_erasing: bool) -> bool:
        """The brush is put down; False where there is nothing to paint with, or on."""
        editor, view = self._editor, self._editor.view
        if editor.document is None or not editor.is_lifted or editor.object is None:
            editor.say(editor.why_no_shape)
            return False
        if editor.object.is_locked:
            editor.say_locked(editor.current)
            return False
        ink, source = None if is_erasing else view.compose.ink, None
        if not is_erasing and view.compose.paint_with is PaintWith.CLONE:
            if view.compose.source is None:
                editor.say(t("Ctrl-click first where to clone from"))
                return False
            x, y = view.image_from_canvas(canvas_xy)
            u, v = view.compose.source
            self._aside = self._aside or (u - float(x), v - float(y))
            ink, source = None, self._aside
        stroke = Stroke(editor.document.photo.size, view.brush)
        self._stroke = _Laid(stroke, ink, source, view.compose.strength)
        return True

    def paint(self, canvas_xy: np.ndarray) -> None:
        if self._stroke is not None:
            x, y = self._editor.view.image_from_canvas(canvas_xy)
            self._stroke.stroke.move_to(float(x), float(y))

    def drop_stroke(self) -> None:
        self._stroke = None

    def end_stroke(self) -> None:
        """What was painted sticks to what is seen there; one step."""
        laid, self._stroke = self._stroke, None
        if laid is None or laid.stroke.box is None:
            return
        x0, y0, x1, y1 = laid.stroke.box
        if not laid.stroke.coverage[y0:y1, x0:x1].any():
            return
        self._waiting.append((self._editor.current, laid))
        self.newest = next(CLOCK)
        if len(self._waiting) == 1:
            self._lay()

    @property
    def undo_label(self) -> str | None:
        """Of the last stroke that is not on the object yet; None: there is none."""
        return _label(self._waiting[-1][1]) if self._waiting else None

    def take_back(self) -> None:
        """Forget that stroke."""
        self._waiting.pop()
        if not self._waiting:
            self._editor.chores.cancel(PAINT)
            self._answers.forget()

    def remove(self) -> None:
        """The current object without any paint; one step."""
        editor, document = self._editor, self._editor.committed
        item = None if document is None else document.objects[editor.current]
        if document is not None and item is not None and item.matte is not None and item.is_painted:
            item = replace(item, matte=replace(item.matte, paint=None))
            editor.apply(t("Remove paint"), document.with_object(editor.current, item))

    def deliver(self) -> bool:
        """Takes in what was painted, between strokes; once a frame."""
        return self._answers.deliver()

    @property
    def source(self) -> tuple[float, float] | None:
        """Image px from where is cloned; None where a colour is painted."""
        view = self._editor.view.compose
        return view.source if view.paint_with is PaintWith.CLONE else None

    @property
    def is_busy(self) -> bool:
        """Whether a stroke is not on the object yet."""
        return bool(self._waiting)

    def _canvas(self, k: int) -> _Canvas | None:
        from objectmorpher_core.compose.order import stack

        editor, document = self._editor, self._editor.committed
        if document is None or k >= len(document.objects):
            return None
        item = document.objects[k]
        if item.lifted is None or item.matte is None:
            return None
        shape, splats = (
            editor.derived.shape(document.photo, item),
            editor.derived.posed(document, k),
        )
        is_edited = any(each.is_moved for each in document.objects)
        plate = editor.derived.plate(document) if is_edited else None
        objects, there = document.objects, stack(document, partial(editor.derived.posed, document))
        drawn = tuple((objects[j], own) for j, own in there.items() if objects[j].is_visible)
        return _Canvas(
            item, item.matte, shape, splats, document.photo.camera, document, plate, drawn
        )

    def _lay(self) -> None:
        """The first stroke that waits, on the object as it is now."""
        k, laid = self._waiting[0]
        if (canvas := self._canvas(k)) is None:
            self._waiting = []
            return

        def work(progress: Progress) -> _Painted:
            return canvas.painted(laid)

        def accept(answer: _Painted) -> None:
            self._answers.add(lambda: self._take(k, laid, canvas.item, answer))

        def drop() -> None:
            self._waiting = []

        def fail(error: JobError) -> None:
            drop()
            self._editor.complain_of(error)

        self._editor.chores.start(
            t("Painting"), work, kind=PAINT, done=accept, failed=fail, cancelled=drop,
            is_quiet=True,
        )  # fmt: skip

    def _take(self, k: int, laid: _Laid, asked: EditObject, answer: _Painted) -> None:
        """The paint; dropped where the object is another one by now."""
        editor, document = self._editor, self._editor.committed
        self._waiting = self._waiting[1:]
        now = document.objects[k] if document and k < len(document.objects) else None
        if document is not None and now is asked:
            if answer.item is asked:
                editor.say(t("There is nothing of {name} to paint on", name=asked.name))
            else:
                editor.derived.remember(answer.item, answer.shape)
                editor.apply(_label(laid), document.with_object(k, answer.item))
                if answer.is_mirrored:
                    editor.say(t("This back is the front mirrored: both are painted"))
        if self._waiting:
            self.newest = next(CLOCK)
            self._lay()

    def painted_layer(self) -> CanvasLayer | None:
        """Return what is painted and not on the object yet, as a tint over the canvas."""
        laid = [one for _, one in self._waiting]
        laid += [] if self._stroke is None else [self._stroke]
        if not laid:
            return None
        last = laid[-1]
        ink = ERASING if last.is_erasing else CLONING
        if last.ink is not None:
            r, g, b = (round(255 * v) for v in last.ink)
            ink = r, g, b
        return stroke_tint(self._editor.view, [one.stroke for one in laid], ink)


def _label(laid: _Laid) -> str:
    """Of the step that lays it."""
    return t("Erase paint") if laid.is_erasing else t("Paint on the object")
