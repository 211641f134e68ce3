"""Commands that place the whole object."""

from __future__ import annotations

from ..editor.editor import Editor
from ..system.texts import t
from .command import Command, no_lift


def _not_moved(editor: Editor) -> str | None:
    placement = editor.placing.placement
    if placement is None:
        return no_lift(editor)
    return t("The object is where it was in the photo") if placement.is_identity else None


def _not_shifted(editor: Editor) -> str | None:
    placement = editor.placing.placement
    if placement is None:
        return no_lift(editor)
    is_there = placement.move == (0.0, 0.0) and placement.depth == 0
    return t("The object is where it was in the photo") if is_there else None


def _not_turned(editor: Editor) -> str | None:
    placement = editor.placing.placement
    if placement is None:
        return no_lift(editor)
    return None if any(placement.turn) else t("The object is not turned")


def _not_sized(editor: Editor) -> str | None:
    placement = editor.placing.placement
    if placement is None:
        return no_lift(editor)
    return t("The object has its own size") if placement.scale == 1 else None


COMMANDS: dict[str, Command] = {
    "reset_place": Command(
        "Back to where it was", "", lambda e: e.placing.reset(), _not_moved
    ),
    "reset_position": Command(
        "Reset position", "", lambda e: e.placing.reset_position(), _not_shifted
    ),
    "reset_turn": Command(
        "Reset turn", "", lambda e: e.placing.reset_turn(), _not_turned
    ),
    "reset_size": Command(
        "Reset size", "", lambda e: e.placing.reset_size(), _not_sized
    ),
    "ground": Command(
        "Move over the ground", "G", lambda e: e.placing.toggle_ground(), no_lift,
        lambda e: e.placing.is_grounded,
    ),
}  # fmt: skip
