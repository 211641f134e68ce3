"""The Place tool's numbers: position, turn, scale."""

from __future__ import annotations

from dataclasses import replace

from objectmorpher_core.document import Placement

from ...commands import COMMANDS, run
from ...editor import Editor
from ..theme import Icon
from ..widgets import Number, button, gap, heading, note, number_field

FIELDS = (
    ("Position", (
        Number("Right", "%.1f px", 0.5, 1.0),
        Number("Down", "%.1f px", 0.5, 1.0),
        Number("Away", "%.2f x", 0.005, 0.05),
    )),
    ("Turn", (
        Number("Yaw", "%.1f°", 0.25, 1.0),
        Number("Pitch", "%.1f°", 0.25, 1.0),
        Number("Roll", "%.1f°", 0.25, 1.0),
    )),
    ("Size", (Number("Scale", "%.1f %%", 0.25, 1.0, rest=100.0, low=2.0, high=5000.0),)),
)  # fmt: skip


def draw_place(editor: Editor) -> None:
    placement = editor.placing.placement
    if placement is None:
        note("Lift an object first.")
        return
    values = dict(zip(_names(), _values(placement), strict=True))
    for title, numbers in FIELDS:
        heading(title)
        for number in numbers:
            change = number_field(number, values[number.name])
            values[number.name] = change.value
            if change.is_changed:
                editor.placing.move_to(_placement(placement, values))
            if change.is_done:
                editor.commit(f"{number.name} of object")
        gap(12)
    if button(f"{Icon.RESET}  Reset placement", why_not=_why_not_reset(editor, placement)):
        run(editor, "reset_place")


def _names() -> list[str]:
    return [number.name for _, numbers in FIELDS for number in numbers]


def _values(p: Placement) -> tuple[float, ...]:
    return (*p.move, p.depth, *p.turn, 100 * p.scale)


def _placement(placement: Placement, values: dict[str, float]) -> Placement:
    right, down, away, yaw, pitch, roll, scale = (values[name] for name in _names())
    turn, move = (yaw, pitch, roll), (right, down)
    return replace(placement, move=move, depth=away, turn=turn, scale=scale / 100)


def _why_not_reset(editor: Editor, placement: Placement) -> str | None:
    if placement.is_identity:
        return "The object is where it was in the photo"
    return COMMANDS["reset_place"].why_not(editor)
