"""Panels and dialogs that are no tool's."""

from __future__ import annotations

from ..editor.editor import Editor
from ..editor.view import Popup
from .command import Command, never


def _toggle(popup: Popup) -> Command:
    def run(editor: Editor) -> None:
        editor.view.popup = None if is_on(editor) else popup

    def is_on(editor: Editor) -> bool:
        return editor.view.popup is popup

    return Command(popup.value, _KEYS.get(popup, ""), run, never, is_on)


_KEYS = {Popup.PALETTE: "Ctrl+K", Popup.SHORTCUTS: "F1", Popup.PREFERENCES: "Ctrl+,"}

COMMANDS: dict[str, Command] = {popup.name.lower(): _toggle(popup) for popup in Popup}
