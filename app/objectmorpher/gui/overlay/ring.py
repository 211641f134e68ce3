"""The ring around the current handle: how it is turned, and how far it went in depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from imgui_bundle import ImVec2

from ...tools.pose_tool import RING, RING_PART
from ..widgets.theme import theme
from .canvas import ACCENT, DARK, WHITE, Canvas

SCALE = 60.0  # points that the tick goes per object diameter of depth
FARTHEST = 0.4  # diameters that the scale shows
LEAST_DEPTH = 0.015  # diameters: less shows no scale
TICK = 5.0  # points, half the tick's width


def draw_ring(canvas: Canvas, at: ImVec2) -> None:
    """Around the handle at a window position."""
    editor = canvas.editor
    numbers = editor.handle_numbers.read()
    if numbers is None:
        return
    is_taken = editor.hover.part == RING_PART or bool(editor.posing.readout)
    radius = theme.pt(RING)
    canvas.draw.add_circle(at, radius, theme.u32(DARK, 0.5), 64, theme.pt(4))
    role = ACCENT if is_taken else WHITE
    canvas.draw.add_circle(at, radius, theme.u32(role, 0.9), 64, theme.pt(1.5))
    _draw_arc(canvas, at, numbers.turn)
    if abs(numbers.depth) > LEAST_DEPTH:
        _draw_depth(canvas, at, numbers.depth)
    if editor.posing.readout:
        canvas.label(editor.posing.readout, at.x, at.y - radius - theme.pt(36), side=0.5)


def _draw_arc(canvas: Canvas, at: ImVec2, turn: float) -> None:
    """From the top, clockwise, as far as the handle is turned."""
    radius = theme.pt(RING)
    end = np.radians(np.clip(turn, -360, 360))
    angles = np.linspace(0, end, max(int(abs(np.degrees(end)) / 4), 1) + 1)
    xy = np.column_stack([at.x + radius * np.sin(angles), at.y - radius * np.cos(angles)])
    if abs(turn) > 0.5:
        places: list[Any] = [ImVec2(x, y) for x, y in xy.tolist()]
        canvas.draw.add_polyline(places, theme.u32(ACCENT), theme.pt(4), 0)
    knob = ImVec2(*xy[-1])
    canvas.draw.add_circle_filled(knob, theme.pt(5.5), theme.u32(DARK, 0.8))
    canvas.draw.add_circle_filled(knob, theme.pt(4), theme.u32(WHITE))


def _draw_depth(canvas: Canvas, at: ImVec2, depth: float) -> None:
    """A scale at the right: up is farther away."""
    x = at.x + theme.pt(RING + 10)
    reach = theme.pt(SCALE * FARTHEST)
    canvas.line(ImVec2(x, at.y - reach), ImVec2(x, at.y + reach), WHITE, width=1.0, alpha=0.6)
    y = at.y - theme.pt(SCALE * float(np.clip(depth, -FARTHEST, FARTHEST)))
    half = theme.pt(TICK)
    rest = theme.pt(3)
    canvas.line(ImVec2(x - rest, at.y), ImVec2(x + rest, at.y), WHITE, width=1.0, alpha=0.6)
    canvas.line(ImVec2(x - half, y), ImVec2(x + half, y), ACCENT, width=2.5, alpha=1.0)
