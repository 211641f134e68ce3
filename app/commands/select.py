"""The selection, and lifting what is selected."""

from __future__ import annotations

from .command import Command, cannot_lift, no_selection

COMMANDS: dict[str, Command] = {
    "subject": Command("Select subject", "Ctrl+Shift+A", lambda e: e.selection.select_subject()),
    "clear": Command("Clear selection", "Ctrl+D", lambda e: e.selection.clear(), no_selection),
    "lift": Command("Lift object", "Ctrl+L", lambda e: e.tasks.lift(), cannot_lift),
}
