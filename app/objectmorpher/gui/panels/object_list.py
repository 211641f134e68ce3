"""The photo's objects, what is in front first: choose, name, hide, copy, remove, reorder.

A row that is dragged up or down lands where the line is, on another tab in that photo.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from objectmorpher_core.document.model import Prompt

from ...commands import run
from ...editor.editor import Editor
from ...system.texts import t
from ..widgets.panes import has_panel
from ..widgets.theme import SMALL_SIZE, Icon, theme
from ..widgets.widgets import (
    Emphasis,
    button,
    command_icon,
    drawn_button,
    end_row,
    fill_row,
    heading,
    icon_button,
    note,
    text_top,
)
from ..window.landmarks import mark

ROW = 32.0  # points
BETWEEN = 12.0  # points from a row to the next
SLACK = 4.0  # points; a press that moves less is a click
SIDE = 24.0  # of the buttons beside the title
EYE = 32.0  # from the eye's left to the row's right, and from the lock's to it
NAME = 34.0  # from the row's left to the name
BUTTONS = (
    (Icon.UP, "forward"), (Icon.DOWN, "backward"), (Icon.COPY, "duplicate"),
)  # fmt: skip
FOLD = (Icon.SPLIT, "panel")  # where the button was that unfolded it: a second click folds it


class _Typing:
    """The name that is being typed. One list is drawn, so one is remembered."""

    def __init__(self) -> None:
        self.of: int | None = None
        self.text = ""
        self.has_focus = False


_typing = _Typing()
_is_dragged = False  # the mouse has taken up a row; also after Esc, until it lets go


def draw_objects(editor: Editor) -> None:
    """Draw the list of objects in the inspector."""
    shown = editor.objects.listed()
    _draw_title(editor, has_buttons=bool(shown))
    if not shown:
        note(_search(editor.selection.pending))
    top = imgui.get_cursor_screen_pos()
    for k in shown:
        _draw_object(editor, k)
    if _is_dragged:
        _drag_row(editor, top)
    if editor.object is not None and (editor.is_lifted or editor.object.stays_in_front):
        imgui.push_style_color(imgui.Col_.text, theme.vec("secondary"))
        if button(f"{Icon.PLUS}  {t('Another object')}", Emphasis.QUIET):
            run(editor, "another")
        imgui.pop_style_color()


def _search(asked: Prompt | None) -> str:
    """What is said where nothing is selected yet."""
    if asked is None:
        return t("Click something in the photo.")
    return t("Looking for what you clicked…") if asked.clicks else t("Selecting…")


def _draw_title(editor: Editor, has_buttons: bool) -> None:
    """At the right what can be done with the current object."""
    top = imgui.get_cursor_pos_y()
    heading(t("Objects"))
    bin_ = (Icon.TRASH, "take_out" if editor.objects.is_to_be_taken_out else "remove_object")
    buttons = (*((*BUTTONS, bin_) if has_buttons else ()), *((FOLD,) if _is_in_the_way() else ()))
    if not buttons:
        return
    end, gap = imgui.get_content_region_avail().x + imgui.get_cursor_pos_x(), theme.pt(2)
    left = end - theme.pt(4) - len(buttons) * theme.pt(SIDE) - (len(buttons) - 1) * gap
    imgui.push_font(None, SMALL_SIZE - 1)
    for i, (icon, name) in enumerate(buttons):
        imgui.same_line(left + i * (theme.pt(SIDE) + gap))
        imgui.set_cursor_pos_y(top - theme.pt(4))
        # Below, the tooltip would be over the eye and the lock of the first row.
        command_icon(editor, name, icon, SIDE, is_above=True)
    imgui.pop_font()


def _is_in_the_way() -> bool:
    """Whether the window is so narrow that the panel is folded up unless it is asked for."""
    return not has_panel(imgui.get_io().display_size.x, None)


def _draw_object(editor: Editor, k: int) -> None:
    document = editor.document
    if document is None or k >= len(document.objects):  # a button of this frame removed it
        return
    thing = document.objects[k]
    start = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, theme.pt(ROW)
    end = ImVec2(start.x + width, start.y + height)
    # Beside the eye, not below it: what may be overlapped is not pressed in the frame in which
    # the pointer comes to it, and in a slow one that is the press itself.
    beside = theme.pt(EYE if thing.lifted is None else 2 * EYE)
    is_hovered = _take_clicks(editor, k, ImVec2(width - beside, height))
    draw, is_current = imgui.get_window_draw_list(), k == editor.current
    fill_row(start, end, is_current, is_hovered or k == editor.objects.carried)
    middle = text_top(start, height)
    icon = Icon.LAYERS if thing.stays_in_front else Icon.CUBE if thing.lifted else Icon.SELECT
    role = "accent" if is_current else "secondary"
    draw.add_text(ImVec2(start.x + theme.pt(8), middle), theme.u32(role), icon)
    if editor.objects.renaming == k:
        _draw_field(editor, k, start, width)
    else:
        room = ImVec2(end.x - beside, end.y)
        _draw_name(thing.name, thing.is_visible, ImVec2(start.x + theme.pt(NAME), middle), room)
    if thing.lifted is not None:
        is_near = imgui.is_mouse_hovering_rect(start, end)
        if thing.is_locked or is_near:
            imgui.set_cursor_screen_pos(
                ImVec2(end.x - theme.pt(2 * EYE - 4), start.y + theme.pt(2))
            )
            lock = Icon.LOCK if thing.is_locked else Icon.LOCK_OPEN
            hint = t("Unlock object") if thing.is_locked else t("Lock object")
            if icon_button(lock, f"lock{k}", hint):
                editor.lock(k)
        imgui.set_cursor_screen_pos(ImVec2(end.x - theme.pt(EYE - 2), start.y + theme.pt(2)))
        eye = Icon.EYE if thing.is_visible else Icon.EYE_OFF
        if icon_button(eye, f"eye{k}", t("Hide or show the object")):
            editor.objects.toggle_visible(k)
    end_row(start, ROW, BETWEEN)


def _drag_row(editor: Editor, top: ImVec2) -> None:
    """The line where the carried row would land; the rows begin at `top`. The release drops it."""
    global _is_dragged
    height = theme.pt(ROW + BETWEEN)
    gap = round((imgui.get_mouse_pos().y - top.y) / height)
    if not imgui.is_mouse_down(0):
        _is_dragged = False
        if (tab := editor.tabs.aimed) is not None:
            editor.pasting.carry(tab)
        else:
            editor.objects.drop(gap)
        return
    landing = None if editor.tabs.aimed else editor.objects.landing(gap)
    if editor.objects.carried is not None and editor.tabs.aimed is None:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ns)
    if landing is not None:
        width = imgui.get_content_region_avail().x
        y = top.y + landing * height - theme.pt(BETWEEN) / 2
        ends = ImVec2(top.x, y), ImVec2(top.x + width, y)
        imgui.get_window_draw_list().add_line(*ends, theme.u32("accent"), theme.pt(2))


def _take_clicks(editor: Editor, k: int, size: ImVec2) -> bool:
    """A click chooses the row, a double click begins to name it, a drag takes it up.

    Whether it is hovered.
    """
    global _is_dragged
    if editor.objects.renaming == k:  # its field has the mouse
        imgui.dummy(size)
        return False
    if drawn_button(f"##object{k}", size) and not _is_dragged:
        editor.objects.choose(k)
    mark(f"row of {editor.opened.objects[k].name}")
    if imgui.is_item_active() and imgui.is_mouse_dragging(0, theme.pt(SLACK)) and not _is_dragged:
        _is_dragged = editor.objects.carry(k, has_tabs=len(editor.tabs.all) > 1)
    is_hovered = imgui.is_item_hovered()
    if is_hovered and imgui.is_mouse_double_clicked(0):
        editor.objects.renaming = k
    return is_hovered


def _draw_name(name: str, is_visible: bool, at: ImVec2, end: ImVec2) -> None:
    """As much of it as there is room for before the buttons."""
    draw = imgui.get_window_draw_list()
    draw.push_clip_rect(at, ImVec2(end.x - theme.pt(2), end.y), True)
    draw.add_text(at, theme.u32("text" if is_visible else "secondary"), name)
    draw.pop_clip_rect()


def _draw_field(editor: Editor, k: int, start: ImVec2, width: float) -> None:
    """Enter or a click elsewhere takes the name, Esc leaves the old one."""
    if _typing.of != k:
        _typing.of, _typing.text = k, editor.opened.objects[k].name
        _typing.has_focus = False
    if not _typing.has_focus and not imgui.is_mouse_down(0):
        imgui.set_keyboard_focus_here()
    imgui.set_cursor_screen_pos(ImVec2(start.x + theme.pt(NAME - 8), start.y + theme.pt(2)))
    imgui.set_next_item_width(width - theme.pt(NAME - 8 + 34))
    flags = imgui.InputTextFlags_.auto_select_all | imgui.InputTextFlags_.enter_returns_true
    is_entered, _typing.text = imgui.input_text("##name", _typing.text, int(flags))
    if imgui.is_key_pressed(imgui.Key.escape):
        editor.objects.renaming = _typing.of = None
    elif is_entered or (imgui.is_item_deactivated() and _typing.has_focus):
        _typing.of = None
        editor.objects.rename(k, _typing.text)
    _typing.has_focus = _typing.has_focus or imgui.is_item_active()
