"""The Place tool's numbers: position, turn, scale, and what the object stands on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from imgui_bundle import imgui

from objectmorpher_core.document.model import Placement

from ...commands import run
from ...editor.editor import Editor
from ...system.texts import t
from ..widgets.theme import SMALL_SIZE, Icon, theme
from ..widgets.widgets import (
    GAP,
    Number,
    checkbox,
    command_button,
    command_icon,
    gap,
    heading,
    note,
    number_field,
    small_text,
    take,
    tooltip,
)
from ..window.landmarks import mark
from .pose import draw_timeline

RESET = 24.0  # points, side of the button that resets a group
DEPTHS = (-1.5, 3.0)  # object diameters, ends of the slider
DONE = {
    "Right": "Move object", "Down": "Move object", "Farther": "Move object in depth",
    "Yaw": "Turn object", "Pitch": "Turn object", "Roll": "Roll object", "Scale": "Scale object",
}  # fmt: skip


@dataclass(frozen=True)
class Group:
    """Numbers that are reset together."""

    title: str
    command: str  # that resets them
    numbers: tuple[Number, ...]


GROUPS = (
    Group("Position", "reset_position", (
        Number("Right", "%.1f px", 0.5, 1.0),
        Number("Down", "%.1f px", 0.5, 1.0),
        Number("Farther", "%.2f × its size", 0.005, 0.05),
    )),
    Group("Turn", "reset_turn", (
        Number("Yaw", "%.1f°", 0.25, 1.0),
        Number("Pitch", "%.1f°", 0.25, 1.0),
        Number("Roll", "%.1f°", 0.25, 1.0),
    )),
    Group("Size", "reset_size", (
        Number("Scale", "%.1f %%", 0.25, 1.0, rest=100.0, low=2.0, high=5000.0),
    )),
)  # fmt: skip


def draw_place(editor: Editor) -> None:
    placement = editor.placing.placement
    if placement is None:
        note(f"{editor.why_no_shape}.")
        return
    _draw_ground(editor)
    gap(12)
    values = dict(zip(_names(), placed_values(editor, placement), strict=True))
    for group in GROUPS:
        _draw_title(editor, group)
        for number in group.numbers:
            shown = replace(number, name=t(number.name), format=t(number.format))
            change = number_field(shown, values[number.name])
            preview = partial(place_by, editor, number.name, change.value)
            take(editor, change, preview, t(DONE[number.name]))
        if group.title == "Position":
            _draw_depth(editor, placement)
        if group.title == "Turn":
            _draw_seen_from(editor)
        gap(12)
    command_button(editor, "reset_place", icon=Icon.RESET)
    gap(12)
    draw_timeline(editor)


def _draw_ground(editor: Editor) -> None:
    is_on = checkbox(t("Move along the ground"), editor.placing.is_grounded)
    tooltip(t("Moving the object slides it over the ground; its size follows the distance (G)"))
    if is_on != editor.placing.is_grounded:
        run(editor, "ground")
    if is_on:
        text = editor.placing.why_no_ground
        if text is not None or editor.placing.needs_horizon:
            note(text or t("Drag the dashed line to the photo's horizon."))


def _draw_title(editor: Editor, group: Group) -> None:
    """The group's name, and at the right the button that resets it."""
    top = imgui.get_cursor_pos_y()
    imgui.align_text_to_frame_padding()
    heading(t(group.title))
    imgui.same_line(imgui.get_content_region_avail().x + imgui.get_cursor_pos_x() - theme.pt(RESET))
    imgui.set_cursor_pos_y(top)
    imgui.push_font(None, SMALL_SIZE - 2)
    command_icon(editor, group.command, Icon.RESET, RESET)
    imgui.pop_font()


def _draw_depth(editor: Editor, placement: Placement) -> None:
    """A slider between the words for its ends: nearer on the left, farther on the right."""
    near, far = t("Nearer"), t("Farther")
    imgui.align_text_to_frame_padding()
    _say(near)
    imgui.same_line(0, theme.pt(GAP))
    room = imgui.get_content_region_avail().x
    with small_text():
        beyond = imgui.calc_text_size(far).x + theme.pt(GAP)
    imgui.set_next_item_width(room - beyond)
    home = editor.placing.home.depth
    value = placement.depth - home
    low, high = min(DEPTHS[0], value), max(DEPTHS[1], value)
    is_changed, depth = imgui.slider_float("##depth", value, low, high, "")
    mark(t("Nearer or farther"))
    tooltip(t("How much farther away it is than in the photo, in sizes of the object"))
    if is_changed:
        editor.placing.move_away(depth + home)
    if imgui.is_item_deactivated_after_edit():
        editor.commit(t("Move object in depth"))
    imgui.same_line(0, theme.pt(GAP))
    imgui.align_text_to_frame_padding()
    _say(far)


def _say(word: str) -> None:
    """A word at an end of the slider."""
    with small_text():
        imgui.text_colored(theme.vec("secondary"), word)


def _draw_seen_from(editor: Editor) -> None:
    """How steeply one looks down on the object: yaw turns it about what is upright then."""
    usual = editor.placing.usual_seen_from
    number = Number(t("From above"), "%.0f°", 0.25, 1.0, usual, 0.0, 90.0)
    change = number_field(number, editor.placing.seen_from)
    hint = t("How steeply you look down on it: 0° from its side, 90° from above")
    stays = t("It stays as it is; Yaw, Pitch and Roll are counted about its new upright")
    tooltip(f"{hint}\n{stays}")
    wanted = None if change.value == usual else change.value
    take(editor, change, lambda: editor.placing.look_down(wanted), t("Set what is upright"))


def place_by(editor: Editor, name: str, value: float) -> None:
    """Previews the object with another value of one number; on the ground it stays there."""
    placing, was = editor.placing, editor.placing.placement
    assert was is not None, "its numbers are shown"
    home = placing.home
    if name == "Farther":
        placing.move_away(value + home.depth)
    elif name == "Right":
        placing.move_to(placing.stood(replace(was, move=(value + home.move[0], was.move[1]))))
    elif name == "Down":
        placing.move_down(value + home.move[1])
    elif name == "Scale":
        placing.move_to(placing.scaled(was, value / 100 * home.scale))
    else:
        angles = dict(zip(("Yaw", "Pitch", "Roll"), placing.angles, strict=True)) | {name: value}
        placing.move_to(placing.turned_to(was, (angles["Yaw"], angles["Pitch"], angles["Roll"])))


def _names() -> list[str]:
    return [number.name for group in GROUPS for number in group.numbers]


def placed_values(editor: Editor, p: Placement) -> tuple[float, ...]:
    """The numbers of a placement: right, down, farther, yaw, pitch, roll, size in percent.

    They count from where it was in the photo; of one of another photo, from where it came in.
    """
    home = editor.placing.home
    right, down = p.move[0] - home.move[0], p.move[1] - home.move[1]
    turn, size = editor.placing.angles, 100 * (p.scale / home.scale)
    return right, down, p.depth - home.depth, *turn, size
