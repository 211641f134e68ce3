"""The places of the window's parts, and the fixed windows that they are drawn in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from imgui_bundle import ImVec2, imgui

from .theme import FOLDED, MENU, STRIP, theme
from .theme import INSPECTOR as PANEL_WIDTH
from .theme import STATUS as STATUS_HEIGHT
from .theme import TABS as TABS_HEIGHT


@dataclass(frozen=True)
class Rect:
    """Window units: x right, y down."""

    x: float
    y: float
    width: float
    height: float

    def contains(self, x: float, y: float) -> bool:
        return self.x <= x < self.x + self.width and self.y <= y < self.y + self.height


@dataclass(frozen=True)
class Layout:
    """The parts of the window; with no photo the canvas is all between menu and status."""

    menu: Rect
    tabs: Rect
    strip: Rect
    canvas: Rect
    inspector: Rect
    status: Rect


NARROW = 1000.0  # points of the window's width, below which the panel is folded up by itself


def has_panel(width: float, wanted: bool | None) -> bool:
    """Whether the panel is unfolded in a window `width` window units wide; see `View`."""
    return width >= theme.pt(NARROW) if wanted is None else wanted


def lay_out(
    width: float, height: float, has_photo: bool, has_panel: bool = True, has_tabs: bool = False
) -> Layout:
    """Lay out a window of that size, window units. A folded panel is a strip with a button."""
    menu, status = theme.pt(MENU), theme.pt(STATUS_HEIGHT)
    tabs = theme.pt(TABS_HEIGHT) if has_tabs else 0.0
    top = menu + tabs
    strip = theme.pt(STRIP) if has_photo else 0.0
    inspector = theme.pt(PANEL_WIDTH if has_panel else FOLDED) if has_photo else 0.0
    middle = max(height - top - status, 1.0)
    across = max(width - strip - inspector, 1.0)
    return Layout(
        menu=Rect(0, 0, width, menu),
        tabs=Rect(0, menu, width, tabs),
        strip=Rect(0, top, strip, middle),
        canvas=Rect(strip, top, across, middle),
        inspector=Rect(width - inspector, top, inspector, middle),
        status=Rect(0, height - status, width, status),
    )


# Gradual changes, over within 120 ms; they keep the window awake no longer than that.

FADE = 0.12  # s
T = TypeVar("T")


class Fades:
    """Fades of things by their names. There is one instance, `fades`."""

    def __init__(self) -> None:
        self._now = self._before = 0.0  # s, of this frame and the last one
        self._is_on = False
        self._kept: dict[str, tuple[Any, float, float]] = {}  # thing, its share, when that was so
        self._came: set[str] = set()  # those that are there, or coming
        self._moving: set[str] = set()

    def begin(self, now: float, is_on: bool) -> None:
        """A frame at `now` s; where not `is_on`, everything is there or gone at once."""
        self._before, self._now, self._is_on = self._now, now, is_on
        # What was not asked for in the last frame is out of sight, and is not held.
        self._kept = {n: kept for n, kept in self._kept.items() if kept[2] >= self._before}
        self._moving.clear()

    @property
    def is_moving(self) -> bool:
        """Whether anything that was drawn in this frame is not yet as it will be."""
        return bool(self._moving)

    def shown(self, name: str, thing: T | None) -> tuple[T | None, float]:
        """Return the thing to draw, `thing` or the one fading out, and its opacity in [0, 1]."""
        before, share, since = self._kept.get(name, (None, 0.0, self._now))
        is_coming = thing is not None
        if is_coming and thing is not before:
            before, share, since = thing, 0.0, self._now
        elif is_coming != (name in self._came):  # it turns around
            since = self._now
        self._came = self._came | {name} if is_coming else self._came - {name}
        way = (self._now - since) / FADE if self._is_on else 1.0
        share = min(share + way, 1.0) if is_coming else max(share - way, 0.0)
        if share == 0.0 and not is_coming:
            self._kept.pop(name, None)
            return None, 0.0
        self._kept[name] = (before, share, self._now)
        if share < 1.0 or not is_coming:
            self._moving.add(name)
        return before, share


fades = Fades()


TABS, TOOLS, INSPECTOR = "##tabs", "##tools", "##inspector"  # their names
STATUS, START = "##status", "##start"

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
