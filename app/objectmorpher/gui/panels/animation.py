"""The timeline: the key poses of an animation in their order, and what can be done with them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...system.texts import t
from ..widgets.theme import Icon, theme
from ..widgets.widgets import (
    command_button,
    drawn_button,
    gap,
    half_width,
    heading,
    mark,
    note,
    tooltip,
)

STATION = 26.0  # points, width and height of a key pose


def draw_timeline(editor: Editor) -> None:
    """Draw the key poses on a line; a click goes to one."""
    heading(t("Animation"))
    if editor.keying.count:
        _draw_stations(editor)
    if editor.keying.count < 2:
        note(t("Keep two poses or more: a video can show the way from one to the next."))
    half = half_width()
    command_button(editor, "add_key", f"{Icon.PLUS}  {t('Add key pose')}", -1)
    if not editor.keying.count:
        return
    command_button(editor, "replace_key", t("Replace"), half)
    tooltip(t("The key pose that you were in last becomes what you see now"))
    imgui.same_line()
    command_button(editor, "remove_key", t("Remove"), half)


def _draw_stations(editor: Editor) -> None:
    keying, draw = editor.keying, imgui.get_window_draw_list()
    shown, last, side = keying.shown, keying.last, theme.pt(STATION)
    start, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    step = min((room - side) / max(keying.count - 1, 1), 2 * side)
    first = ImVec2(start.x + side / 2, start.y + side / 2)
    end = ImVec2(first.x + (keying.count - 1) * step, first.y)
    draw.add_line(first, end, theme.u32("line"), theme.pt(2))
    for n in range(keying.count):
        imgui.set_cursor_screen_pos(ImVec2(start.x + n * step, start.y))
        if drawn_button(f"##key{n}", ImVec2(side, side)):
            keying.show(n)
        name = t("Go to key pose {number}", number=n + 1)
        mark(name)
        tooltip(name)
        role = "accent" if n == shown else "hovered" if imgui.is_item_hovered() else "raised"
        at, number = ImVec2(start.x + n * step + side / 2, start.y + side / 2), str(n + 1)
        draw.add_circle_filled(at, side / 2 - theme.pt(1), theme.u32(role))
        if n == last and n != shown:
            draw.add_circle(at, side / 2 - theme.pt(1), theme.u32("accent"), 0, theme.pt(2))
        size = imgui.calc_text_size(number)
        ink = theme.u32("on_accent" if n == shown else "text")
        draw.add_text(ImVec2(at.x - size.x / 2, at.y - size.y / 2), ink, number)
    imgui.set_cursor_screen_pos(ImVec2(start.x, start.y + side))
    gap(4)
