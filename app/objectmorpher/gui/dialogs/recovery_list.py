"""On the start screen: unsaved work of an editor that crashed, to take up or to throw away."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.recovery import Left, when
from ...system.texts import t
from ..widgets.theme import FIELD, Icon, theme
from ..widgets.widgets import button, small_text

ROW = 56.0  # points
MOST = 3  # shown at a time
LONGEST = 40  # letters of a name
GAP = 12.0
RECOVER, DISCARD = 96.0, 88.0  # widths of the buttons


def recovery_height(editor: Editor) -> float:
    """Points that the list takes, with the gap below it."""
    count = min(len(editor.recovery.left), MOST)
    return count * (ROW + 8) + GAP if count else 0.0


def draw_recovery(editor: Editor, width: float) -> None:
    """`width` in window units."""
    shown = editor.recovery.left[:MOST]
    for left in shown:
        _draw_left(editor, left, width)
    if shown:
        imgui.dummy(theme.size(0, GAP - 8))


def _draw_left(editor: Editor, left: Left, width: float) -> None:
    low = imgui.get_cursor_screen_pos()
    high = ImVec2(low.x + width, low.y + theme.pt(ROW))
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(low, high, theme.u32("panel"), theme.pt(8))
    draw.add_rect(low, high, theme.u32("line"), theme.pt(8))
    middle = low.y + (theme.pt(ROW) - imgui.get_font_size()) / 2
    draw.add_text(ImVec2(low.x + theme.pt(16), middle), theme.u32("warning"), Icon.WARNING)
    end = ImVec2(high.x - theme.pt(RECOVER + DISCARD + 28), high.y)
    draw.push_clip_rect(low, end, True)
    draw.add_text(ImVec2(low.x + theme.pt(44), low.y + theme.pt(9)), theme.u32("text"), _name(left))
    with small_text():
        at = ImVec2(low.x + theme.pt(44), low.y + theme.pt(30))
        draw.add_text(at, theme.u32("secondary"), _facts(left))
    draw.pop_clip_rect()
    imgui.push_id(str(left.folder))
    top = low.y + theme.pt((ROW - FIELD) / 2)
    imgui.set_cursor_screen_pos(ImVec2(high.x - theme.pt(DISCARD + 12), top))
    if button(t("Discard"), width=DISCARD):
        editor.recovery.discard(left)
    if not left.problem:
        imgui.set_cursor_screen_pos(ImVec2(high.x - theme.pt(RECOVER + DISCARD + 20), top))
        if button(t("Recover"), width=RECOVER):
            editor.recovery.recover(left)
    imgui.pop_id()
    imgui.set_cursor_screen_pos(ImVec2(low.x, high.y))
    imgui.dummy(ImVec2(width, 0))


def _name(left: Left) -> str:
    """Which photo's."""
    if not left.name:
        return t("Unsaved work")
    name = left.name if len(left.name) <= LONGEST else f"{left.name[: LONGEST - 1]}…"
    return t("Unsaved work on {name}", name=name)


def _facts(left: Left) -> str:
    """When it was edited and what is in it, or why it is lost."""
    if left.problem:
        return left.problem
    count = t("1 object") if left.objects == 1 else t("{count} objects", count=left.objects)
    return t("Edited {time}, {objects}", time=when(left.edited), objects=count)
