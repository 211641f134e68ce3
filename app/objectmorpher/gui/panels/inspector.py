"""The panel at the right: objects, the tool's settings, the next step."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from ...commands import next_step, run, why_not
from ...editor.editor import Editor
from ...editor.history import History, Step
from ...editor.view import ToolName
from ...system.texts import t
from ..widgets.panes import INSPECTOR, Rect, edge, pane
from ..widgets.theme import FOLDED, PRIMARY, Icon, theme
from ..widgets.widgets import (
    FIELD,
    GAP,
    Emphasis,
    button,
    command_button,
    command_icon,
    drawn_button,
    fill_row,
    gap,
    heading,
    icon_button,
    note,
    rule,
    text_top,
)
from ..window.landmarks import mark
from .compose import draw_compose
from .look import draw_look
from .object_list import draw_objects
from .place import draw_place
from .pose import draw_pose
from .select import draw_mask, draw_select

NEXT = 176.0  # points, width of the next step's button over the photo


def draw_inspector(editor: Editor, rect: Rect) -> None:
    """The whole panel, or where there is no room for it the button that unfolds it."""
    if not editor.view.has_panel:
        _draw_folded(editor, rect)
        return
    with pane(INSPECTOR, rect):
        foot = theme.pt(PRIMARY + 24)
        bar = imgui.get_style().scrollbar_size if _seen.needs_scroll else 0.0
        across = imgui.get_content_region_avail().x + bar  # the bar stands in the padding
        size = ImVec2(across, rect.height - foot - theme.pt(12))
        imgui.begin_child("##scroll", size, imgui.ChildFlags_.nav_flattened)
        draw_objects(editor)
        rule()
        if (reason := editor.why_held) is not None:
            note(f"{reason}.")
            if editor.chosen.is_locked:
                command_button(editor, "lock", t("Unlock"))
            else:
                command_button(editor, "hide", t("Show object"))
        else:
            _PANELS[editor.view.tool](editor)
        draw_history(editor)
        _seen.needs_scroll = imgui.get_scroll_max_y() > 0
        imgui.end_child()
        if _seen.needs_scroll:
            top = rect.y + rect.height - foot + 0.5
            edge((rect.x, top), (rect.x + rect.width, top))
        _draw_foot(editor, rect, foot)
        edge((rect.x + 0.5, rect.y), (rect.x + 0.5, rect.y + rect.height))


def _draw_folded(editor: Editor, rect: Rect) -> None:
    with pane(INSPECTOR, rect, padding=(2, 8)):
        command_icon(editor, "panel", Icon.SPLIT, FOLDED - 4)
        edge((rect.x + 0.5, rect.y), (rect.x + 0.5, rect.y + rect.height))
    _draw_next(editor, rect)


def _draw_next(editor: Editor, rect: Rect) -> None:
    """The next step over the photo's corner, beside the folded panel."""
    label, command = next_step(editor)
    if command is None or editor.hand.is_busy or editor.view.is_before:
        return
    corner = ImVec2(rect.x - theme.pt(16), rect.y + rect.height - theme.pt(16))
    imgui.set_next_window_pos(corner, imgui.Cond_.always, ImVec2(1.0, 1.0))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_focus_on_appearing | imgui.WindowFlags_.no_background
    imgui.begin("##next", None, flags | imgui.WindowFlags_.no_bring_to_front_on_focus)
    if button(label, Emphasis.PRIMARY, why_not(editor, command), NEXT):
        run(editor, command)
    imgui.end()
    imgui.pop_style_var()


def _draw_foot(editor: Editor, rect: Rect, foot: float) -> None:
    """The one primary button: the next sensible step."""
    imgui.set_cursor_pos(ImVec2(theme.pt(12), rect.height - foot + theme.pt(12)))
    label, command = next_step(editor)
    if command is None:
        button(label, Emphasis.WAITING)
    elif button(label, Emphasis.PRIMARY, why_not=why_not(editor, command)):
        run(editor, command)


_PANELS: dict[ToolName, Callable[[Editor], None]] = {
    ToolName.SELECT: draw_select,
    ToolName.MASK: draw_mask,
    ToolName.POSE: draw_pose,
    ToolName.PLACE: draw_place,
    ToolName.LOOK: draw_look,
    ToolName.COMPOSE: draw_compose,
}


# The steps since the file was opened, and the snapshots: a click travels there.

ROW = 28.0  # points
CORNER = 4.0  # radius
MOST = 9  # rows shown without scrolling


def draw_history(editor: Editor) -> None:
    """At the inspector's end, while it is switched on."""
    history = editor.history
    if history is None or not editor.view.has_history:
        _seen.is_shown = False
        return
    rule()
    _draw_snapshots(editor, history)
    heading(t("History"))
    cursor, row = history.cursor, theme.pt(ROW)
    height = row * min(history.count, MOST)
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, 0))
    is_visible = imgui.begin_child("##history", ImVec2(0, height), imgui.ChildFlags_.nav_flattened)
    if is_visible:
        if _has_moved(cursor, history.count):
            imgui.set_scroll_y((cursor + 0.5) * row - 0.5 * height)
        _draw_steps(editor, history, row)
    imgui.end_child()
    imgui.pop_style_var()
    if not _seen.is_shown:  # it was just switched on, maybe below the panel's end
        imgui.set_scroll_here_y(1.0)
        _seen.is_shown = True


def _draw_snapshots(editor: Editor, history: History) -> None:
    """Edits that were kept by a name, and the field that keeps the shown one."""
    heading(t("Snapshots"))
    field = imgui.get_content_region_avail().x - theme.pt(FIELD + GAP)
    imgui.set_next_item_width(field)
    flags = imgui.InputTextFlags_.enter_returns_true
    hint = t("name of a snapshot")
    is_entered, _seen.name = imgui.input_text_with_hint("##snapshot", hint, _seen.name, flags)
    mark(t("Name of the snapshot"))
    imgui.same_line(0, theme.pt(GAP))
    if icon_button(Icon.PLUS, "keep", t("Keep a snapshot")) or is_entered:
        editor.keep_snapshot(_seen.name)
        _seen.name = ""
    for step in history.snapshots:
        _draw_snapshot(editor, history, step)
    gap(8)


def _draw_snapshot(editor: Editor, history: History, step: Step) -> None:
    """One row: a click goes there, the cross forgets it."""
    start, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    size = ImVec2(width - theme.pt(ROW), theme.pt(ROW))
    if drawn_button(f"##snapshot {step.label}", size):
        editor.take_snapshot(step.label)
    mark(f"snapshot {step.label}")
    end = ImVec2(start.x + width, start.y + theme.pt(ROW))
    fill_row(start, end, step.document is editor.committed, imgui.is_item_hovered(), CORNER)
    draw, place = imgui.get_window_draw_list(), ImVec2(start.x + theme.pt(12), 0)
    place.y = text_top(start, theme.pt(ROW))
    draw.push_clip_rect(start, ImVec2(end.x - theme.pt(ROW), end.y), True)
    draw.add_text(place, theme.u32("text"), step.label)
    draw.pop_clip_rect()
    imgui.same_line(0, 0)
    if icon_button(Icon.CLOSE, f"forget {step.label}", t("Forget the snapshot"), None, ROW):
        history.drop(step.label)


def _draw_steps(editor: Editor, history: History, row: float) -> None:
    """The rows that are seen, each `row` px high: there may be thousands of them."""
    clipper = imgui.ListClipper()
    clipper.begin(history.count, row)
    cursor, chosen = history.cursor, None
    while clipper.step():
        for k in range(clipper.display_start, clipper.display_end):
            if _draw_step(k, history.label(k), cursor):
                chosen = k
    if chosen is not None:
        editor.travel(chosen)


def _draw_step(k: int, label: str, cursor: int) -> bool:
    """One row; whether it was clicked. Steps that were undone are dimmed."""
    start, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    is_clicked = drawn_button(f"##step{k}", ImVec2(width, theme.pt(ROW)))
    draw, end = imgui.get_window_draw_list(), ImVec2(start.x + width, start.y + theme.pt(ROW))
    fill_row(start, end, k == cursor, imgui.is_item_hovered(), CORNER)
    if k == cursor:
        bar = ImVec2(start.x + theme.pt(3), end.y)
        draw.add_rect_filled(start, bar, theme.u32("accent"), theme.pt(2))
    middle = text_top(start, theme.pt(ROW))
    role, alpha = ("text", 1.0) if k <= cursor else ("secondary", 0.6)
    draw.add_text(ImVec2(start.x + theme.pt(12), middle), theme.u32(role, alpha), t(label))
    return is_clicked


class _Seen:
    """What the panel and its list showed when they were drawn last."""

    def __init__(self) -> None:
        self.needs_scroll = False  # the panel had more than there was room for
        self.is_shown = False
        self.name = ""  # of a snapshot, as it is being typed
        self.step: tuple[int, int] = (-1, -1)  # the current one, and how many there were


_seen = _Seen()


def _has_moved(cursor: int, count: int) -> bool:
    """Whether the current step is another one than when this was asked last."""
    before, _seen.step = _seen.step, (cursor, count)
    return before != _seen.step
