"""The frame that panels over the window share: title, close button, a place in the middle."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from ....editor.editor import Editor
from ....system.texts import t
from ...widgets.modal import SCROLLING
from ...widgets.theme import FIELD, Icon, theme
from ...widgets.widgets import bold_text, icon_button

PAD = 20.0  # points
LABEL = 132.0  # points, of the names left of the fields
LEAST_AROUND = 48.0  # points of the window that stay visible around it
SHADOW = 18  # points around it that are darker, it stands above the panels
TITLE = 20.0  # ImGui's font size


@contextmanager
def popup(editor: Editor, title: str, width: float, height: float) -> Iterator[None]:
    """A panel of so many points, or less where the window is small; closed by X or Esc."""
    room, around = imgui.get_io().display_size, theme.pt(LEAST_AROUND)
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
    imgui.same_line(theme.pt(LABEL))
