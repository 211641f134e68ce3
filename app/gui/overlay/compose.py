"""For the Compose tool: the brush, and that the background is shown alone."""

from __future__ import annotations

from ...texts import t
from ..theme import theme
from .canvas import Canvas


def draw_compose(canvas: Canvas) -> None:
    """What the Compose tool shows over the photo."""
    editor = canvas.editor
    if not editor.view.compose.is_bare:
        return
    text = editor.composing.trouble or t("Background alone")
    if editor.composing.is_repairing:
        text = t("Repairing…")
    x = canvas.rect.x + canvas.rect.width / 2
    canvas.label(text, x, canvas.rect.y + theme.pt(12), side=0.5)
    if editor.pointer is not None and editor.is_on_photo(editor.pointer.xy):
        canvas.brush()
