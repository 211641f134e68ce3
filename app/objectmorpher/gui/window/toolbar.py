"""The tool strip at the left."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...commands import COMMANDS, keys_of, run
from ...editor.editor import Editor
from ...editor.view import ToolName
from ...system.texts import t
from ..widgets import panes
from ..widgets.panes import edge, pane
from ..widgets.theme import Icon, theme
from ..widgets.widgets import tooltip
from .landmarks import mark
from .layout import Rect

SIDE = 36.0  # points
ICON = 18.0
TOOLS = (
    (ToolName.SELECT, Icon.SELECT, "select", "Click what you want to move"),
    (ToolName.MASK, Icon.BRUSH, "mask", "Paint the selection exactly"),
    (ToolName.POSE, Icon.POSE, "pose", "Drag points of the object; it bends"),
    (ToolName.PLACE, Icon.PLACE, "place", "Move, turn and scale the whole object"),
    (ToolName.LOOK, Icon.EYE, "look", "See the object from all sides, before and after"),
    (ToolName.COMPOSE, Icon.LAYERS, "compose", "Repair the background, blend the object in"),
)


def draw_toolbar(editor: Editor, rect: Rect) -> None:
    with pane(panes.TOOLS, rect, padding=(6, 8)):
        for tool, icon, name, hint in TOOLS:
            _draw_tool(editor, tool, icon, name, hint)
        right = rect.x + rect.width - 0.5
        edge((right, rect.y), (right, rect.y + rect.height))


def _draw_tool(editor: Editor, tool: ToolName, icon: str, name: str, hint: str) -> None:
    command = COMMANDS[name]
    reason = command.why_not(editor)
    is_active = editor.view.tool is tool
    fill = theme.vec("accent") if is_active else theme.vec("panel", 0.0)
    text = theme.vec("on_accent" if is_active else "text")
    imgui.push_style_color(imgui.Col_.button, fill)
    imgui.push_style_color(imgui.Col_.text, text)
    if is_active:
        imgui.push_style_color(imgui.Col_.button_hovered, fill)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    imgui.push_font(None, ICON)
    imgui.begin_disabled(reason is not None)
    is_pressed = imgui.button(f"{icon}##{name}", theme.size(SIDE, SIDE))
    mark(f"Tool: {t(command.label)}")
    imgui.end_disabled()
    imgui.pop_font()
    imgui.pop_style_var()
    imgui.pop_style_color(3 if is_active else 2)
    tooltip(f"{t(command.label)} ({keys_of(editor, name)})\n{reason or t(hint)}")
    if is_pressed:
        run(editor, name)
