"""Where the whole object is."""

from __future__ import annotations

from .command import Command, no_lift

COMMANDS: dict[str, Command] = {
    "reset_place": Command("Reset placement", "", lambda e: e.placing.reset(), no_lift),
}
