"""The panel at the right: objects, the tool's settings, the next step."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from ..commands import next_step, run, why_not
from ..editor import Editor
from ..view import ToolName
from .history_list import draw_history
from .layout import Rect
from .panels.compose import draw_compose
from .panels.look import draw_look
from .panels.mask import draw_mask
from .panels.place import draw_place
from .panels.pose import draw_pose
from .panels.select import draw_select
from .panes import edge, pane
from .theme import PRIMARY, Icon, theme
from .widgets import Kind, button, heading, icon_button, note, rule

ROW = 32.0  # points


def draw_inspector(editor: Editor, rect: Rect) -> None:
    with pane("##inspector", rect):
        foot = theme.pt(PRIMARY + 24)
        imgui.begin_child("##scroll", ImVec2(0, rect.height - foot - theme.pt(12)))
        _draw_objects(editor)
        rule()
        _PANELS[editor.view.tool](editor)
        draw_history(editor)
        imgui.end_child()
        _draw_foot(editor, rect, foot)
        edge((rect.x + 0.5, rect.y), (rect.x + 0.5, rect.y + rect.height))


def _draw_objects(editor: Editor) -> None:
    heading("Objects")
    document = editor.document
    objects = document.objects if document else ()
    shown = [k for k, o in enumerate(objects) if o.mask is not None]
    if not shown:
        note("Click something in the photo.")
    for k in shown:
        _draw_object(editor, k)
    if editor.object is not None and editor.is_lifted:
        imgui.push_style_color(imgui.Col_.text, theme.vec("secondary"))
        if button(f"{Icon.PLUS}  Another object", Kind.QUIET):
            editor.objects.start_another()
        imgui.pop_style_color()


def _draw_object(editor: Editor, k: int) -> None:
    assert editor.document is not None
    thing = editor.document.objects[k]
    start = imgui.get_cursor_screen_pos()
    width = imgui.get_content_region_avail().x
    height = theme.pt(ROW)
    is_current = k == editor.current
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + width, start.y + height)
    imgui.set_next_item_allow_overlap()
    if imgui.invisible_button(f"##object{k}", ImVec2(width, height)):
        editor.objects.choose(k)
    if is_current or imgui.is_item_hovered():
        role = "raised" if is_current else "hovered"
        draw.add_rect_filled(start, end, theme.u32(role), theme.pt(6))
    middle = start.y + (height - imgui.get_font_size()) / 2
    icon = Icon.CUBE if thing.lifted else Icon.SELECT
    role = "accent" if is_current else "secondary"
    draw.add_text(ImVec2(start.x + theme.pt(8), middle), theme.u32(role), icon)
    draw.add_text(ImVec2(start.x + theme.pt(34), middle), theme.u32("text"), thing.name)
    if thing.lifted is not None:
        imgui.set_cursor_screen_pos(ImVec2(end.x - theme.pt(30), start.y + theme.pt(2)))
        eye = Icon.EYE if thing.is_visible else Icon.EYE_OFF
        if icon_button(eye, f"eye{k}", "Hide or show the object"):
            editor.objects.toggle_visible(k)
    imgui.set_cursor_screen_pos(ImVec2(start.x, end.y + theme.pt(4)))
    imgui.dummy(ImVec2(0, 0))


def _draw_foot(editor: Editor, rect: Rect, foot: float) -> None:
    """The one primary button: the next sensible step."""
    imgui.set_cursor_pos(ImVec2(theme.pt(12), rect.height - foot + theme.pt(12)))
    label, command = next_step(editor)
    if command is None:
        button(label, Kind.WAITING)
    elif button(label, Kind.PRIMARY, why_not=why_not(editor, command)):
        run(editor, command)


_PANELS: dict[ToolName, Callable[[Editor], None]] = {
    ToolName.SELECT: draw_select,
    ToolName.MASK: draw_mask,
    ToolName.POSE: draw_pose,
    ToolName.PLACE: draw_place,
    ToolName.LOOK: draw_look,
    ToolName.COMPOSE: draw_compose,
}
