"""A row of choices, one of which is on."""

from __future__ import annotations

from collections.abc import Sequence

from imgui_bundle import ImVec2, imgui

from .theme import FIELD, RADIUS, theme
from .widgets import tooltip


def segments(
    name: str, labels: Sequence[str], chosen: int, reasons: Sequence[str | None] = ()
) -> int:
    """Which of the `labels` is on now; `reasons` say why one cannot be chosen."""
    start, draw = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    width, height = imgui.get_content_region_avail().x, theme.pt(FIELD)
    end = ImVec2(start.x + width, start.y + height)
    draw.add_rect_filled(start, end, theme.u32("raised"), theme.pt(RADIUS))
    for k, label in enumerate(labels):
        reason = reasons[k] if k < len(reasons) else None
        left, right = (round(start.x + width * n / len(labels)) for n in (k, k + 1))
        imgui.set_cursor_screen_pos(ImVec2(left, start.y))
        imgui.begin_disabled(reason is not None)
        if imgui.invisible_button(f"##{name}{k}", ImVec2(right - left, height)):
            chosen = k
        imgui.end_disabled()
        inset = theme.pt(2)
        low = ImVec2(left + inset, start.y + inset)
        high = ImVec2(right - inset, end.y - inset)
        if k == chosen:
            draw.add_rect_filled(low, high, theme.u32("pressed"), theme.pt(RADIUS - 2))
        elif imgui.is_item_hovered():
            draw.add_rect_filled(low, high, theme.u32("hovered"), theme.pt(RADIUS - 2))
        text = imgui.calc_text_size(label)
        at = ImVec2(round((left + right - text.x) / 2), round(start.y + (height - text.y) / 2))
        alpha = 0.45 if reason is not None else 1.0
        role = "text" if k == chosen else "secondary"
        draw.add_text(at, theme.u32(role, alpha), label)
        if reason is not None:
            tooltip(reason)
    imgui.set_cursor_screen_pos(ImVec2(start.x, end.y))
    imgui.dummy(ImVec2(width, 0))
    return chosen
