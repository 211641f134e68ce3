"""Drawings of the Look tool, and of pixels seen closely in every tool."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2

from objectmorpher_core.base.rotations import wrapped

from ...editor.view import PIXELS_FROM
from ...system.texts import t
from ..widgets.theme import theme
from .canvas import DARK, WHITE, CanvasPainter

DARKNESS, LIGHTNESS = 0.28, 0.16  # alpha of the pixel grid's lines, at their strongest
FAINTEST = 0.4  # x that, where the grid begins to show


def draw_look(canvas: CanvasPainter) -> None:
    """Draw the note that the object is seen from elsewhere."""
    editor, rect = canvas.editor, canvas.rect
    orbit = editor.looking.orbit
    if orbit is not None:
        yaw, pitch = round(wrapped(orbit.yaw)), round(orbit.pitch)
        text = t("Preview, turned by {yaw}° and {pitch}°", yaw=yaw, pitch=pitch)
        canvas.label(text, rect.x + theme.pt(12), rect.y + theme.pt(12))


def draw_pixel_grid(canvas: CanvasPainter) -> None:
    """Hairlines between the photo's pixels, dark and light, so that they are seen on any photo."""
    editor, view = canvas.editor, canvas.editor.view
    size = editor.photo_size
    if size is None or not view.is_at_pixels:
        return
    low = np.clip(np.floor((view.left, view.top)), 0, size).astype(int)
    shown = (view.width, view.height)
    high = np.clip(np.ceil(view.image_from_canvas(shown)), 0, size).astype(int)
    start, end = canvas.at(np.array([low, high], np.float64))
    strength = float(np.clip((view.zoom - PIXELS_FROM) / PIXELS_FROM, FAINTEST, 1.0))
    dark, light = theme.u32(DARK, DARKNESS * strength), theme.u32(WHITE, LIGHTNESS * strength)
    for color, shift in ((dark, 0.0), (light, 1.0)):
        for point in canvas.at(np.array([(x, 0) for x in range(low[0], high[0] + 1)], float)):
            x = round(point.x) + shift
            canvas.draw.add_line(ImVec2(x, start.y), ImVec2(x, end.y), color, 1.0)
        for point in canvas.at(np.array([(0, y) for y in range(low[1], high[1] + 1)], float)):
            y = round(point.y) + shift
            canvas.draw.add_line(ImVec2(start.x, y), ImVec2(end.x, y), color, 1.0)


# Before and after.


def draw_comparison(canvas: CanvasPainter) -> None:
    """The line between before and after, or what else than the edit alone is shown."""
    view, rect = canvas.editor.view, canvas.rect
    top = rect.y + theme.pt(12)
    if view.is_before or view.split is None:
        canvas.label(canvas.editor.looking.badge, rect.x + theme.pt(12), top)
        return
    x = rect.x + view.split * rect.width
    high, low = ImVec2(x, rect.y), ImVec2(x, rect.y + rect.height)
    canvas.line(high, low, WHITE, width=2, alpha=1.0)
    grip = ImVec2(x, rect.y + rect.height / 2)
    canvas.draw.add_circle_filled(grip, theme.pt(9), theme.u32(DARK, 0.7))
    canvas.draw.add_circle_filled(grip, theme.pt(7), theme.u32(WHITE))
    left = x - rect.x
    for text, side, room in ((t("Before"), 1.0, left), (t("After"), 0.0, rect.width - left)):
        if canvas.label_width(text) + theme.pt(12) <= room:
            canvas.label(text, x + theme.pt(12) * (1 - 2 * side), top, side)
