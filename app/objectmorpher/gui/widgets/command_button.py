"""A command as a button."""

from __future__ import annotations

from ...commands import COMMANDS, run, why_not
from ...editor.editor import Editor
from ...system.texts import t
from .widgets import button


def command_button(editor: Editor, name: str, label: str = "", width: float = -1.0) -> None:
    """It says `label`, else the command's name; `width` in points, -1 fills.

    Where the command cannot run it is greyed out, and the reason is its tooltip.
    """
    shown = label or t(COMMANDS[name].label)
    if button(shown, why_not=why_not(editor, name), width=width):
        run(editor, name)
