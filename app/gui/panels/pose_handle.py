"""The list of handles, and the numbers of the current one."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from ...editing.handle_numbers import Numbers
from ...editor import Editor
from ...texts import t
from ..command_button import command_button
from ..rows import BETWEEN, end_row, fill_row, text_top
from ..theme import Icon, theme
from ..widgets import (
    Number,
    checkbox,
    drawn_button,
    gap,
    half_width,
    heading,
    icon_button,
    note,
    number_field,
    tooltip,
)

ROW = 28.0  # points
VISIBLE_ROWS = 6
PER_PX = 0.5  # px per point that a field is dragged
_revealed: list[int | None] = [None]  # the handle that the list was scrolled to last


def draw_handles(editor: Editor) -> None:
    """All of them; a click selects one, with Shift or Ctrl one more."""
    heading(t("Handles"))
    thing = editor.object
    if thing is None or not thing.handles:
        note(t("Drag a point on the object: it follows, and the far side holds still."))
        return
    count = len(thing.handles)
    if count <= VISIBLE_ROWS:
        for h in range(count):
            _draw_row(editor, h)
        return
    step = theme.pt(ROW + BETWEEN)
    imgui.begin_child("##handles", ImVec2(0, VISIBLE_ROWS * step + step / 2))
    is_new, _revealed[0] = _revealed[0] != editor.posing.handle, editor.posing.handle
    for h in range(count):
        if is_new and h == editor.posing.handle:
            imgui.set_scroll_from_pos_y(imgui.get_cursor_pos_y() - imgui.get_scroll_y() + step / 2)
        if editor.object is not None and h < len(editor.object.handles):  # one may be removed
            _draw_row(editor, h)
    imgui.end_child()


def _draw_row(editor: Editor, h: int) -> None:
    thing = editor.object
    if thing is None or h >= len(thing.handles):
        return
    is_pin = thing.handles[h].is_pin
    start = imgui.get_cursor_screen_pos()
    size = ImVec2(imgui.get_content_region_avail().x, theme.pt(ROW))
    imgui.set_next_item_allow_overlap()
    if drawn_button(f"##handle{h}", size):
        io = imgui.get_io()
        if io.key_shift or io.key_ctrl:
            editor.posing.toggle(h)
        else:
            editor.posing.select(h)
    draw = imgui.get_window_draw_list()
    end = ImVec2(start.x + size.x, start.y + size.y)
    fill_row(start, end, h in editor.posing.selected, imgui.is_item_hovered())
    middle = ImVec2(start.x + theme.pt(16), (start.y + end.y) / 2)
    if h == editor.posing.handle:
        draw.add_circle(middle, theme.pt(9), theme.u32("accent"), 0, theme.pt(2))
    if is_pin:
        draw.add_ngon_filled(middle, theme.pt(6), theme.u32("text"), 4)
    else:
        draw.add_circle_filled(middle, theme.pt(5), theme.u32("accent"))
    top = text_top(start, size.y)
    name = t("Pin {number}", number=h + 1) if is_pin else t("Handle {number}", number=h + 1)
    draw.add_text(ImVec2(start.x + theme.pt(34), top), theme.u32("text"), name)
    imgui.set_cursor_screen_pos(ImVec2(end.x - theme.pt(28), start.y))
    if icon_button(Icon.CLOSE, f"remove{h}", t("Remove it (Del)")):
        editor.posing.remove(h)
    end_row(start, ROW)


def draw_numbers(editor: Editor) -> None:
    """Of the handle that was selected last."""
    numbers = editor.handle_numbers.read()
    if numbers is None:
        return
    gap(12)
    h = editor.posing.handle
    assert h is not None
    is_pin = numbers.is_pin
    heading(t("Pin {number}", number=h + 1) if is_pin else t("Handle {number}", number=h + 1))
    _draw_place(editor, numbers)
    _draw_turn(editor, numbers)
    soft = Number(t("Softness"), "%.2f", 0.005, 0.1, 0.0, 0.0, 10.0)
    change = number_field(soft, numbers.softness)
    if change.is_changed:
        editor.handle_numbers.soften(change.value)
    if change.is_done:
        editor.posing.finish(t("Softness of handle"))
    now_pin = checkbox(t("Pin: it holds still"), is_pin)
    if now_pin != is_pin:
        editor.handle_numbers.set_pin(now_pin)
    half = half_width()
    command_button(editor, "reset_handle", t("Reset"), half)
    tooltip(t("Selected handles go back to where their points were"))
    imgui.same_line()
    command_button(editor, "remove_handle", t("Remove"), half)


def _draw_place(editor: Editor, numbers: Numbers) -> None:
    fields = (
        (Number("X", "%.1f px", PER_PX, 1.0, numbers.rest[0]), "x"),
        (Number("Y", "%.1f px", PER_PX, 1.0, numbers.rest[1]), "y"),
        (Number(t("Depth"), "%.2f ×", 0.005, 0.05), "depth"),
    )
    for number, name in fields:
        change = number_field(number, getattr(numbers, name))
        if name == "depth":
            tooltip(t("In diameters of the object, away from you"))
        if change.is_changed:
            wanted = replace(numbers, **{name: change.value})
            editor.handle_numbers.move(wanted.x, wanted.y, wanted.depth)
        if change.is_done:
            editor.posing.finish(t("{name} of handle", name=number.name))


def _draw_turn(editor: Editor, numbers: Numbers) -> None:
    change = number_field(Number(t("Turn"), "%.1f°", 0.25, 5.0), numbers.turn)
    if change.is_changed:
        editor.handle_numbers.turn(change.value)
    if change.is_done:
        editor.posing.finish(t("Turn of handle"))
    is_free = checkbox(t("Turns with the object"), numbers.is_free)
    tooltip(t("Off: it is held as it is turned"))
    if is_free != numbers.is_free:
        editor.handle_numbers.set_free(is_free)
