"""Choosing one of a few: buttons side by side, the chosen one filled."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from .theme import FIELD, theme
from .widgets import tooltip

GAP = 2.0  # points between two of them


def segmented(name: str, labels: list[str], chosen: int, hints: list[str] | None = None) -> int:
    """A row as wide as the panel; the index of what is chosen now, -1 for none."""
    width = imgui.get_content_region_avail().x
    gap = theme.pt(GAP)
    each = (width - gap * (len(labels) - 1)) / len(labels)
    left = imgui.get_cursor_pos_x()
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    for i, label in enumerate(labels):
        if i:
            imgui.same_line(0, 0)
            imgui.set_cursor_pos_x(round(left + i * (each + gap)))
        roles = ("accent", "accent_hovered", "accent", "on_accent")
        if i != chosen:
            roles = ("raised", "hovered", "pressed", "text")
        columns = ("button", "button_hovered", "button_active", "text")
        for column, role in zip(columns, roles, strict=True):
            imgui.push_style_color(getattr(imgui.Col_, column), theme.vec(role))
        end = round(left + (i + 1) * (each + gap)) - gap
        size = ImVec2(end - imgui.get_cursor_pos_x(), theme.pt(FIELD))
        is_pressed = imgui.button(f"{label}##{name}{i}", size)
        imgui.pop_style_color(len(columns))
        if hints is not None:
            tooltip(hints[i])
        if is_pressed:
            chosen = i
    imgui.pop_style_var()
    return chosen
