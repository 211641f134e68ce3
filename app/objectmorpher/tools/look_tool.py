"""Walking around the object: it turns, and nothing is changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..editor.view import Orbit
from ..system.texts import t
from .pointer import TURN_SPEED, Button, Pointer, PointerShape, Stroke, has_moved

if TYPE_CHECKING:
    from ..editor.editor import Editor


class LookTool:
    """Drag turns the object, a double click shows the photo again."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        start, first, is_moved = editor.looking.orbit or Orbit(), pointer, False
        if first.clicks == 2:
            editor.looking.reset()
        while (pointer := (yield)).is_down:
            is_moved = is_moved or has_moved(editor, first, pointer)
            if is_moved and first.button is Button.LEFT:
                dx, dy = (pointer.xy - first.xy) / editor.view.scale * TURN_SPEED
                editor.looking.turn(start.turned(-float(dx), float(dy)))

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        return PointerShape.TURN

    def hint(self, editor: Editor) -> str:
        if editor.looking.orbit is not None:
            return t("Drag turns the object · Wheel zooms · Double-click or Esc: the photo")
        return t("Drag to see the object from all sides · Wheel zooms · Hold X for the photo")
