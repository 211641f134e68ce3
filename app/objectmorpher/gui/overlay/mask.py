"""The selection's edge while it is painted, and the brush."""

from __future__ import annotations

from ...tools.mask_tool import erases
from .canvas import Canvas
from .select import draw_edge


def draw_mask(canvas: Canvas) -> None:
    """For the Mask tool. During a stroke the veil alone shows the edge: it is there at once."""
    editor = canvas.editor
    if editor.masking.painting is None:
        draw_edge(canvas)
    if editor.pointer is not None:
        canvas.brush(erases(editor, editor.pointer))
