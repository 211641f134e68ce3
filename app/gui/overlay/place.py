"""What the whole object is taken by."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from ...tools.place_tool import gizmo
from ..theme import theme
from .canvas import ACCENT, DARK, WHITE, Canvas


def draw_frame(canvas: Canvas) -> None:
    """For the Place tool."""
    editor = canvas.editor
    shown = gizmo(editor)
    if shown is None:
        return
    part = editor.hover.part
    corners = canvas.on_canvas(shown.corners)
    centre = canvas.on_canvas(shown.centre)[0]
    radius = shown.radius / canvas.ratio
    ring_role = WHITE if part != "roll" else ACCENT
    canvas.draw.add_circle(centre, radius, theme.u32(DARK, 0.5), 96, theme.pt(3.5))
    canvas.draw.add_circle(centre, radius, theme.u32(ring_role, 0.9), 96, theme.pt(1.5))
    closed = int(imgui.ImDrawFlags_.closed)
    canvas.draw.add_polyline(corners, theme.u32(DARK, 0.5), theme.pt(3), closed)
    canvas.draw.add_polyline(corners, theme.u32(WHITE, 0.8), theme.pt(1), closed)
    for corner in corners:
        canvas.square(corner, 5, ACCENT if part == "scale" else WHITE)
    arm = theme.pt(6)
    for dx, dy in ((arm, 0.0), (0.0, arm)):
        a, b = ImVec2(centre.x - dx, centre.y - dy), ImVec2(centre.x + dx, centre.y + dy)
        canvas.line(a, b, WHITE, alpha=1.0)
