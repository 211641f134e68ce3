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

_is_unfolded = False  # whether a list was unfolded in the box that was drawn last


def is_dismissed() -> bool:
    """Whether Esc closes the box. A list that is unfolded in it takes the key for itself."""
    return imgui.is_key_pressed(imgui.Key.escape) and not _is_unfolded and not _has_list()


def is_confirmed() -> bool:
    """Whether Enter presses the box's first button: the keyboard has chosen no other one."""
    if imgui.get_io().nav_visible or imgui.is_any_item_active():
        return False
    if imgui.is_window_appearing():  # the key that opened it is still down
        return False
    return any(
        imgui.is_key_pressed(key, False) for key in (imgui.Key.enter, imgui.Key.keypad_enter)
    )


def _has_list() -> bool:
    return imgui.is_popup_open("", imgui.PopupFlags_.any_popup_id)


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
        global _is_unfolded
        _is_unfolded = _has_list()
        imgui.end_popup()
