"""Before and after."""

from __future__ import annotations

from imgui_bundle import ImVec2

from ...texts import t
from ..theme import theme
from .canvas import DARK, WHITE, Canvas


def draw_comparison(canvas: Canvas) -> None:
    """The line between before and after, or what else than the edit alone is shown."""
    view, rect = canvas.editor.view, canvas.rect
    top = rect.y + theme.pt(12)
    if view.is_before or view.split is None:
        canvas.label(canvas.editor.looking.badge, rect.x + theme.pt(12), top)
        return
    x = rect.x + view.split * rect.width
    high, low = ImVec2(x, rect.y), ImVec2(x, rect.y + rect.height)
    canvas.line(high, low, WHITE, width=2, alpha=1.0)
    grip = ImVec2(x, rect.y + rect.height / 2)
    canvas.draw.add_circle_filled(grip, theme.pt(9), theme.u32(DARK, 0.7))
    canvas.draw.add_circle_filled(grip, theme.pt(7), theme.u32(WHITE))
    canvas.label(t("Before"), x - theme.pt(12), top, side=1.0)
    canvas.label(t("After"), x + theme.pt(12), top)
