"""The Pose tool's settings: handles, anchors, reset."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...commands import COMMANDS, run
from ...editor import Editor
from ..theme import Icon, theme
from ..widgets import button, checkbox, gap, heading, icon_button, note, tooltip

ROW = 28.0  # points
VISIBLE_ROWS = 8


def draw_pose(editor: Editor) -> None:
    heading("Handles")
    thing = editor.object
    if thing is None or not thing.handles:
        note("Drag a point on the object: it follows, and the far side holds still.")
    else:
        for h in range(len(thing.handles)):
            _draw_handle(editor, h)
    gap(12)
    if thing is not None:
        is_on = checkbox("Hold the far side still", thing.has_auto_anchors)
        tooltip("With one handle, the part farthest from it is anchored by itself")
        if is_on != thing.has_auto_anchors:
            editor.posing.set_auto_anchors(is_on)
    editor.view.has_points = checkbox("Show control graph", editor.view.has_points)
    gap(12)
    reason = COMMANDS["reset_pose"].why_not(editor)
    if reason is None and thing is not None and not thing.handles:
        reason = "There is no handle yet"
    if button(f"{Icon.RESET}  Reset pose", why_not=reason):
        run(editor, "reset_pose")


def _draw_handle(editor: Editor, h: int) -> None:
    assert editor.object is not None
    handle = editor.object.handles[h]
    start = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.get_content_region_avail().x, theme.pt(ROW))
    imgui.set_next_item_allow_overlap()
    if imgui.invisible_button(f"##handle{h}", size):
        editor.posing.select(h)
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + size.x, start.y + size.y)
    is_current = h == editor.posing.handle
    if is_current or imgui.is_item_hovered():
        draw.add_rect_filled(start, end, theme.u32("raised" if is_current else "hovered"), 6)
    middle = ImVec2(start.x + theme.pt(16), (start.y + end.y) / 2)
    if handle.is_pin:
        draw.add_ngon_filled(middle, theme.pt(6), theme.u32("text"), 4)
    else:
        draw.add_circle_filled(middle, theme.pt(5), theme.u32("accent"))
    top = start.y + (size.y - imgui.get_font_size()) / 2
    name = f"{'Pin' if handle.is_pin else 'Handle'} {h + 1}"
    draw.add_text(ImVec2(start.x + theme.pt(34), top), theme.u32("text"), name)
    imgui.set_cursor_screen_pos(ImVec2(end.x - theme.pt(28), start.y))
    if icon_button(Icon.CLOSE, f"remove{h}", "Remove it (Del)"):
        editor.posing.remove(h)
    imgui.set_cursor_screen_pos(ImVec2(start.x, end.y + theme.pt(2)))
    imgui.dummy(ImVec2(0, 0))
