"""Buttons, fields and texts that the panels are made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...commands import COMMANDS, hint_of, run, why_not
from ...editor.editor import Editor
from ...render.gpu_memory import Uploads
from ...render.renderer import Renderer
from ...system.texts import t
from ...tools.pointer import SNAP
from ..window.landmarks import mark, mark_on_canvas
from .theme import FIELD, PRIMARY, RADIUS, SMALL_SIZE, Icon, theme

# Small pictures in panels: thumbnails, on the GPU as long as they are drawn.

KEPT = 24  # pictures, the least recently drawn go first


class Textures:
    """The window's pictures by the identity of their pixels. One instance, `pictures`."""

    def __init__(self) -> None:
        self._renderer: Renderer | None = None
        self._kept = Uploads(KEPT)

    def use(self, renderer: Renderer) -> None:
        """The window's renderer, whose context owns the textures."""
        self._renderer, self._kept = renderer, Uploads(KEPT)

    def texture(self, pixels: np.ndarray) -> imgui.ImTextureRef:
        """Return ImGui's texture of `pixels` (h, w, 3) u8."""
        renderer = self._renderer
        assert renderer is not None, "the window says which renderer"
        return imgui.ImTextureRef(self._kept("", pixels, lambda: renderer.picture(pixels)).glo)


pictures = Textures()


LABEL_WIDTH = 72.0  # points, of the names left of the fields
NAME_GAP = 4.0  # between a longer name and its field
GAP = 8.0  # between two that stand side by side
TIP_GAP = 8.0  # points between a control that the keyboard reached and its tooltip
TIP_WIDTH = 260.0  # of its text at most
TIP_PADDING = (10.0, 8.0)
STEPPER = 24.0  # points, width of a field's - and + buttons
FILL = -1e-6  # width of what ends where the panel's content ends; with -1 it ends a pixel before


class Emphasis(Enum):
    """How much attention a button asks for."""

    PRIMARY = "primary"
    PRIMARY_SMALL = "primary, as high as the others"
    WAITING = "waiting"  # a primary button while the next step is the user's, in the photo
    PLAIN = "plain"
    QUIET = "quiet"  # no frame until hovered


@contextmanager
def small_text() -> Iterator[None]:
    imgui.push_font(None, SMALL_SIZE)
    yield
    imgui.pop_font()


@contextmanager
def bold_text(size: float = 0.0) -> Iterator[None]:
    imgui.push_font(theme.bold, size)
    yield
    imgui.pop_font()


def tooltip(text: str, is_above: bool = False, is_beside: bool = False) -> None:
    """Show a tooltip over the last item after a moment, also where the item is greyed out.

    Where the keyboard has come to the item, it is shown at once, beside the item. `is_above`:
    above the item, where below it would hide the next one; `is_beside`: left of the panel, where
    above it, too, is something to click.
    """
    flags = imgui.HoveredFlags_.allow_when_disabled | imgui.HoveredFlags_.for_tooltip
    is_reached = imgui.is_item_focused() and imgui.get_io().nav_visible
    is_shown = is_reached or imgui.is_item_hovered(flags)
    if is_shown and is_above:
        _place_above(text)
    elif is_shown and is_beside:
        at = ImVec2(imgui.get_window_pos().x - theme.pt(TIP_GAP), imgui.get_item_rect_min().y)
        imgui.set_next_window_pos(at, imgui.Cond_.always, ImVec2(1.0, 0.0))
    elif is_reached:
        _place_tooltip()
    if is_shown:
        imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(*TIP_PADDING))
        imgui.push_style_var(imgui.StyleVar_.window_rounding, theme.pt(RADIUS))
        imgui.begin_tooltip()
        wrapped_text(text, end=theme.pt(TIP_WIDTH))
        low, size = imgui.get_window_pos(), imgui.get_window_size()
        mark_on_canvas("Tooltip", low, ImVec2(low.x + size.x, low.y + size.y))
        imgui.end_tooltip()
        imgui.pop_style_var(2)


def _place_above(text: str) -> None:
    """Above the last item, where there is room for all of it."""
    low, size = imgui.get_item_rect_min(), imgui.calc_text_size(text, False, theme.pt(TIP_WIDTH))
    right = imgui.get_io().display_size.x - size.x - 2 * theme.pt(TIP_PADDING[0])
    bottom = max(low.y - theme.pt(TIP_GAP), size.y + 2 * theme.pt(TIP_PADDING[1]))
    at = ImVec2(min(low.x, right), bottom)
    imgui.set_next_window_pos(at, imgui.Cond_.always, ImVec2(0.0, 1.0))


def _place_tooltip() -> None:
    """Below the last item, above it in the window's lower half; it ends where the item ends where
    that is at the right."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    room = imgui.get_io().display_size
    is_low, is_right = high.y > room.y / 2, high.x > room.x / 2
    gap = theme.pt(TIP_GAP)
    at = ImVec2(high.x if is_right else low.x, low.y - gap if is_low else high.y + gap)
    imgui.set_next_window_pos(at, imgui.Cond_.always, ImVec2(float(is_right), float(is_low)))


def button(
    label: str, kind: Emphasis = Emphasis.PLAIN, why_not: str | None = None, width: float = -1.0
) -> bool:
    """A text button; `why_not` greys it out and is its tooltip. `width` in points, -1 fills."""
    is_tall = kind in (Emphasis.PRIMARY, Emphasis.WAITING)
    height = PRIMARY if is_tall else FIELD
    across = theme.pt(width) if width > 0 else FILL
    roles = _ROLES[kind]
    columns = ("button", "button_hovered", "button_active", "text")
    for column, role in zip(columns, roles, strict=True):
        alpha = 0.0 if role == "none" else 1.0
        shown = theme.vec("panel" if role == "none" else role, alpha)
        imgui.push_style_color(getattr(imgui.Col_, column), shown)
    imgui.begin_disabled(why_not is not None)
    if is_tall:
        imgui.push_font(theme.bold, 0.0)
    is_pressed = imgui.button(label, ImVec2(across, theme.pt(height)))
    mark(label)
    if is_tall:
        imgui.pop_font()
    imgui.end_disabled()
    imgui.pop_style_color(len(columns))
    if why_not is not None:
        tooltip(why_not)
    return is_pressed


_ROLES = {
    Emphasis.PRIMARY: ("accent", "accent_hovered", "accent", "on_accent"),
    Emphasis.PRIMARY_SMALL: ("accent", "accent_hovered", "accent", "on_accent"),
    Emphasis.WAITING: ("raised", "raised", "raised", "secondary"),
    Emphasis.PLAIN: ("raised", "hovered", "pressed", "text"),
    Emphasis.QUIET: ("none", "hovered", "pressed", "text"),
}


def icon_button(
    icon: str, name: str, hint: str, why_not: str | None = None, side: float = FIELD,
    is_above: bool = False,
) -> bool:  # fmt: skip
    """A square button with an icon; `name` is its id, `hint` its tooltip, see `tooltip`."""
    imgui.push_style_color(imgui.Col_.button, theme.vec("panel", 0.0))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    imgui.begin_disabled(why_not is not None)
    is_pressed = imgui.button(f"{icon}##{name}", theme.size(side, side))
    mark(hint.partition("\n")[0])
    imgui.end_disabled()
    imgui.pop_style_var()
    imgui.pop_style_color()
    tooltip(hint if why_not is None else f"{hint}\n{why_not}", is_above)
    return is_pressed


def drawn_button(name: str, size: ImVec2) -> bool:
    """A button that its caller draws; `size` in window units. Tab reaches it, too."""
    return imgui.invisible_button(name, size, imgui.ButtonFlags_.enable_nav)


def half_width() -> float:
    """Points, of each of two buttons side by side."""
    return (imgui.get_content_region_avail().x / theme.scale - GAP) / 2


def shortened(text: str, room: float) -> str:
    """The text's end, as much as fits; `room` in window units."""
    if imgui.calc_text_size(text).x <= room:
        return text
    while text and imgui.calc_text_size(f"…{text}").x > room:
        text = text[1:]
    return f"…{text}"


def fitted(name: str, room: float) -> str:
    """Shorten a file's name to fit (window units); its ending says most, so it stays."""
    if imgui.calc_text_size(name).x <= room:
        return name
    for kept in range(len(name) - 2, 1, -1):
        shown = f"{name[: kept - kept // 3]}…{name[len(name) - kept // 3 :]}"
        if imgui.calc_text_size(shown).x <= room:
            return shown
    return "…"


def shown_path(path: Path) -> str:
    """Return a path for people: the user's home folder is written as ~."""
    home = Path.home()
    return str(Path("~", path.relative_to(home))) if path.is_relative_to(home) else str(path)


# The setting that somebody looks for: scrolled to, and framed until the next click.

PATIENCE = 60  # frames in which it has to come up


class Sought:
    """One instance, `sought`."""

    def __init__(self) -> None:
        self._text = ""  # "" for none
        self._since = self._seen = 0  # frames: when it was looked for, and shown last (0: not yet)

    def begin(self, text: str) -> None:
        """Look for the row of that name, which is drawn soon."""
        self._text, self._since, self._seen = text, imgui.get_frame_count(), 0

    def meet(self, text: str, has_field: bool = True) -> None:
        """The last item is the name of a row; `has_field`: what it names is beside it."""
        now = imgui.get_frame_count()
        if text != self._text or not text or now == self._seen:
            return
        late = now - self._seen > 1 if self._seen else now - self._since > PATIENCE
        if late or imgui.is_mouse_clicked(0):
            self._text = ""
            return
        if not self._seen:
            imgui.set_scroll_here_y(0.5)
        self._seen = now
        low, high, gap = imgui.get_item_rect_min(), imgui.get_item_rect_max(), theme.pt(5)
        across = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
        height = imgui.get_frame_height() if has_field else high.y - low.y
        height = max(height, high.y - low.y) / 2 + theme.pt(3)
        middle, right = (low.y + high.y) / 2, max(across, high.x) + gap
        low, high = ImVec2(low.x - gap, middle - height), ImVec2(right, middle + height)
        ink, draw = theme.u32("accent"), imgui.get_window_draw_list()
        top, bottom = draw.get_clip_rect_min().y, draw.get_clip_rect_max().y  # beyond its sides
        draw.push_clip_rect(ImVec2(low.x - gap, top), ImVec2(right + gap, bottom))
        draw.add_rect(low, high, ink, theme.pt(RADIUS), thickness=theme.pt(2))
        draw.pop_clip_rect()
        mark_on_canvas("Sought", low, high)


sought = Sought()


def heading(text: str) -> None:
    """The title of a group in a panel."""
    with bold_text():
        imgui.text_unformatted(text)
    sought.meet(text, has_field=False)


def note(text: str) -> None:
    """Secondary text, wrapped."""
    wrapped_text(text, "secondary")
    sought.meet(text, has_field=False)


def wrapped_text(text: str, role: str = "text", end: float = 0.0) -> None:
    """`end`: where its lines end, window units; 0 at the window's edge."""
    imgui.push_text_wrap_pos(end)
    imgui.text_colored(theme.vec(role), text)
    imgui.pop_text_wrap_pos()


def gap(points: float) -> None:
    """Vertical space between groups, on top of the item spacing."""
    imgui.dummy(ImVec2(0, theme.pt(max(points - 8, 0))))


def rule() -> None:
    """A line between groups, 12 points above and below."""
    gap(8)
    top = imgui.get_cursor_screen_pos()
    width = imgui.get_content_region_avail().x
    pad = imgui.get_style().window_padding.x
    line = theme.u32("line")
    imgui.get_window_draw_list().add_line(
        ImVec2(top.x - pad, top.y + 0.5), ImVec2(top.x + width + pad, top.y + 0.5), line, 1.0
    )
    imgui.dummy(ImVec2(0, theme.pt(4)))


@dataclass(frozen=True)
class Number:
    """A number that a field shows."""

    name: str
    format: str  # "%.1f°"
    speed: float  # per point that the pointer is dragged
    step: float  # of the - and + buttons
    rest: float = 0.0  # what a double-click on the name goes back to
    low: float = 0.0  # no limits where low == high
    high: float = 0.0


@dataclass(frozen=True)
class FieldChange:
    """What happened to a field in this frame."""

    value: float
    is_changed: bool = False
    is_done: bool = False  # the change is complete: one step for undo


def take(editor: Editor, change: FieldChange, preview: Callable[[], None], label: str) -> None:
    """Shows a change, and makes it a step when it is complete."""
    if change.is_changed:
        preview()
    if change.is_done:
        editor.commit(label)


def number_field(number: Number, value: float) -> FieldChange:
    """Name, value that can be dragged, typed (click) and stepped; double-click the name: reset."""
    is_nothing = not any(digit in "123456789" for digit in number.format % value)
    shown = 0.0 if is_nothing else value  # not "-0.00"
    changed = FieldChange(value)
    imgui.push_id(number.name)
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("secondary"), number.name)
    if imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0):
        changed = FieldChange(number.rest, is_changed=value != number.rest, is_done=True)
    sought.meet(number.name)
    tooltip(t("Double-click resets it"), is_above=True)
    room = imgui.calc_text_size(number.name).x + theme.pt(NAME_GAP)
    imgui.same_line(max(theme.pt(LABEL_WIDTH), room))
    field = imgui.get_content_region_avail().x - 2 * theme.pt(STEPPER + 2)
    imgui.set_next_item_width(field)
    flags = imgui.SliderFlags_.always_clamp if number.low < number.high else 0
    is_changed, new = imgui.drag_float(
        "##value", shown, number.speed, number.low, number.high, number.format, int(flags)
    )
    mark(number.name)
    _select_all_of_double_clicked()
    if is_changed or imgui.is_item_deactivated_after_edit():
        changed = FieldChange(new, is_changed, imgui.is_item_deactivated_after_edit())
    for sign, icon in ((-1, Icon.MINUS), (1, Icon.PLUS)):
        imgui.same_line(0, theme.pt(2))
        if _stepper(icon):
            stepped = value + sign * number.step
            if number.low < number.high:
                stepped = min(max(stepped, number.low), number.high)
            changed = FieldChange(stepped, True, True)
    imgui.pop_id()
    return changed


def _select_all_of_double_clicked() -> None:
    """A double-click selects the number that is typed over, not what is behind its point."""
    if not (imgui.is_mouse_double_clicked(0) and imgui.is_item_active()):
        return
    if (typed := imgui.internal.get_input_text_state(imgui.get_item_id())) is not None:
        typed.select_all()
        typed.selected_all_mouse_lock = True  # until the button is let go


def _stepper(icon: str) -> bool:
    size = ImVec2(theme.pt(STEPPER), imgui.get_frame_height())
    padding = ImVec2(0, imgui.get_style().frame_padding.y)  # as the field's: one baseline
    imgui.push_style_var(imgui.StyleVar_.frame_padding, padding)
    imgui.push_font(None, SMALL_SIZE - 3)
    is_pressed = imgui.button(icon, size)
    imgui.pop_font()
    imgui.pop_style_var()
    return is_pressed


def checkbox(label: str, is_on: bool) -> bool:
    """A small box with a label; whether it is on now."""
    imgui.push_style_var(imgui.StyleVar_.frame_padding, theme.size(2, 1))
    imgui.push_style_var(imgui.StyleVar_.frame_border_size, theme.pt(1) if not is_on else 0.0)
    imgui.push_style_color(imgui.Col_.border, theme.vec("secondary", 0.8))
    for column in ("frame_bg_hovered", "frame_bg_active"):  # or the check would be white on grey
        role = "accent_hovered" if is_on else "hovered"
        imgui.push_style_color(getattr(imgui.Col_, column), theme.vec(role))
    is_on = imgui.checkbox(label, is_on)[1]
    mark(label)
    sought.meet(label)
    imgui.pop_style_color(3)
    imgui.pop_style_var(2)
    return is_on


# A command as a button.


def command_button(
    editor: Editor, name: str, label: str = "", width: float = -1.0, icon: str = ""
) -> None:
    """It says `label`, else the command's name; `width` in points, -1 fills.

    Where the command cannot run it is greyed out, and the reason is its tooltip.
    """
    shown = label or t(COMMANDS[name].label)
    if button(f"{icon}  {shown}" if icon else shown, why_not=why_not(editor, name), width=width):
        run(editor, name)


def command_icon(
    editor: Editor, name: str, icon: str, side: float = FIELD, is_above: bool = False
) -> None:
    """A command as an icon; what it is called, and its keys, are its tooltip."""
    if icon_button(icon, name, hint_of(editor, name), why_not(editor, name), side, is_above):
        run(editor, name)


# Rows of a list: what lies behind one, where its text stands, and where the next begins.

BETWEEN = 2.0  # points from a row to the next


def fill_row(
    start: ImVec2, end: ImVec2, is_current: bool, is_hovered: bool, radius: float = RADIUS
) -> None:
    """Behind a row that is the current one, or under the pointer; corners in screen units."""
    if is_current or is_hovered:
        role = "raised" if is_current else "hovered"
        draw = imgui.get_window_draw_list()
        draw.add_rect_filled(start, end, theme.u32(role), theme.pt(radius))


def text_top(start: ImVec2, height: float) -> float:
    """Return the top of a line of text centred in a row; screen units."""
    return start.y + (height - imgui.get_font_size()) / 2


def end_row(start: ImVec2, height: float, between: float = BETWEEN) -> None:
    """The next row is below one that began at `start` and is `height` points high."""
    below = start.y + theme.pt(height + between) - imgui.get_style().item_spacing.y
    imgui.set_cursor_screen_pos(ImVec2(start.x, below))
    imgui.dummy(ImVec2(0, 0))


# A small round field for a direction.

SIDE = 60.0  # points
KNOB = 5.0


def dial(name: str, degrees: float, hint: str) -> FieldChange:
    """The direction in degrees, 0 to the right and 90 down, in (-180, 180]."""
    start, side = imgui.get_cursor_screen_pos(), theme.pt(SIDE)
    imgui.invisible_button(f"##{name}", ImVec2(side, side))
    is_active = imgui.is_item_active()
    is_hovered = imgui.is_item_hovered() or is_active
    centre = ImVec2(start.x + side / 2, start.y + side / 2)
    changed = FieldChange(degrees, is_done=imgui.is_item_deactivated())
    if is_active:
        mouse = imgui.get_mouse_pos()
        aimed = math.degrees(math.atan2(mouse.y - centre.y, mouse.x - centre.x))
        if imgui.get_io().key_shift:
            aimed = round(aimed / SNAP) * SNAP
        changed = FieldChange(aimed, is_changed=aimed != degrees)
        degrees = aimed
    draw, radius = imgui.get_window_draw_list(), side / 2 - theme.pt(2)
    draw.add_circle_filled(centre, radius, theme.u32("hovered" if is_hovered else "raised"), 48)
    draw.add_circle(centre, radius, theme.u32("pressed"), 48, theme.pt(1))
    angle, reach = math.radians(degrees), radius - theme.pt(KNOB + 3)
    end = ImVec2(centre.x + reach * math.cos(angle), centre.y + reach * math.sin(angle))
    draw.add_line(centre, end, theme.u32("secondary"), theme.pt(2))
    draw.add_circle_filled(centre, theme.pt(3), theme.u32("secondary"), 16)
    draw.add_circle_filled(end, theme.pt(KNOB), theme.u32("accent"), 24)
    if not is_active:
        tooltip(hint)
    return changed
