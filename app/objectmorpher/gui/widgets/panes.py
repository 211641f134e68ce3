"""The fixed windows that the layout's parts are drawn in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from ..window.layout import Rect
from .theme import theme

TOOLS, INSPECTOR, STATUS, START = "##tools", "##inspector", "##status", "##start"  # their names

FLAGS = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_bring_to_front_on_focus
    | imgui.WindowFlags_.no_nav_focus
    | imgui.WindowFlags_.no_background  # the window is cleared in its colour
)


@contextmanager
def pane(name: str, rect: Rect, padding: tuple[float, float] = (12, 12)) -> Iterator[None]:
    """A part of the window, filled with the panel colour; `padding` in points."""
    imgui.set_next_window_pos(ImVec2(rect.x, rect.y))
    imgui.set_next_window_size(ImVec2(rect.width, rect.height))
    imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(*padding))
    imgui.begin(name, None, FLAGS)
    imgui.pop_style_var()
    yield
    imgui.end()


def edge(start: tuple[float, float], end: tuple[float, float]) -> None:
    """A hairline between two panes, over everything in this window."""
    imgui.get_window_draw_list().add_line(ImVec2(*start), ImVec2(*end), theme.u32("line"), 1.0)
