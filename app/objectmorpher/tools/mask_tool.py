"""Painting the selection: the brush adds, or takes away."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..editor.view import Painted
from ..system.texts import t
from .pointer import Button, Pointer, PointerShape, Stroke, ignore

if TYPE_CHECKING:
    from ..editor.editor import Editor


class MaskTool:
    """Left paints, right or Alt erases; Shift draws a straight line from the last stroke's end."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        is_erasing = erases(editor, pointer)
        if editor.view.selecting.painted is Painted.EDGE:
            is_painting = editor.edging.start_stroke(pointer, is_erasing)
            return _find_edge(editor) if is_painting else ignore()
        if editor.view.selecting.painted is not Painted.SELECTION:
            is_painting = editor.shaping.start_stroke(is_erasing)
            return _shape(editor, pointer) if is_painting else ignore()
        return self._select(editor, pointer, is_erasing)

    def _select(self, editor: Editor, pointer: Pointer, is_erasing: bool) -> Stroke:
        editor.masking.start_stroke(pointer, is_erasing)
        try:
            while (pointer := (yield)).is_down:
                editor.masking.move_stroke(pointer)
            label = t("Erase selection") if is_erasing else t("Paint selection")
            editor.masking.finish_stroke(label)
        finally:
            editor.masking.drop_stroke()

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        return PointerShape.CROSS if editor.is_on_photo(pointer.xy) else PointerShape.ARROW

    def hint(self, editor: Editor) -> str:
        if editor.hand.is_busy:
            return t("Esc cancels the stroke")
        painted = editor.view.selecting.painted
        if painted is Painted.EDGE:
            return t("Drag along the edge to find hair and blur there · Alt restores it · [ ] size")
        if painted is Painted.DEPTH:
            return t("Drag brings nearer · Right-drag or Alt pushes back · [ ] size")
        if painted is Painted.HIDDEN:
            return t("Paint where something hides the object · Right-drag or Alt erases · [ ] size")
        if editor.view.selecting.is_erasing:
            return t("Drag erases · Right-drag or Alt paints · Shift-click draws a line · [ ] size")
        return t("Drag paints · Right-drag or Alt erases · Shift-click draws a line · [ ] size")


def _find_edge(editor: Editor) -> Stroke:
    """A stroke along the edge, which is found anew under it."""
    try:
        while (pointer := (yield)).is_down:
            editor.edging.move_stroke(pointer)
        editor.edging.finish_stroke()
    finally:
        editor.edging.drop_stroke()


def _shape(editor: Editor, pointer: Pointer) -> Stroke:
    """A stroke that tells about the shape."""
    try:
        editor.shaping.paint(pointer.xy)
        while (pointer := (yield)).is_down:
            editor.shaping.paint(pointer.xy)
        editor.shaping.end_stroke()
    finally:  # Esc closes the stroke where it waits
        editor.shaping.drop_stroke()


def erases(editor: Editor, pointer: Pointer) -> bool:
    """Whether a press with these buttons and keys takes away."""
    is_other = pointer.button is Button.RIGHT or pointer.alt
    return is_other != editor.view.selecting.is_erasing
