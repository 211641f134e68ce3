"""The Look tool's settings: what is shown, beside what, and from how near."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...canvas.painter import shown_now
from ...commands import COMMANDS, keys_of, run, why_not
from ...editor.editor import Editor
from ...editor.view import Shown
from ...system.texts import t
from ..widgets.command_button import command_button
from ..widgets.rows import end_row, fill_row, text_top
from ..widgets.theme import Icon, theme
from ..widgets.widgets import checkbox, drawn_button, gap, heading, note, small_text, tooltip
from .shape import draw_shape

ROW = 28.0  # points
ZOOMS = (("fit", "Fit"), ("actual", "100 %"), ("double", "200 %"), ("pixels", "800 %"))


def draw_look(editor: Editor) -> None:
    """In the inspector."""
    draw_shape(editor)
    heading(t("View"))
    for shown in Shown:
        _draw_view(editor, shown)
    gap(12)
    label = t(COMMANDS["reset_look"].label)
    command_button(editor, "reset_look", f"{Icon.RESET}  {label}")
    gap(12)
    heading(t("Before and after"))
    is_split = editor.view.split is not None
    keys = keys_of(editor, "split")
    if checkbox(f"{t('Split the view')}  ({keys})", is_split) != is_split:
        run(editor, "split")
    note(t("Hold X to see the photo as it was."))
    gap(12)
    heading(t("Zoom"))
    _draw_zooms(editor)


def _draw_view(editor: Editor, shown: Shown) -> None:
    """A row: the name of a view, and the keys that show it."""
    name = f"show_{shown.name.lower()}"
    reason = why_not(editor, name)
    start = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.get_content_region_avail().x, theme.pt(ROW))
    imgui.begin_disabled(reason is not None)
    is_pressed = drawn_button(name, size)
    imgui.end_disabled()
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + size.x, start.y + size.y)
    is_current = shown_now(editor.document, editor.view) is shown
    fill_row(start, end, is_current, imgui.is_item_hovered() and reason is None)
    dim = 0.45 if reason is not None else 1.0
    top = text_top(start, size.y)
    role = "accent" if is_current else "text"
    draw.add_text(ImVec2(start.x + theme.pt(8), top), theme.u32(role, dim), t(shown.value))
    with small_text():
        keys = keys_of(editor, name)
        width = imgui.calc_text_size(keys).x
        at = ImVec2(end.x - theme.pt(8) - width, text_top(start, size.y))
        draw.add_text(at, theme.u32("secondary", dim), keys)
    end_row(start, ROW)
    if reason is not None:
        tooltip(reason)
    elif is_pressed:
        run(editor, name)


def _draw_zooms(editor: Editor) -> None:
    """Buttons side by side."""
    space = theme.pt(4)
    across = (imgui.get_content_region_avail().x - (len(ZOOMS) - 1) * space) / len(ZOOMS)
    for i, (name, label) in enumerate(ZOOMS):
        if i:
            imgui.same_line(0, space)
        imgui.push_style_var(imgui.StyleVar_.frame_padding, theme.size(2, 6))
        command_button(editor, name, t(label), across / theme.scale)
        imgui.pop_style_var()
        if why_not(editor, name) is None:
            keys = keys_of(editor, name)
            tooltip(t(COMMANDS[name].label) + (f" ({keys})" if keys else ""))
