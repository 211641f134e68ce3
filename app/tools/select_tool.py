"""Choosing the object: clicks that belong to it, clicks that do not, a box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .pointer import Button, Pointer, Shape, Stroke, has_moved

if TYPE_CHECKING:
    from ..editor import Editor

MIN_BOX = 3.0  # image px, either side; a smaller box is a slip


class SelectTool:
    """Left click adds, right click removes, drag draws a box."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        start, is_box = pointer, False
        while (pointer := (yield)).is_down:
            is_box = is_box or has_moved(editor, start, pointer)
            if is_box and start.button is Button.LEFT:
                editor.rubber = (start.x, start.y, pointer.x, pointer.y)
        editor.rubber = None
        if is_box and start.button is Button.LEFT:
            self._choose_box(editor, start, pointer)
        else:
            x, y = editor.view.image_from_canvas(start.xy)
            is_foreground = start.button is Button.LEFT and not start.alt
            editor.selection.add_click(float(x), float(y), is_foreground)

    def _choose_box(self, editor: Editor, start: Pointer, end: Pointer) -> None:
        assert editor.photo_size is not None
        corners = editor.view.image_from_canvas(np.array([start.xy, end.xy]))
        low = np.clip(corners.min(0), 0, editor.photo_size)
        high = np.clip(corners.max(0), 0, editor.photo_size)
        if (high - low).min() >= MIN_BOX:
            editor.selection.set_box((float(low[0]), float(low[1]), float(high[0]), float(high[1])))

    def hover(self, editor: Editor, pointer: Pointer) -> Shape:
        return Shape.CROSS if editor.is_on_photo(pointer.xy) else Shape.ARROW

    def hint(self, editor: Editor) -> str:
        if editor.mask is None and editor.selection.pending is None:
            return "Click an object, or drag a box around it"
        return "Click adds to the selection · Right-click removes from it · Drag draws a new box"
