"""For the Compose tool."""

from __future__ import annotations

from .canvas import Canvas


def draw_compose(canvas: Canvas) -> None:
    """What the Compose tool shows over the photo."""
