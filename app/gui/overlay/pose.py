"""Handles, pins, anchors, and the control points that they move."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2

from ..theme import theme
from .canvas import ACCENT, DARK, WHITE, Canvas

MAX_LINKED = 3  # links drawn from each control point


def draw_pose(canvas: Canvas) -> None:
    """For the Pose tool."""
    editor = canvas.editor
    document, thing = editor.document, editor.object
    if document is None or thing is None or thing.lifted is None:
        return
    if thing.handles:
        for at in canvas.on_photo(editor.derived.anchors(document, editor.current)):
            canvas.hollow_diamond(at, 4)
        rests = np.array([h.point for h in thing.handles])
        starts = canvas.at(editor.derived.project(document, editor.current, rests))
        ends = canvas.at(editor.posing.positions())
        for start, end in zip(starts, ends, strict=True):
            _draw_pull(canvas, start, end)
        for h, end in enumerate(ends):
            is_hovered = h == editor.hover.handle
            is_selected = h == editor.posing.handle
            _draw_handle(canvas, end, thing.handles[h].is_pin, is_selected, is_hovered)
    elif editor.hover.surface is None:
        _draw_hint_points(canvas)
    if editor.hover.surface is not None and not editor.hand.is_busy:
        _draw_surface_point(canvas)


def draw_control_points(canvas: Canvas) -> None:
    """The control points and their strongest links."""
    editor = canvas.editor
    assert editor.document is not None
    links = editor.derived.links(editor.document, editor.current, MAX_LINKED)
    is_there = ((links >= 0) & (links <= editor.document.photo.size)).all((1, 2))
    ends = canvas.at(links[is_there].reshape(-1, 2))
    dark, white = theme.u32(DARK, 0.25), theme.u32(WHITE, 0.4)
    for start, end in zip(ends[::2], ends[1::2], strict=True):
        canvas.draw.add_line(start, end, dark, 2.5)
        canvas.draw.add_line(start, end, white, 1.0)
    for at in canvas.on_photo(editor.derived.control_points(editor.document, editor.current)):
        canvas.dot(at, 1.8, alpha=0.8)


def _draw_hint_points(canvas: Canvas) -> None:
    """The control points, quietly, while there is no handle: here is something to drag."""
    editor = canvas.editor
    assert editor.document is not None
    for at in canvas.on_photo(editor.derived.control_points(editor.document, editor.current)):
        canvas.dot(at, 1.7)


def _draw_surface_point(canvas: Canvas) -> None:
    """Where a click would take the surface."""
    editor = canvas.editor
    surface = editor.hover.surface
    assert surface is not None
    assert editor.document is not None
    at = canvas.at(editor.document.photo.camera.project(surface.world))[0]
    if editor.hover.is_pin:
        canvas.diamond(at, 7, WHITE, 0.75)
        return
    canvas.ring(at, 7, ACCENT)
    canvas.draw.add_circle_filled(at, theme.pt(1.6), theme.u32(WHITE))


def _draw_pull(canvas: Canvas, start: ImVec2, end: ImVec2) -> None:
    """From where the point was in the photo to where it must be."""
    if np.hypot(end.x - start.x, end.y - start.y) < theme.pt(3):
        return
    canvas.line(start, end, WHITE)
    canvas.draw.add_circle_filled(start, theme.pt(3), theme.u32(DARK, 0.7))
    canvas.draw.add_circle_filled(start, theme.pt(2), theme.u32(WHITE))


def _draw_handle(
    canvas: Canvas, at: ImVec2, is_pin: bool, is_selected: bool, is_hovered: bool
) -> None:
    if is_selected:
        canvas.ring(at, 12, ACCENT)
    grow = 1.0 if is_hovered else 0.0
    if is_pin:
        canvas.diamond(at, 8 + grow, WHITE)
    else:
        canvas.disc(at, 5.5 + grow, ACCENT)
