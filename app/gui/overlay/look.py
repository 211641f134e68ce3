"""For the Look tool."""

from __future__ import annotations

from .canvas import Canvas


def draw_look(canvas: Canvas) -> None:
    """What the Look tool shows over the photo."""
