"""The places of the window's parts."""

from __future__ import annotations

from dataclasses import dataclass

from ..widgets.theme import FOLDED, INSPECTOR, MENU, STATUS, STRIP, TABS, theme


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
    menu, status, tabs = theme.pt(MENU), theme.pt(STATUS), theme.pt(TABS) if has_tabs else 0.0
    top = menu + tabs
    strip = theme.pt(STRIP) if has_photo else 0.0
    inspector = theme.pt(INSPECTOR if has_panel else FOLDED) if has_photo else 0.0
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
