"""Opening, saving, exporting."""

from __future__ import annotations

from collections.abc import Callable

from ..editor import Editor
from ..filing import Dialog
from .command import Command, never


def _want(dialog: Dialog) -> Callable[[Editor], None]:
    def run(editor: Editor) -> None:
        editor.filing.wanted = dialog

    return run


COMMANDS: dict[str, Command] = {
    "open": Command("Open…", "Ctrl+O", _want(Dialog.OPEN), never),
    "save": Command("Save session", "Ctrl+S", lambda e: e.filing.save()),
    "save_as": Command("Save session as…", "Ctrl+Shift+S", _want(Dialog.SAVE)),
    "export": Command("Export photo…", "Ctrl+E", lambda e: e.exporting.open()),
    "close": Command("Close", "Ctrl+W", lambda e: e.filing.guard(e.close_document)),
    "models": Command("Models…", "", lambda e: e.models.open(), never),
    "quit": Command("Quit", "Ctrl+Q", lambda e: e.filing.guard(e.quit), never),
}
