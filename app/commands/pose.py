"""Handles and what holds the object."""

from __future__ import annotations

from .command import Command, no_handle, no_lift

COMMANDS: dict[str, Command] = {
    "remove_handle": Command(
        "Remove handle", "Delete", lambda e: e.posing.remove(), no_handle,
        other_keys=("Backspace",),
    ),
    "reset_pose": Command("Reset pose", "", lambda e: e.posing.reset(), no_lift),
}  # fmt: skip
