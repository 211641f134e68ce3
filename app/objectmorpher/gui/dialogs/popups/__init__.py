"""Panels over the window: the command palette, help, preferences. Nothing waits for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from imgui_bundle import imgui

from ....editor.editor import Editor
from ....editor.shortcuts import Shortcuts
from ....editor.view import Popup
from ...widgets.panes import fades
from .help import draw_about, draw_help
from .palette import CommandPalette
from .preferences import ComputeFields, draw_preferences
from .shortcuts import ShortcutsPopup

LEAST = 0.01  # opacity: ImGui takes no input for what cannot be seen at all


class Popups:
    """Draws the one that is open."""

    def __init__(self, shortcuts: Shortcuts) -> None:
        self._shortcuts = shortcuts
        self._drawn: dict[Popup, Callable[[Editor], None]] = {
            Popup.PALETTE: CommandPalette().draw,
            Popup.HELP: draw_help,
            Popup.SHORTCUTS: ShortcutsPopup(shortcuts).draw,
            Popup.PREFERENCES: partial(draw_preferences, compute=ComputeFields()),
            Popup.ABOUT: draw_about,
        }

    def draw(self, editor: Editor) -> None:
        """Draw the open popup; once a frame, over the panels."""
        popup = editor.view.popup
        if popup is None:
            self._shortcuts.recording = None
        else:
            share = fades.shown("panel", popup)[1]
            imgui.push_style_var(imgui.StyleVar_.alpha, max(share, LEAST))
            self._drawn[popup](editor)
            imgui.pop_style_var()
