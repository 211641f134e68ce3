"""Painting on the background: what is wrong is filled in anew, or is the photo's again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..editor.view import Composed
from ..system.texts import t
from .pointer import Button, Pointer, PointerShape, Stroke, ignore

if TYPE_CHECKING:
    from ..editor.editor import Editor


class ComposeTool:
    """While the background is shown alone: left repairs it, right or Alt restores the photo.

    Or left drags from where it is to be taken to where it is wanted, right or Alt forgets that.
    """

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        is_other = pointer.alt or pointer.button is Button.RIGHT
        if not editor.view.compose.is_bare:
            editor.say(t("Press B to see the background alone, then paint on it"))
            return ignore()
        if editor.view.compose.drag is Composed.TAKE:
            if is_other:
                editor.hinting.remove_at(pointer.xy)
                return ignore()
            return self._take(editor) if editor.hinting.start(pointer.xy) else ignore()
        if not editor.composing.start_stroke(is_other):
            return ignore()
        return self._paint(editor, pointer)

    def _take(self, editor: Editor) -> Stroke:
        try:
            while (pointer := (yield)).is_down:
                editor.hinting.move_to(pointer.xy)
            editor.hinting.finish()
        finally:
            editor.hinting.drop()

    def _paint(self, editor: Editor, pointer: Pointer) -> Stroke:
        try:
            editor.composing.paint(pointer.xy)
            while (pointer := (yield)).is_down:
                editor.composing.paint(pointer.xy)
            editor.composing.end_stroke()
        finally:  # Esc closes the stroke where it waits
            editor.composing.drop_stroke()

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        is_painting = editor.view.compose.is_bare and editor.is_on_photo(pointer.xy)
        return PointerShape.CROSS if is_painting else PointerShape.ARROW

    def hint(self, editor: Editor) -> str:
        if not editor.view.compose.is_bare:
            return t("B shows the background alone, to repair it by painting")
        if editor.view.compose.drag is Composed.TAKE:
            if editor.hand.is_busy:
                return t("Let go where you want it · Esc cancels")
            return t(
                "Drag from a good spot to where you want it · Alt-click removes an arrow · [ ] size"
            )
        if editor.hand.is_busy:
            return t("Let go to fill in what you painted · Esc cancels")
        return t("Paint what to fill in again · Alt-paint brings the photo back · [ ] brush size")
