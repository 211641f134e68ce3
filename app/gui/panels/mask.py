"""The Mask tool's settings."""

from __future__ import annotations

from ...editor import Editor


def draw_mask(editor: Editor) -> None:
    """In the inspector."""
