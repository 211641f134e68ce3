"""The object under the pointer that a click would make the current one."""

from __future__ import annotations

from .canvas import WHITE, Canvas


def draw_other(canvas: Canvas) -> None:
    """A dashed box around it, and its name."""
    editor, other = canvas.editor, canvas.editor.hover.other
    document = editor.document
    if other is None or document is None or editor.hand.is_busy or other >= len(document.objects):
        return
    if document.objects[other].lifted is None:
        return
    corners = canvas.at(editor.derived.frame(document, other).corners)
    canvas.dashes(corners, WHITE)
    canvas.label(document.objects[other].name, corners[3].x, corners[3].y)
