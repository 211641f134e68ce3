"""Choosing the object: clicks that belong to it and clicks that do not, a box, a line around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.segment import UNSURE

from ..editor.tasks import Combine
from ..editor.view import Hover, SelectMode
from ..system.texts import t
from .pointer import Button, Pointer, PointerShape, Stroke, draw_box, ignore

if TYPE_CHECKING:
    from ..editor.editor import Editor

MIN_BOX = 3.0  # image px, either side; a smaller box is a slip
STEP = 1.5  # points between two places of a line that is drawn


def _is_on_visitor(editor: Editor, pointer: Pointer) -> bool:
    """Whether the pointer is on an object of another photo, which is chosen and said then."""
    seen, document = editor.landing.moved_at(pointer.xy), editor.document
    if seen is None or document is None or not document.objects[seen].is_visitor:
        return False
    editor.objects.take(seen)
    editor.say_visitor(document.objects[seen])
    return True


class SelectTool:
    """Left click adds, right or Alt removes, drag draws a box or, in Lasso mode, a line."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        if _is_on_visitor(editor, pointer):
            return ignore()
        if editor.object is not None and editor.object.is_visitor:  # there is nothing to correct
            editor.objects.start_another()
        if pointer.button is Button.RIGHT:
            return self._remove_click(editor, pointer)
        if editor.view.selecting.mode is SelectMode.LASSO:
            return self._lasso(editor, pointer)
        return self._click_or_box(editor, pointer)

    def _click_or_box(self, editor: Editor, start: Pointer) -> Stroke:
        end = yield from draw_box(editor, start)
        if end is not None:
            self._choose_box(editor, start, end)
        else:
            self._click(editor, start, is_foreground=not start.alt)

    def _remove_click(self, editor: Editor, start: Pointer) -> Stroke:
        yield from ignore()
        self._click(editor, start, is_foreground=False)

    def _click(self, editor: Editor, pointer: Pointer, is_foreground: bool) -> None:
        other = editor.landing.moved_at(pointer.xy)
        if other is not None and other != editor.current:
            if editor.opened.objects[other].is_locked:
                editor.say_locked(other)
            else:
                editor.objects.take_up(other)
            return
        if (left := editor.landing.left_at(pointer.xy)) is not None:
            editor.say_left(left)
            return
        x, y = editor.landing.in_photo(pointer.xy)
        editor.selection.add_click(float(x), float(y), is_foreground)

    def _choose_box(self, editor: Editor, start: Pointer, end: Pointer) -> None:
        assert editor.photo_size is not None
        corners = editor.view.image_from_canvas(np.array([start.xy, end.xy]))
        low = np.clip(corners.min(0), 0, editor.photo_size)
        high = np.clip(corners.max(0), 0, editor.photo_size)
        if (high - low).min() >= MIN_BOX:
            box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
            editor.selection.set_box(box, _combine(start))

    def _lasso(self, editor: Editor, pointer: Pointer) -> Stroke:
        start, path = pointer, [pointer.xy]
        editor.selection.path = path
        try:
            while (pointer := (yield)).is_down:
                if np.hypot(*(pointer.xy - path[-1])) >= STEP * editor.view.scale:
                    path.append(pointer.xy)
        finally:
            editor.selection.path = None
        if len(path) == 1:
            self._click(editor, start, is_foreground=not start.alt)
            return
        outline = editor.view.image_from_canvas(np.array(path))
        if np.ptp(outline, axis=0).min() >= MIN_BOX:
            editor.selection.set_outline(outline, _combine(start))

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        is_on_photo = editor.is_on_photo(pointer.xy)
        x, y = editor.view.image_from_canvas(pointer.xy)
        other = editor.landing.moved_at(pointer.xy)
        is_place = is_on_photo and other is None and editor.landing.left_at(pointer.xy) is None
        editor.hover = Hover(place=(float(x), float(y)) if is_place else None,
                             other=None if other == editor.current else other)  # fmt: skip
        if editor.hover.other is not None:
            return PointerShape.HAND
        return PointerShape.CROSS if is_on_photo else PointerShape.ARROW

    def hint(self, editor: Editor) -> str:
        if editor.hand.is_busy:
            return t("Esc takes it back")
        if editor.mask is None and editor.selection.pending is None:
            return _BEGIN[editor.view.selecting.mode]()
        sure = editor.selection.confidence
        share = f"{100 * sure:.0f}" if sure is not None else ""
        if sure is not None and sure < UNSURE:
            return t("Only {share} % sure: click what is missing, right-click what is too much, "
                     "or drag a box around it", share=share)  # fmt: skip
        hint = _GO_ON[editor.view.selecting.mode]()
        return t("Selected, {share} % sure", share=share) + " · " + hint if share else hint


def _combine(pointer: Pointer) -> Combine:
    """What a drag that began so does to the selection that is there."""
    if pointer.alt:
        return Combine.REMOVED
    return Combine.ADDED if pointer.shift else Combine.ANEW


_BEGIN = {
    SelectMode.CLICK: lambda: t("Click an object, or drag a box around it"),
    SelectMode.BOX: lambda: t("Drag a box around an object, or click it"),
    SelectMode.LASSO: lambda: t("Drag around the object"),
}
_GO_ON = {
    SelectMode.CLICK: lambda: t(
        "Click adds · Right-click removes · Click again: part, object, group · Drag: a new box"
    ),
    SelectMode.BOX: lambda: t(
        "Drag: a new box · Shift-drag adds what is in it · Alt-drag takes that away · "
        "Click adds · Right-click removes"
    ),
    SelectMode.LASSO: lambda: t(
        "Drag around: a new selection · Shift adds to it · Alt removes from it"
    ),
}
