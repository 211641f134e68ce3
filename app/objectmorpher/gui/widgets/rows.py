"""Rows of a list: what lies behind one, where its text stands, and where the next begins."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from .theme import RADIUS, theme

BETWEEN = 2.0  # points from a row to the next


def fill_row(
    start: ImVec2, end: ImVec2, is_current: bool, is_hovered: bool, radius: float = RADIUS
) -> None:
    """Behind a row that is the current one, or under the pointer; corners in screen units."""
    if is_current or is_hovered:
        role = "raised" if is_current else "hovered"
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(start, end, theme.u32(role), theme.pt(radius))


def text_top(start: ImVec2, height: float) -> float:
    """Where a line of the current font is in the middle of a row; screen units."""
    return start.y + (height - imgui.get_font_size()) / 2


def end_row(start: ImVec2, height: float, between: float = BETWEEN) -> None:
    """The next row is below one that began at `start` and is `height` points high."""
    below = start.y + theme.pt(height + between) - imgui.get_style().item_spacing.y
    imgui.set_cursor_screen_pos(ImVec2(start.x, below))
    imgui.dummy(ImVec2(0, 0))
