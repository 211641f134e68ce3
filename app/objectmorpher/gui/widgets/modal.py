"""A box in the middle of the window, over everything else, for one matter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from .theme import theme
from .widgets import bold_text, note

PADDING = 20.0  # points
LEAST_AROUND = 8.0  # points of the window above and below, and at the sides
SCROLLING = (  # no frame but a scroll bar, where large texts need more than there is room for
    imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_collapse
)


@contextmanager
def modal(title: str, width: float, about: str = "", height: float = 0.0) -> Iterator[bool]:
    """Opens it and yields whether it is drawn. What is inside closes it.

    `width` and `height` in points, 0 as much as it needs. The title doubles as its id.
    """
    if not imgui.is_popup_open(title):
        imgui.open_popup(title)
    centre = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(centre, imgui.Cond_.always, ImVec2(0.5, 0.5))
    display, around = imgui.get_io().display_size, theme.pt(2 * LEAST_AROUND)
    room = ImVec2(max(display.x - around, 1.0), max(display.y - around, 1.0))
    imgui.set_next_window_size_constraints(ImVec2(1.0, 1.0), room)
    imgui.set_next_window_size(theme.size(width, height))
    imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(PADDING, PADDING))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, theme.pt(10))
    flags = SCROLLING | imgui.WindowFlags_.no_saved_settings
    is_shown = imgui.begin_popup_modal(title, None, flags)[0]
    imgui.pop_style_var(2)
    if is_shown:
        with bold_text():
            imgui.text_unformatted(title)
        if about:
            note(about)
        imgui.dummy(theme.size(0, 4))
    yield is_shown
    if is_shown:
        imgui.end_popup()
