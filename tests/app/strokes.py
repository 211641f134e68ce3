"""Strokes of a tool without a window: what the canvas would hand it. Places are canvas px."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from objectmorpher.editor.editor import Editor
from objectmorpher.tools.pointer import Button, Pointer
from objectmorpher.tools.registry import Tool

Place = np.ndarray | Sequence[float]


def press(
    editor: Editor, tool: Tool, place: Place, button: Button = Button.LEFT, **held: Any
) -> None:
    """A button goes down; `held`: keys, clicks, as `Pointer` has them."""
    pointer = Pointer(*place, button=button, is_down=True, **held)
    editor.hand.press(tool.press(editor, pointer), button)


def move(editor: Editor, *places: Place, **held: Any) -> None:
    for place in places:
        editor.hand.move(Pointer(*place, is_down=True, **held))


def release(editor: Editor, place: Place, **held: Any) -> None:
    editor.hand.move(Pointer(*place, **held))


def stroke(
    editor: Editor, tool: Tool, *places: Place, button: Button = Button.LEFT, **held: Any
) -> None:
    """Down at the first place, through the others, up at the last."""
    press(editor, tool, places[0], button, **held)
    move(editor, *places[1:], **held)
    release(editor, places[-1], **held)
