"""Opening, saving, exporting."""

from __future__ import annotations

from ..editor.filing import Dialog
from .command import Command, asks_for, never, no_photo

COMMANDS: dict[str, Command] = {
    "open": Command("Open…", "Ctrl+O", asks_for(Dialog.OPEN), never),
    "save": Command("Save session", "Ctrl+S", lambda e: e.filing.save()),
    "save_as": Command("Save session as…", "Ctrl+Shift+S", asks_for(Dialog.SAVE)),
    "export": Command("Export photo…", "Ctrl+E", lambda e: e.exporting.open()),
    "send_back": Command(
        "Send back",
        "Ctrl+Enter",
        lambda e: e.exporting.send_back(),
        lambda e: no_photo(e) or e.exporting.why_not_back,
    ),
    "close": Command("Close", "Ctrl+W", lambda e: e.filing.guard(e.close)),
    "models": Command("Models…", "", lambda e: e.models.open(), never),
    "quit": Command("Quit", "Ctrl+Q", lambda e: e.filing.guard(e.quit), never),
}
