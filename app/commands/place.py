"""Where the whole object is."""

from __future__ import annotations

from ..editor import Editor
from ..texts import t
from .command import Command, Reason, no_lift


def _unless(is_there: Reason) -> Reason:
    return lambda editor: no_lift(editor) or is_there(editor)


def _not_moved(editor: Editor) -> str | None:
    placement = editor.placing.placement
    is_there = placement is not None and placement.is_identity
    return t("The object is where it was in the photo") if is_there else None


def _not_shifted(editor: Editor) -> str | None:
    p = editor.placing.placement
    is_there = p is not None and p.move == (0.0, 0.0) and p.depth == 0
    return t("The object is where it was in the photo") if is_there else None


def _not_turned(editor: Editor) -> str | None:
    p = editor.placing.placement
    return t("The object is not turned") if p is not None and not any(p.turn) else None


def _not_sized(editor: Editor) -> str | None:
    p = editor.placing.placement
    return t("The object has its own size") if p is not None and p.scale == 1 else None


COMMANDS: dict[str, Command] = {
    "reset_place": Command(
        "Back to where it was", "", lambda e: e.placing.reset(), _unless(_not_moved)
    ),
    "reset_position": Command(
        "Reset position", "", lambda e: e.placing.reset_position(), _unless(_not_shifted)
    ),
    "reset_turn": Command(
        "Reset turn", "", lambda e: e.placing.reset_turn(), _unless(_not_turned)
    ),
    "reset_size": Command(
        "Reset size", "", lambda e: e.placing.reset_size(), _unless(_not_sized)
    ),
    "ground": Command(
        "Stand on the ground", "G", lambda e: e.placing.toggle_ground(), no_lift,
        lambda e: e.view.is_grounded,
    ),
}  # fmt: skip
