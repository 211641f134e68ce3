"""Handles and what holds the object."""

from __future__ import annotations

from ..editor.editor import Editor
from ..editor.view import ToolName
from ..system.texts import t
from .command import Command, no_handle, no_lift


def no_handles(editor: Editor) -> str | None:
    """Return the reason why a command for all handles cannot run: there are none."""
    is_there = editor.object is not None and editor.object.handles
    return no_lift(editor) or (None if is_there else t("There is no handle yet"))


def _no_pose(editor: Editor) -> str | None:
    is_posed = editor.object is not None and editor.object.pose is not None
    return None if is_posed else no_handles(editor)


def _toggle_ring(editor: Editor) -> None:
    editor.view.pose.has_ring = not editor.view.pose.has_ring


def _toggle_influence(editor: Editor) -> None:
    editor.view.pose.has_influence = not editor.view.pose.has_influence


def _remove(editor: Editor) -> None:
    """What is chosen in this tool: in Place it is the object."""
    if editor.view.tool is ToolName.PLACE:
        editor.objects.remove()
    else:
        editor.posing.remove()


def _nothing_to_remove(editor: Editor) -> str | None:
    return no_lift(editor) if editor.view.tool is ToolName.PLACE else no_handle(editor)


def _no_place_for_a_pin(editor: Editor) -> str | None:
    is_there = editor.hover.surface is not None or editor.hover.handle is not None
    return no_lift(editor) or (None if is_there else t("Point at the object to pin it there"))


def _no_key(editor: Editor) -> str | None:
    is_there = editor.keying.count > 0
    return no_lift(editor) or (None if is_there else t("There is no key pose yet"))


def _nothing_to_replace(editor: Editor) -> str | None:
    is_same = editor.keying.shown is not None
    return _no_key(editor) or (t("Nothing has changed since") if is_same else None)


def _send_back(editor: Editor) -> None:
    editor.posing.send_back(editor.posing.selected, t("Reset handle"))


def _send_all_back(editor: Editor) -> None:
    thing = editor.object
    count = len(thing.handles) if thing else 0
    editor.posing.send_back(tuple(range(count)), t("Reset all handles"))


COMMANDS: dict[str, Command] = {
    "remove_handle": Command(
        "Remove handle", "Delete", _remove, _nothing_to_remove,
        other_keys=("Backspace",),
    ),
    "pin": Command("Pin under the pointer", "P", lambda e: e.posing.pin(), _no_place_for_a_pin),
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
        lambda e: e.posing.mirroring.is_on,
    ),
    "influence": Command(
        "Influence of the handle", "", _toggle_influence, no_lift,
        lambda e: e.view.pose.has_influence,
    ),
    "add_key": Command(
        "Add key pose", "", lambda e: e.keying.add(), lambda e: e.keying.why_not_add
    ),
    "next_key": Command("Next key pose", "", lambda e: e.keying.step(1), _no_key),
    "previous_key": Command("Previous key pose", "", lambda e: e.keying.step(-1), _no_key),
    "replace_key": Command(
        "Replace key pose", "", lambda e: e.keying.replace(), _nothing_to_replace
    ),
    "remove_key": Command("Remove key pose", "", lambda e: e.keying.remove(), _no_key),
}  # fmt: skip
