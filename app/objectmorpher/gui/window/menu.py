"""The menu bar: menus left, the file's name and undo right."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ...commands import COMMANDS, hint_of, keys_of, label_of, meaning_of, run
from ...editor.editor import Editor
from ...editor.view import Shown, ToolName
from ...system.texts import t
from ..widgets import panes
from ..widgets.panes import Rect, edge, pane
from ..widgets.theme import Icon, theme
from ..widgets.widgets import command_icon, fitted, tooltip
from .landmarks import mark

# The tool strip at the left.

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
    tooltip(f"{hint_of(editor, name)}\n{reason or t(hint)}")
    if is_pressed:
        run(editor, name)


LEAST_NAME = 48.0  # points of room, with less the file's name is left out
MENUS: dict[str, tuple[str, ...]] = {
    "File": (
        "new_tab", "open", "recent", "recover", "-", "save", "save_as", "export", "send_back", "-",
        "close", "quit",
    ),
    "Edit": (
        "undo", "redo", "-", "copy_object", "copy", "paste", "paste_object", "-",
        "select_handles",
        "remove_handle", "reset_handle", "reset_handles", "-", "reset_pose", "reset_place",
    ),
    "Select": (
        "subject", "invert", "clear", "-", "grow", "shrink", "smooth", "feather", "fill_holes",
        "remove_islands", "add_left_out", "-", "import_mask", "export_mask",
    ),
    "Object": (
        "lift", "add_photo", "import_shape", "fit_again", "-", "rename", "duplicate", "lock",
        "hide", "take_out", "remove_object", "-",
        "keep_in_front", "forward", "backward", "to_front", "to_back", "-", "ground", "-",
        "paint", "unpaint", "-", "bare", "take_from", "forget_sources", "fill_again", "shadow",
        "take_shadow", "depth",
    ),
    "Tool": ("select", "mask", "pose", "place", "look", "compose"),
    "View": (
        "zoom_in", "zoom_out", "fit", "actual", "double", "pixels", "-",
        *(f"show_{s.name.lower()}" for s in Shown), "-", "split", "points", "-",
        "proof", "proof_profile",
    ),
    "Window": (
        "next_tab", "previous_tab", "-", "panel", "history", "snapshot", "models", "preferences",
    ),
    "Help": ("palette", "help", "shortcuts", "-", "about"),
}  # fmt: skip


def draw_menu(editor: Editor, rect: Rect) -> None:
    """Along the top of the window."""
    across = (rect.height - imgui.get_font_size()) / 2
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(theme.pt(8), across))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, theme.size(16, 8))
    for background in (imgui.Col_.window_bg, imgui.Col_.menu_bar_bg):
        imgui.push_style_color(background, 0)  # the window is cleared in it
    imgui.begin_main_menu_bar()
    imgui.pop_style_color(2)
    imgui.pop_style_var(2)
    imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(8, 8))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, theme.size(12, 10))
    for title, names in MENUS.items():
        is_open = imgui.begin_menu(f"{t(title)}##{title}")
        mark(f"Menu: {t(title)}")
        if is_open:
            _draw_items(editor, names)
            if imgui.is_key_pressed(imgui.Key.escape):
                imgui.close_current_popup()
            imgui.end_menu()
    imgui.pop_style_var(2)
    _draw_right(editor, rect)
    line = theme.u32("line")
    bottom = rect.y + rect.height - 0.5
    imgui.get_window_draw_list().add_line(ImVec2(0, bottom), ImVec2(rect.width, bottom), line, 1.0)
    imgui.end_main_menu_bar()


def _draw_items(editor: Editor, names: tuple[str, ...]) -> None:
    for name in names:
        if name == "-":
            imgui.separator()
        elif name == "recent":
            _draw_recent(editor)
        else:
            _draw_command(editor, name)


def _draw_command(editor: Editor, name: str) -> None:
    command = COMMANDS[name]
    reason = command.why_not(editor)
    label = label_of(editor, name)
    if name == "undo" and editor.undo_label:
        label = t("Undo: {label}", label=editor.undo_label)
    if name == "redo" and editor.history and editor.history.redo_label:
        label = t("Redo: {label}", label=editor.history.redo_label)
    is_on = command.is_on is not None and command.is_on(editor)
    if imgui.menu_item(f"{label}##{name}", keys_of(editor, name), is_on, reason is None)[0]:
        run(editor, name)
    mark(label)
    if told := reason or meaning_of(editor, name):
        tooltip(told)


def _draw_recent(editor: Editor) -> None:
    if imgui.begin_menu(t("Open recent"), bool(editor.settings.recent)):
        for path in editor.settings.recent:
            if imgui.menu_item(f"{Path(path).name}##{path}", "", False)[0]:
                editor.filing.open(Path(path))
            tooltip(path)
        imgui.end_menu()


def _draw_right(editor: Editor, rect: Rect) -> None:
    """File name and state, undo and redo."""
    if editor.document is None:
        return
    side = rect.height - theme.pt(4)
    buttons = 2 * side + theme.pt(4 + 12)
    name = editor.path.name if editor.path else editor.document.photo.name
    state = "" if editor.is_saved else t("edited")
    state_width = imgui.calc_text_size(f"{state}   ").x if state else 0.0
    imgui.same_line()
    room = rect.width - buttons - state_width - theme.pt(16) - imgui.get_cursor_pos_x()
    if room > theme.pt(LEAST_NAME):  # else the window's title has it
        name = fitted(name, min(rect.width * 0.28, room))
        text = imgui.calc_text_size(name).x
        imgui.set_cursor_pos_x(rect.width - buttons - text - state_width - theme.pt(16))
        imgui.text_unformatted(name)
        if state:
            imgui.same_line(0, theme.pt(8))
            imgui.text_colored(theme.vec("secondary"), state)
        imgui.same_line()
    imgui.set_cursor_pos_x(rect.width - buttons)
    points = side / theme.scale
    for i, (icon, name) in enumerate(((Icon.UNDO, "undo"), (Icon.REDO, "redo"))):
        if i:
            imgui.same_line(0, theme.pt(4))
        imgui.set_cursor_pos_y(theme.pt(2))
        command_icon(editor, name, icon, points)
