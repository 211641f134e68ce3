"""The menu bar: menus left, the file's name and undo right."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ..commands import COMMANDS, run
from ..editor import Editor
from ..painter import shown_now
from ..view import Shown
from .layout import Rect
from .theme import Icon, theme
from .widgets import icon_button, tooltip

MENUS: dict[str, tuple[str, ...]] = {
    "File": ("open", "recent", "-", "save", "save_as", "export", "-", "close", "quit"),
    "Edit": (
        "undo", "redo", "-", "select_handles", "remove_handle", "reset_handle", "reset_handles",
        "-", "reset_pose", "reset_place",
    ),
    "Object": ("subject", "clear", "-", "lift", "-", "select", "pose", "place"),
    "View": (
        "zoom_in", "zoom_out", "fit", "actual", "-", *(f"show_{s.name.lower()}" for s in Shown),
        "-", "split", "points", "-", "theme",
    ),
}  # fmt: skip


def draw_menu(editor: Editor, rect: Rect) -> None:
    """Along the top of the window."""
    across = (rect.height - imgui.get_font_size()) / 2
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(theme.pt(8), across))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, theme.size(16, 8))
    imgui.begin_main_menu_bar()
    imgui.pop_style_var(2)
    imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(8, 8))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, theme.size(12, 10))
    for title, names in MENUS.items():
        if imgui.begin_menu(title):
            _draw_items(editor, names)
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
        elif name == "theme":
            is_light = editor.settings.theme == "light"
            if imgui.menu_item("Light theme", "", is_light)[0]:
                editor.set_theme("dark" if is_light else "light")
        else:
            _draw_command(editor, name)


def _draw_command(editor: Editor, name: str) -> None:
    command = COMMANDS[name]
    reason = command.why_not(editor)
    label = command.label
    if name == "undo" and editor.history and editor.history.undo_label:
        label = f"Undo: {editor.history.undo_label}"
    if name == "redo" and editor.history and editor.history.redo_label:
        label = f"Redo: {editor.history.redo_label}"
    is_on = name in _switched_on(editor)
    if imgui.menu_item(f"{label}##{name}", command.keys, is_on, reason is None)[0]:
        run(editor, name)
    if reason is not None:
        tooltip(reason)


def _switched_on(editor: Editor) -> set[str]:
    """The toggles that are on, and the view that is chosen."""
    view = editor.view
    names = {f"show_{shown_now(editor.document, view).name.lower()}"}
    names |= {"split"} if view.split is not None else set()
    return names | ({"points"} if view.has_points else set())


def _draw_recent(editor: Editor) -> None:
    if imgui.begin_menu("Open recent", bool(editor.settings.recent)):
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
    state = "" if editor.is_saved else "edited"
    if (text := imgui.calc_text_size(name).x) > rect.width * 0.4:
        name = f"{name[:24]}…"
        text = imgui.calc_text_size(name).x
    state_width = imgui.calc_text_size(f"{state}   ").x if state else 0.0
    imgui.same_line(rect.width - buttons - text - state_width - theme.pt(16))
    imgui.text_unformatted(name)
    if state:
        imgui.same_line(0, theme.pt(8))
        imgui.text_colored(theme.vec("secondary"), state)
    imgui.same_line(rect.width - buttons)
    points = side / theme.scale
    for i, (icon, name) in enumerate(((Icon.UNDO, "undo"), (Icon.REDO, "redo"))):
        if i:
            imgui.same_line(0, theme.pt(4))
        imgui.set_cursor_pos_y(theme.pt(2))
        command = COMMANDS[name]
        hint = f"{command.label} ({command.keys})"
        if icon_button(icon, name, hint, command.why_not(editor), points):
            run(editor, name)
