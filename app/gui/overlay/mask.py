"""For the Mask tool."""

from __future__ import annotations

from .canvas import Canvas


def draw_mask(canvas: Canvas) -> None:
    """What the Mask tool shows over the photo."""
