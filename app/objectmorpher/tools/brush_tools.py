"""Tools with a brush: it adds to the selection, or repairs the background, or takes either back."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Protocol

from objectmorpher_core.base.arrays import F64

from ..editor.view import Composed, Painted, PaintWith
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
            edge = editor.edging
            dragged = _dragged(edge.move_stroke, edge.finish_stroke, edge.drop_stroke)
            return dragged if is_painting else ignore()
        if editor.view.selecting.painted is not Painted.SELECTION:
            is_painting = editor.shaping.start_stroke(is_erasing)
            return _paint(editor.shaping, pointer) if is_painting else ignore()
        return self._select(editor, pointer, is_erasing)

    def _select(self, editor: Editor, pointer: Pointer, is_erasing: bool) -> Stroke:
        mask, label = editor.masking, t("Erase selection") if is_erasing else t("Paint selection")
        mask.start_stroke(pointer, is_erasing)
        yield from _dragged(mask.move_stroke, partial(mask.finish_stroke, label), mask.drop_stroke)

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


def _dragged(
    move: Callable[[Pointer], None], end: Callable[[], None], drop: Callable[[], None]
) -> Stroke:
    """A stroke that goes with the pointer until the button is up."""
    try:
        while (pointer := (yield)).is_down:
            move(pointer)
        end()
    finally:  # Esc closes the stroke where it waits
        drop()


class _Painted(Protocol):
    """What a brush paints on, after a stroke has begun there."""

    def paint(self, xy: F64, /) -> None: ...

    def end_stroke(self) -> None: ...

    def drop_stroke(self) -> None: ...


def _paint(painted: _Painted, pointer: Pointer) -> Stroke:
    painted.paint(pointer.xy)
    yield from _dragged(lambda p: painted.paint(p.xy), painted.end_stroke, painted.drop_stroke)


def erases(editor: Editor, pointer: Pointer) -> bool:
    """Whether a press with these buttons and keys takes away."""
    is_other = pointer.button is Button.RIGHT or pointer.alt
    return is_other != editor.view.selecting.is_erasing


class ComposeTool:
    """While one paints on the object: left paints, right or Alt erases, Ctrl says with what.

    While the background is shown alone: left repairs it, right or Alt restores the photo.

    Or left drags from where it is to be taken to where it is wanted, right or Alt forgets that.
    """

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        is_other = pointer.alt or pointer.button is Button.RIGHT
        if editor.view.compose.is_painting:
            if pointer.ctrl:
                editor.painting.pick(pointer.xy)
                return ignore()
            is_begun = editor.painting.start_stroke(pointer.xy, is_other)
            return _paint(editor.painting, pointer) if is_begun else ignore()
        if not editor.view.compose.is_bare:
            editor.say(t("Press B to see the background alone, then paint on it"))
            return ignore()
        if editor.view.compose.drag is Composed.TAKE:
            if is_other:
                editor.hinting.remove_at(pointer.xy)
                return ignore()
            hint = editor.hinting
            dragged = _dragged(lambda p: hint.move_to(p.xy), hint.finish, hint.drop)
            return dragged if hint.start(pointer.xy) else ignore()
        if not editor.composing.start_stroke(is_other):
            return ignore()
        return _paint(editor.composing, pointer)

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        view = editor.view.compose
        is_painting = (view.is_bare or view.is_painting) and editor.is_on_photo(pointer.xy)
        return PointerShape.CROSS if is_painting else PointerShape.ARROW

    def hint(self, editor: Editor) -> str:
        if editor.view.compose.is_painting:
            if editor.hand.is_busy:
                return t("Esc cancels the stroke")
            if editor.view.compose.paint_with is PaintWith.CLONE:
                return t("Ctrl-click where to clone from, then drag · Alt-drag erases · [ ] size")
            return t("Drag paints · Alt-drag erases · Ctrl-click takes a colour · [ ] size")
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
