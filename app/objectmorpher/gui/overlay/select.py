"""The selection: its edge, the clicks and the box that made it."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2

from ...tools.brush_tools import erases
from ..widgets.panes import fades
from ..widgets.theme import theme
from ..window.landmarks import mark_on_canvas
from .canvas import ACCENT, DARK, WARM, WHITE, CanvasPainter

DOTS = 6.0  # points between the dots of a dotted line
DOT = 1.4  # points, their radius


def draw_selection(canvas: CanvasPainter) -> None:
    """Draw the Select tool's selection and clicks."""
    editor = canvas.editor
    if not editor.landing.is_current_gone:
        draw_edge(canvas)
        _draw_prompt(canvas)
    candidate, share = fades.shown("candidate", editor.candidates.shown)
    document = editor.document
    if candidate is not None and document is not None and candidate.photo is document.photo:
        color = WARM if candidate.takes_away else WHITE
        for outline in editor.derived.contours(candidate.changed):
            _draw_dots(canvas, outline, color, share)
    draw_other(canvas)
    if editor.rubber is not None:
        draw_rubber(canvas)
    if editor.selection.path is not None:
        _draw_lasso(canvas, editor.selection.path)


def _draw_prompt(canvas: CanvasPainter) -> None:
    """The box and the clicks that made the selection."""
    editor, document, prompt = canvas.editor, canvas.editor.document, canvas.editor.selection.prompt
    if prompt.box is not None:
        x0, y0, x1, y1 = prompt.box
        if not editor.landing.is_current_moved:
            canvas.dashes(canvas.at(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])))
    for click in prompt.clicks:
        place = np.array([[click.x, click.y]])
        if editor.landing.is_current_moved and document is not None and click.is_foreground:
            place = editor.derived.carried(document, editor.current, place)
        _draw_click(canvas, canvas.at(place)[0], click.is_foreground)


def draw_edge(canvas: CanvasPainter) -> None:
    """The outline of what is selected, where that is seen now."""
    editor, document = canvas.editor, canvas.editor.document
    if editor.mask is None or document is None:
        return
    for outline in editor.derived.contours(editor.mask):
        if editor.landing.is_current_moved:
            outline = editor.derived.carried(document, editor.current, outline)
        canvas.polyline(canvas.at(outline), ACCENT)


def draw_left_out(canvas: CanvasPainter) -> None:
    """Dashed lines around what is offered to be added: dots would look like points to drag."""
    for outline in canvas.editor.leaving_out.outlines:
        canvas.dashes(canvas.at(outline))


def _draw_dots(canvas: CanvasPainter, outline: np.ndarray, color: str, share: float) -> None:
    """A dotted closed line (N, 2) image px: what a click would select, add or take away."""
    corners = canvas.editor.view.canvas_from_image(np.vstack([outline, outline[:1]]))
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(corners, axis=0), axis=1).cumsum()])
    places = np.arange(0, along[-1], theme.pt(DOTS) * canvas.ratio)
    dots = np.column_stack([np.interp(places, along, corners[:, axis]) for axis in (0, 1)])
    for at in canvas.on_canvas(dots):
        canvas.dot(at, DOT, 0.9 * share, color)


def draw_rubber(canvas: CanvasPainter) -> None:
    """The box that is being drawn."""
    assert canvas.editor.rubber is not None
    x0, y0, x1, y1 = canvas.editor.rubber
    low, high = canvas.on_canvas(np.array([[x0, y0], [x1, y1]]))
    canvas.draw.add_rect_filled(low, high, theme.u32(ACCENT, 0.12))
    canvas.draw.add_rect(low, high, theme.u32(ACCENT), thickness=theme.pt(1.5))


def _draw_lasso(canvas: CanvasPainter, path: list[np.ndarray]) -> None:
    """The line that is being drawn around something, canvas px (2,) each; its end is dashed."""
    points = canvas.on_canvas(np.array(path))
    if len(points) > 1:
        canvas.polyline(points, ACCENT, 1.5, is_closed=False)
        canvas.dashes([points[-1], points[0]], is_closed=False)


def _draw_click(canvas: CanvasPainter, at: ImVec2, is_foreground: bool) -> None:
    """A disc with + or -: shape and colour both tell."""
    canvas.disc(at, 6, ACCENT if is_foreground else WARM)
    arm, dark, width = theme.pt(3), theme.u32(DARK), theme.pt(2)
    canvas.draw.add_line(ImVec2(at.x - arm, at.y), ImVec2(at.x + arm, at.y), dark, width)
    if is_foreground:
        canvas.draw.add_line(ImVec2(at.x, at.y - arm), ImVec2(at.x, at.y + arm), dark, width)


# The selection's edge while it is painted, and the brush.


def draw_mask(canvas: CanvasPainter) -> None:
    """Draw the Mask tool's brush. During a stroke only the veil shows the edge, at once.

    Over an edit, whose veil waits for the stroke's end, a band shows where the brush went.
    """
    editor = canvas.editor
    masking, edging = editor.masking, editor.edging
    if masking.painting is None or editor.landing.is_edit_shown:
        draw_edge(canvas)
    if edging.stroke is not None:
        _draw_trail(canvas, edging.trail, edging.is_erasing, 2.0)
    elif masking.painting is not None and editor.landing.is_edit_shown:
        is_erasing, hardness = masking.painting.is_erasing, editor.view.brush.hardness
        _draw_trail(canvas, masking.trail, is_erasing, 1 + hardness)
    if editor.pointer is not None:
        canvas.brush(erases(editor, editor.pointer))


def _draw_trail(
    canvas: CanvasPainter, trail: list[np.ndarray], is_erasing: bool, radii: float
) -> None:
    """The band, so many radii of the brush wide, that a stroke in progress has covered."""
    view = canvas.editor.view
    color = theme.u32(WARM if is_erasing else ACCENT, 0.45)
    width = max(view.brush.radius * radii * view.zoom / canvas.ratio, 2.0)
    places = canvas.on_canvas(np.array(trail))
    if len(places) == 1:
        canvas.draw.add_circle_filled(places[0], width / 2, color)
    else:
        canvas.draw.add_polyline(places, color, width, 0)


# The object under the pointer that a click would make the current one.


def draw_other(canvas: CanvasPainter) -> None:
    """A dashed box around it, and its name."""
    editor, other = canvas.editor, canvas.editor.hover.other
    document = editor.document
    if other is None or document is None or editor.hand.is_busy or other >= len(document.objects):
        return
    if document.objects[other].lifted is None:
        return
    corners = canvas.at(editor.derived.frame(document, other).corners)
    name = document.objects[other].name
    canvas.dashes(corners, WHITE)
    canvas.label(name, corners[3].x, corners[3].y)
    mark_on_canvas(f"Other: {name}", corners[0], corners[2])
