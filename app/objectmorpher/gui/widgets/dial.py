"""A small round field for a direction."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, imgui

from ...tools.pointer import SNAP
from .theme import theme
from .widgets import Change, tooltip

SIDE = 60.0  # points
KNOB = 5.0


def dial(name: str, degrees: float, hint: str) -> Change:
    """The direction in degrees, 0 to the right and 90 down, in (-180, 180]."""
    start, side = imgui.get_cursor_screen_pos(), theme.pt(SIDE)
    imgui.invisible_button(f"##{name}", ImVec2(side, side))
    is_active = imgui.is_item_active()
    is_hovered = imgui.is_item_hovered() or is_active
    centre = ImVec2(start.x + side / 2, start.y + side / 2)
    changed = Change(degrees, is_done=imgui.is_item_deactivated())
    if is_active:
        mouse = imgui.get_mouse_pos()
        aimed = math.degrees(math.atan2(mouse.y - centre.y, mouse.x - centre.x))
        if imgui.get_io().key_shift:
            aimed = round(aimed / SNAP) * SNAP
        changed = Change(aimed, is_changed=aimed != degrees)
        degrees = aimed
    draw, radius = imgui.get_window_draw_list(), side / 2 - theme.pt(2)
    draw.add_circle_filled(centre, radius, theme.u32("hovered" if is_hovered else "raised"), 48)
    draw.add_circle(centre, radius, theme.u32("pressed"), 48, theme.pt(1))
    angle, reach = math.radians(degrees), radius - theme.pt(KNOB + 3)
    end = ImVec2(centre.x + reach * math.cos(angle), centre.y + reach * math.sin(angle))
    draw.add_line(centre, end, theme.u32("secondary"), theme.pt(2))
    draw.add_circle_filled(centre, theme.pt(3), theme.u32("secondary"), 16)
    draw.add_circle_filled(end, theme.pt(KNOB), theme.u32("accent"), 24)
    if not is_active:
        tooltip(hint)
    return changed
