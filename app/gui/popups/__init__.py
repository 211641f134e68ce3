"""Panels over the window: shortcuts, preferences, about. Nothing waits for them."""

from __future__ import annotations

from collections.abc import Callable

from ...editor import Editor
from ...shortcuts import Shortcuts
from ...view import Popup
from .about import draw_about
from .preferences import draw_preferences
from .shortcuts import ShortcutsPopup


class Popups:
    """Draws the one that is open."""

    def __init__(self, shortcuts: Shortcuts) -> None:
        self._shortcuts = shortcuts
        self._drawn: dict[Popup, Callable[[Editor], None]] = {
            Popup.SHORTCUTS: ShortcutsPopup(shortcuts).draw,
            Popup.PREFERENCES: draw_preferences,
            Popup.ABOUT: draw_about,
        }

    def draw(self, editor: Editor) -> None:
        """Once a frame, over the panels."""
        popup = editor.view.popup
        if popup is None:
            self._shortcuts.recording = None
        else:
            self._drawn[popup](editor)
