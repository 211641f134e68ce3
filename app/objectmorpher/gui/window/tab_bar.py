"""The tabs of the open photos, above the picture, where there are several."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ...editor.editor import Editor
from ...editor.state import Tab
from ...editor.view import ToolName
from ...system.texts import t
from ..widgets.panes import TABS, Rect, edge, pane
from ..widgets.theme import Icon, theme
from ..widgets.widgets import command_icon, drawn_button, fitted, icon_button, small_text, tooltip
from .landmarks import mark

WIDEST = 220.0  # points, of a tab; many are narrower, so that all are there
CROSS = 24.0  # points, of a tab's close button
NARROW = 72.0  # points; only the tab that is shown has the button where tabs are narrower
INSET = 12.0  # points before the name
DOT = 3.5  # points, radius of the sign of unsaved changes
BUTTON = 32.0  # points, of the button for a new tab


def draw_tabs(editor: Editor, rect: Rect) -> None:
    """`rect` in window units."""
    tabs, editor.tabs.aimed = editor.tabs.all, None
    with pane(TABS, rect, padding=(0, 0)):
        width = min((rect.width - theme.pt(BUTTON)) / len(tabs), theme.pt(WIDEST))
        low = rect.y + rect.height - 0.5
        edge((rect.x, low), (rect.x + rect.width, low))
        with small_text():
            for i, tab in enumerate(tabs):
                imgui.push_id(str(id(tab)))  # a tab that is dragged stays the one that is held
                _draw_tab(editor, tab, Rect(rect.x + i * width, rect.y, width, rect.height))
                imgui.pop_id()
        imgui.set_cursor_screen_pos(ImVec2(rect.x + len(tabs) * width + theme.pt(2), rect.y))
        command_icon(editor, "new_tab", Icon.PLUS, rect.height / theme.scale)


def _draw_tab(editor: Editor, tab: Tab, rect: Rect) -> None:
    name, is_shown = tab.name or t("New tab"), tab is editor.tab
    start, end = ImVec2(rect.x, rect.y), ImVec2(rect.x + rect.width, rect.y + rect.height)
    is_near = imgui.is_mouse_hovering_rect(start, end)
    if is_near and not is_shown and _is_object_dragged(editor):
        editor.tabs.aimed = tab
    has_cross = is_shown or rect.width >= theme.pt(NARROW)
    beside = theme.pt(CROSS) if has_cross else 0.0
    draw = imgui.get_window_draw_list()
    if is_shown or is_near:  # the tab that is shown goes over into the picture below it
        draw.add_rect_filled(start, end, theme.u32("surround" if is_shown else "hovered"))
    if tab is editor.tabs.aimed and tab.document is not None:
        draw.add_rect(start, end, theme.u32("accent"), thickness=theme.pt(2))
    if is_shown:
        high = ImVec2(end.x, start.y + theme.pt(2))
        draw.add_rect_filled(start, high, theme.u32("accent"))
    draw.add_line(ImVec2(end.x - 0.5, start.y), ImVec2(end.x - 0.5, end.y), theme.u32("line"), 1.0)
    imgui.set_cursor_screen_pos(start)
    if drawn_button("##tab", ImVec2(max(rect.width - beside, 1.0), rect.height)):
        editor.tabs.go(tab)
    mark(f"Tab: {name}")
    if imgui.is_item_active() and imgui.is_mouse_dragging(imgui.MouseButton_.left):
        by = int((imgui.get_mouse_pos().x - rect.x) // rect.width)  # places; 0 while on its own
        at = editor.tabs.all.index(tab) + by
        editor.tabs.move(tab, min(max(at, 0), len(editor.tabs.all) - 1))
    if imgui.is_item_hovered() and imgui.is_mouse_clicked(imgui.MouseButton_.middle):
        editor.filing.close(tab)
    tooltip(str(tab.path or tab.source or name))
    middle = start.y + (rect.height - imgui.get_font_size()) / 2
    left = start.x + min(theme.pt(INSET), rect.width / 6)
    room = end.x - beside - left - (0.0 if has_cross else theme.pt(4 * DOT))
    role = "text" if is_shown else "secondary"
    draw.push_clip_rect(start, ImVec2(end.x - beside, end.y), True)
    if imgui.calc_text_size(name).x > room:
        name = fitted(Path(name).stem, room)
    draw.add_text(ImVec2(left, middle), theme.u32(role), name)
    draw.pop_clip_rect()
    at = ImVec2(end.x - theme.pt(CROSS / 2), start.y + rect.height / 2)
    if tab.is_saved or (is_near and has_cross):
        if has_cross:
            _draw_cross(editor, tab, at)
    else:
        draw.add_circle_filled(at, theme.pt(DOT), theme.u32("accent"))


def _is_object_dragged(editor: Editor) -> bool:
    """Whether the whole object is being moved, or its row, so that it can be dropped on a tab."""
    if editor.objects.carried is not None:
        return True
    is_dragging = editor.hand.is_busy and editor.preview is not None
    return is_dragging and editor.view.tool is ToolName.PLACE and editor.hover.part == "move"


def _draw_cross(editor: Editor, tab: Tab, at: ImVec2) -> None:
    """The button that closes the tab; `at` its middle."""
    side = CROSS - 4
    imgui.set_cursor_screen_pos(ImVec2(at.x - theme.pt(side / 2), at.y - theme.pt(side / 2)))
    imgui.push_style_color(imgui.Col_.text, theme.vec("secondary"))
    if icon_button(
        Icon.CLOSE, "close", t("Close {name}", name=tab.name or t("New tab")), None, side
    ):
        editor.filing.close(tab)
    imgui.pop_style_color()
