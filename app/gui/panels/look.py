"""The Look tool's settings."""

from __future__ import annotations

from ...editor import Editor


def draw_look(editor: Editor) -> None:
    """In the inspector."""
