"""The steps since the file was opened: the current one marked, a click travels."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.history import History
from ...system.texts import t
from ..widgets.theme import theme
from ..widgets.widgets import drawn_button, fill_row, heading, rule, text_top

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
    """What the list showed when it was drawn last."""

    def __init__(self) -> None:
        self.is_shown = False
        self.step: tuple[int, int] = (-1, -1)  # the current one, and how many there were


_seen = _Seen()


def _has_moved(cursor: int, count: int) -> bool:
    """Whether the current step is another one than when this was asked last."""
    before, _seen.step = _seen.step, (cursor, count)
    return before != _seen.step
