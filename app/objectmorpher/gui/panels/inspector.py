"""The panel at the right: objects, the tool's settings, the next step."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from ...commands import COMMANDS, keys_of, next_step, run, why_not
from ...editor.editor import Editor
from ...editor.view import CHANGING, ToolName
from ...system.texts import t
from ..widgets.panes import INSPECTOR, edge, pane
from ..widgets.theme import FOLDED, PRIMARY, Icon, theme
from ..widgets.widgets import Emphasis, button, command_button, icon_button, note, rule
from ..window.layout import Rect
from .compose import draw_compose
from .history_list import draw_history
from .look import draw_look
from .object_list import draw_objects
from .place import draw_place
from .pose import draw_pose
from .select import draw_mask, draw_select

NEXT = 176.0  # points, width of the next step's button over the photo


class _Scroll:
    """Whether the panel had more than there is room for when it was drawn last."""

    is_needed = False


_scroll = _Scroll()


def draw_inspector(editor: Editor, rect: Rect) -> None:
    """The whole panel, or where there is no room for it the button that unfolds it."""
    if not editor.view.has_panel:
        _draw_folded(editor, rect)
        return
    with pane(INSPECTOR, rect):
        foot = theme.pt(PRIMARY + 24)
        bar = imgui.get_style().scrollbar_size if _scroll.is_needed else 0.0
        across = imgui.get_content_region_avail().x + bar  # the bar stands in the padding
        size = ImVec2(across, rect.height - foot - theme.pt(12))
        imgui.begin_child("##scroll", size, imgui.ChildFlags_.nav_flattened)
        draw_objects(editor)
        rule()
        if editor.object is not None and editor.object.is_locked and editor.view.tool in CHANGING:
            note(t("{name} is locked.", name=editor.object.name))
            command_button(editor, "lock", t("Unlock"))
        else:
            _PANELS[editor.view.tool](editor)
        draw_history(editor)
        _scroll.is_needed = imgui.get_scroll_max_y() > 0
        imgui.end_child()
        if _scroll.is_needed:
            top = rect.y + rect.height - foot + 0.5
            edge((rect.x, top), (rect.x + rect.width, top))
        _draw_foot(editor, rect, foot)
        edge((rect.x + 0.5, rect.y), (rect.x + 0.5, rect.y + rect.height))


def _draw_folded(editor: Editor, rect: Rect) -> None:
    with pane(INSPECTOR, rect, padding=(2, 8)):
        hint = f"{t(COMMANDS['panel'].label)} ({keys_of(editor, 'panel')})"
        if icon_button(Icon.SPLIT, "panel", hint, None, FOLDED - 4):
            run(editor, "panel")
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
