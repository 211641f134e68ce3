"""Handles and what holds the object."""

from __future__ import annotations

from ..editor.editor import Editor
from ..system.texts import t
from .command import Command, no_handle, no_lift


def no_handles(editor: Editor) -> str | None:
    """Of what is done to all of them."""
    is_there = editor.object is not None and editor.object.handles
    return no_lift(editor) or (None if is_there else t("There is no handle yet"))


def _no_pose(editor: Editor) -> str | None:
    is_posed = editor.object is not None and editor.object.pose is not None
    return None if is_posed else no_handles(editor)


def _toggle_ring(editor: Editor) -> None:
    editor.view.pose.has_ring = not editor.view.pose.has_ring


def _toggle_influence(editor: Editor) -> None:
    editor.view.pose.has_influence = not editor.view.pose.has_influence


def _send_back(editor: Editor) -> None:
    editor.posing.send_back(editor.posing.selected, t("Reset handle"))


def _send_all_back(editor: Editor) -> None:
    thing = editor.object
    count = len(thing.handles) if thing else 0
    editor.posing.send_back(tuple(range(count)), t("Reset all handles"))


COMMANDS: dict[str, Command] = {
    "remove_handle": Command(
        "Remove handle", "Delete", lambda e: e.posing.remove(), no_handle,
        other_keys=("Backspace",),
    ),
    "select_handles": Command(
        "Select all handles", "Ctrl+A", lambda e: e.posing.select_all(), no_handles
    ),
    "reset_handle": Command("Reset handle", "", _send_back, no_handle),
    "reset_handles": Command("Reset all handles", "", _send_all_back, no_handles),
    "reset_pose": Command("Reset pose", "", lambda e: e.posing.reset(), _no_pose),
    "ring": Command(
        "Rotation ring", "R", _toggle_ring, no_lift, lambda e: e.view.pose.has_ring
    ),
    "mirror": Command(
        "Symmetry", "", lambda e: e.posing.mirroring.toggle(), no_lift,
        lambda e: e.view.pose.is_mirrored,
    ),
    "influence": Command(
        "Influence of the handle", "", _toggle_influence, no_lift,
        lambda e: e.view.pose.has_influence,
    ),
}  # fmt: skip
