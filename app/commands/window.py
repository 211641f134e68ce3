"""Panels and dialogs that are no tool's."""

from __future__ import annotations

from collections.abc import Callable

from ..editor import Editor
from ..view import Popup
from .command import Command, never


def _toggle(popup: Popup) -> Command:
    def is_on(editor: Editor) -> bool:
        return editor.view.popup is popup

    return Command(popup.value, _KEYS.get(popup, ""), _toggler(popup), never, is_on)


def _toggler(popup: Popup) -> Callable[[Editor], None]:
    def run(editor: Editor) -> None:
        editor.view.popup = None if editor.view.popup is popup else popup

    return run


_KEYS = {Popup.SHORTCUTS: "F1", Popup.PREFERENCES: "Ctrl+,"}

COMMANDS: dict[str, Command] = {popup.name.lower(): _toggle(popup) for popup in Popup}
