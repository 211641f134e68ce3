"""A segmented control: one of a few choices, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from imgui_bundle import ImVec2, imgui

from .theme import FIELD, RADIUS, theme
from .widgets import tooltip

T = TypeVar("T")


@dataclass(frozen=True)
class Segment(Generic[T]):
    """One of the choices."""

    value: T
    label: str
    hint: str
    icon: str = ""


def segmented(name: str, segments: tuple[Segment[T], ...], chosen: T) -> T:
    """All choices in a row as wide as the panel; the one that is chosen now."""
    imgui.push_id(name)
    start = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, theme.pt(FIELD)
    draw, radius = imgui.get_window_draw_list(), theme.pt(RADIUS)
    end = ImVec2(start.x + width, start.y + height)
    draw.add_rect_filled(start, end, theme.u32("raised"), radius)
    each = width / len(segments)
    for i, segment in enumerate(segments):
        left, right = round(start.x + i * each), round(start.x + (i + 1) * each)
        imgui.set_cursor_screen_pos(ImVec2(left, start.y))
        if imgui.invisible_button(f"##{i}", ImVec2(right - left, height)):
            chosen = segment.value
        is_chosen, is_hovered = segment.value == chosen, imgui.is_item_hovered()
        tooltip(segment.hint)
        low, high = ImVec2(left, start.y), ImVec2(right, start.y + height)
        if is_chosen or is_hovered:
            draw.add_rect_filled(low, high, theme.u32("accent" if is_chosen else "hovered"), radius)
        text = f"{segment.icon}  {segment.label}" if segment.icon else segment.label
        size = imgui.calc_text_size(text)
        at = ImVec2(round((left + right - size.x) / 2), round(start.y + (height - size.y) / 2))
        draw.add_text(at, theme.u32("on_accent" if is_chosen else "text"), text)
    imgui.pop_id()
    return chosen
