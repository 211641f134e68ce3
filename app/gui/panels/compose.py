"""The Compose tool's settings."""

from __future__ import annotations

from ...editor import Editor


def draw_compose(editor: Editor) -> None:
    """In the inspector."""
