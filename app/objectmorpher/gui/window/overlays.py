"""Which overlays the canvas shows now."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from imgui_bundle import ImVec2

from ...editor.editor import Editor
from ...editor.intents.landing import OF_THE_PHOTO
from ...editor.view import ToolName
from ..overlay.canvas import CanvasPainter
from ..overlay.card import draw_card
from ..overlay.compose import draw_compose
from ..overlay.legend import Legend
from ..overlay.look import draw_comparison, draw_look, draw_pixel_grid
from ..overlay.place import draw_frame
from ..overlay.pose import draw_control_points, draw_pose
from ..overlay.select import draw_left_out, draw_mask, draw_selection
from .landmarks import mark_on_canvas
from .layout import Rect

DRAWN: dict[ToolName, Callable[[CanvasPainter], None]] = {
    ToolName.SELECT: draw_selection,
    ToolName.MASK: draw_mask,
    ToolName.POSE: draw_pose,
    ToolName.PLACE: draw_frame,
    ToolName.LOOK: draw_look,
    ToolName.COMPOSE: draw_compose,
}


def draw_overlays(editor: Editor, rect: Rect, pixel_ratio: float) -> None:
    """Over the photo; `rect`: the canvas, `pixel_ratio`: canvas px per window unit."""
    view, canvas = editor.view, CanvasPainter(editor, rect, pixel_ratio)
    end = ImVec2(rect.x + rect.width, rect.y + rect.height)
    canvas.draw.push_clip_rect(ImVec2(rect.x, rect.y), end, True)
    if editor.photo_size is not None:
        mark_on_canvas("Photo", *canvas.at(np.array([(0, 0), editor.photo_size], np.float64)))
    draw_pixel_grid(canvas)
    if not view.is_before:
        if view.has_points and editor.is_lifted and editor.looking.orbit is None:
            draw_control_points(canvas)
        if editor.is_lifted or view.tool in OF_THE_PHOTO:
            DRAWN[view.tool](canvas)
        draw_left_out(canvas)
        Legend(editor, rect).draw()
    is_split = view.split is not None and editor.looking.orbit is None
    if editor.looking.badge or is_split:
        draw_comparison(canvas)
    canvas.draw.pop_clip_rect()
    draw_card(editor, rect)
