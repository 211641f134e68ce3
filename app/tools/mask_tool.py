"""The Mask tool."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .pointer import Pointer, Shape, Stroke

if TYPE_CHECKING:
    from ..editor import Editor


class MaskTool:
    """Not there yet."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        while (yield).is_down:
            pass

    def hover(self, editor: Editor, pointer: Pointer) -> Shape:
        return Shape.ARROW

    def hint(self, editor: Editor) -> str:
        return ""
