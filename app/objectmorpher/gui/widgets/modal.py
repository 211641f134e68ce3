"""A box in the middle of the window, over everything else, for one matter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...system.texts import t
from .theme import FIELD, Icon, theme
from .widgets import bold_text, icon_button, note, sought

# The frame that panels over the window share: title, close button, a place in the middle.

PAD = 20.0  # points
LABEL = 132.0  # points, of the names left of the fields
POPUP_AROUND = 48.0  # points of the window that stay visible around it
SHADOW = 18  # points around it that are darker, it stands above the panels
TITLE = 20.0  # ImGui's font size


@contextmanager
def popup(editor: Editor, title: str, width: float, height: float) -> Iterator[None]:
    """A panel of so many points, or less where the window is small; closed by X or Esc."""
    room, around = imgui.get_io().display_size, theme.pt(POPUP_AROUND)
    size = ImVec2(min(theme.pt(width), room.x - around), min(theme.pt(height), room.y - 2 * around))
    centre = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(centre, imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size(size)
    imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(PAD, PAD))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, theme.pt(10))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    imgui.push_style_color(imgui.Col_.border, theme.vec("pressed"))
    flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move
    imgui.begin(f"{title}##popup", None, flags | SCROLLING)
    imgui.pop_style_color()
    imgui.pop_style_var(3)
    _draw_shadow(size)
    with bold_text(TITLE):
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(title)
    imgui.set_cursor_pos(ImVec2(size.x - theme.pt(PAD + FIELD), theme.pt(PAD)))
    if icon_button(Icon.CLOSE, "close", t("Close (Esc)")):
        editor.view.popup = None
    imgui.dummy(theme.size(0, 4))
    yield
    imgui.end()


def _draw_shadow(size: ImVec2) -> None:
    """Around the window that is being drawn: rings, weaker and weaker."""
    draw, low = imgui.get_window_draw_list(), imgui.get_window_pos()
    alpha = imgui.get_style().alpha
    draw.push_clip_rect_full_screen()
    for k in range(1, round(theme.pt(SHADOW)) + 1):
        share = 1 - k / theme.pt(SHADOW)
        start = ImVec2(low.x - k, low.y - k)
        end = ImVec2(low.x + size.x + k, low.y + size.y + k)
        ink = theme.u32("#000000", 0.3 * share**2 * alpha)
        draw.add_rect(start, end, ink, theme.pt(10) + k, thickness=1.5)
    draw.pop_clip_rect()


def label(text: str) -> None:
    """The name of the field that is drawn next."""
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("secondary"), text)
    sought.meet(text)
    imgui.same_line(theme.pt(LABEL))


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
