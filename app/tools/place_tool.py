"""The whole object: move, turn, scale."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.arrays import F64
from objectmorpher_core.document import Placement

from .pointer import Button, Pointer, Shape, Stroke, has_moved

if TYPE_CHECKING:
    from ..editor import Editor

INSET = 16.0  # points between a corner and the canvas's edge, at least
SMALLEST_RING = 48.0  # points
LARGEST_RING = 0.42  # x the canvas's smaller side
REACH = 10.0  # points around a corner or beside the ring where a press takes it
TURN_SPEED = 0.4  # degrees per point that the pointer moves
DEPTH_STEP = 0.05  # object diameters per notch of the wheel
SNAP = 15.0  # degrees, with Shift
MIN_SCALE, MAX_SCALE = 0.02, 50.0
HINTS = {
    "move": "Drag moves the object · Wheel moves it in depth · Shift keeps one axis",
    "scale": "Drag a corner to scale the object",
    "roll": "Drag along the ring to roll the object · Shift turns in steps of 15°",
    "turn": "Drag turns the object in 3D · Shift keeps one axis",
}
IDLE_HINT = "Drag the object to move it, a corner to scale, the ring to roll, beside it to turn"
SHAPES = {"move": Shape.MOVE, "scale": Shape.SIZE, "roll": Shape.TURN, "turn": Shape.TURN}


@dataclass(frozen=True, eq=False)
class Gizmo:
    """What the object is taken by, canvas px. It stays within reach, however large the object."""

    corners: F64  # (4, 2) left top, right top, right bottom, left bottom
    centre: F64  # (2,)
    radius: float  # of the ring


def gizmo(editor: Editor) -> Gizmo | None:
    """The current object's, or None where nothing is lifted."""
    frame, view = editor.placing.frame(), editor.view
    if frame is None:
        return None
    size = np.array([view.width, view.height])
    inset = INSET * view.scale
    corners = view.canvas_from_image(frame.corners).clip(inset, np.maximum(size - inset, inset))
    centre = view.canvas_from_image(frame.centre)
    largest = LARGEST_RING * float(size.min())
    radius = float(np.clip(frame.radius * view.zoom, SMALLEST_RING * view.scale, largest))
    return Gizmo(corners, centre, radius)


class PlaceTool:
    """Drag the object to move it, a corner to scale, the ring to roll, elsewhere to turn."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        part = self.part_at(editor, pointer)
        start = editor.placing.placement
        if part is None or start is None or pointer.button is not Button.LEFT:
            return _ignore()
        return self._drag(editor, pointer, start, part)

    def _drag(self, editor: Editor, first: Pointer, start: Placement, part: str) -> Stroke:
        is_moved, depth = False, 0.0
        while (pointer := (yield)).is_down:
            is_moved = is_moved or has_moved(editor, first, pointer) or pointer.wheel != 0
            depth -= pointer.wheel * DEPTH_STEP
            if is_moved:
                changed = _CHANGES[part](editor, start, first, pointer)
                editor.placing.move_to(replace(changed, depth=changed.depth + depth))
        editor.commit(f"{part.capitalize()} object" if is_moved else "")

    def part_at(self, editor: Editor, pointer: Pointer) -> str | None:
        """What a press would do: "move", "scale", "roll" or "turn"."""
        shown = gizmo(editor)
        if shown is None:
            return None
        reach = REACH * editor.view.scale
        if np.linalg.norm(shown.corners - pointer.xy, axis=1).min() <= reach:
            return "scale"
        gap = float(np.linalg.norm(pointer.xy - shown.centre))
        if abs(gap - shown.radius) <= reach:
            return "roll"
        return "move" if editor.posing.surface_at(pointer.xy) is not None else "turn"

    def hover(self, editor: Editor, pointer: Pointer) -> Shape:
        part = self.part_at(editor, pointer)
        editor.hover = replace(editor.hover, part=part)
        return SHAPES.get(part or "", Shape.ARROW)

    def hint(self, editor: Editor) -> str:
        return HINTS.get(editor.hover.part or "", IDLE_HINT)


def _ignore() -> Stroke:
    while (yield).is_down:
        pass


def _one_axis(delta: np.ndarray, is_locked: bool) -> np.ndarray:
    """(2,) with its smaller part dropped where Shift is held."""
    if is_locked:
        delta = delta.copy()
        delta[np.abs(delta).argmin()] = 0.0
    return delta


def _move(editor: Editor, start: Placement, first: Pointer, now: Pointer) -> Placement:
    delta = _one_axis((now.xy - first.xy) / editor.view.zoom, now.shift)
    return replace(start, move=(start.move[0] + float(delta[0]), start.move[1] + float(delta[1])))


def _scale(editor: Editor, start: Placement, first: Pointer, now: Pointer) -> Placement:
    """By how much farther from the centre the corner was pulled."""
    shown = gizmo(editor)
    assert shown is not None
    centre = shown.centre
    ratio = np.linalg.norm(now.xy - centre) / max(float(np.linalg.norm(first.xy - centre)), 1.0)
    return replace(start, scale=float(np.clip(start.scale * ratio, MIN_SCALE, MAX_SCALE)))


def _roll(editor: Editor, start: Placement, first: Pointer, now: Pointer) -> Placement:
    shown = gizmo(editor)
    assert shown is not None
    centre = shown.centre
    (x0, y0), (x1, y1) = first.xy - centre, now.xy - centre
    angle = float(np.degrees(np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)))
    yaw, pitch, roll = start.turn
    roll += angle
    if now.shift:
        roll = round(roll / SNAP) * SNAP
    return replace(start, turn=(yaw, pitch, wrapped(roll)))


def _turn(editor: Editor, start: Placement, first: Pointer, now: Pointer) -> Placement:
    """What faces the camera follows the pointer: to the right is a negative yaw (DESIGN 6)."""
    delta = _one_axis((now.xy - first.xy) / editor.view.scale * TURN_SPEED, now.shift)
    yaw, pitch, roll = start.turn
    return replace(start, turn=(wrapped(yaw - delta[0]), wrapped(pitch + delta[1]), roll))


def wrapped(angle: float) -> float:
    """The same direction in (-180, 180] degrees."""
    return float(180.0 - (180.0 - angle) % 360.0)


_CHANGES = {"move": _move, "scale": _scale, "roll": _roll, "turn": _turn}
