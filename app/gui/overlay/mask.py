"""The selection's edge while it is painted, and the brush."""

from __future__ import annotations

import numpy as np

from ...tools.mask_tool import erases
from ..theme import theme
from .canvas import ACCENT, WARM, Canvas
from .select import draw_edge


def draw_mask(canvas: Canvas) -> None:
    """For the Mask tool. During a stroke the veil alone shows the edge: it is there at once.

    Over an edit, which has no veil, a band shows where the brush went.
    """
    editor = canvas.editor
    if editor.masking.painting is None:
        draw_edge(canvas)
    elif editor.landing.is_edit_shown:
        draw_edge(canvas)
        _draw_trail(canvas)
    if editor.pointer is not None:
        canvas.brush(erases(editor, editor.pointer))


def _draw_trail(canvas: Canvas) -> None:
    """The band that a stroke in progress has covered."""
    masking, view = canvas.editor.masking, canvas.editor.view
    assert masking.painting is not None
    color = theme.u32(WARM if masking.painting.is_erasing else ACCENT, 0.45)
    width = max(view.brush.radius * (1 + view.brush.hardness) * view.zoom / canvas.ratio, 2.0)
    places = canvas.on_canvas(np.array(masking.trail))
    if len(places) == 1:
        canvas.draw.add_circle_filled(places[0], width / 2, color)
    else:
        canvas.draw.add_polyline(places, color, width, 0)
