"""The whole object: move, turn, scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.rotations import matrix_from_vector, turn_matrix, turn_of, wrapped
from objectmorpher_core.document.model import Placement

from ..system.texts import t
from .gizmo import TURNS, Gizmo, Ring, gizmo
from .pointer import (
    SNAP,
    TURN_SPEED,
    Button,
    Pointer,
    PointerShape,
    Stroke,
    has_moved,
    ignore,
    one_axis,
)

if TYPE_CHECKING:
    from ..editor.editor import Editor

REACH = 10.0  # points around a corner, or beside a ring, where a press takes it
MIDDLE = 0.5  # x the outer ring's radius: so near to its centre the object is always moved
ROUND = 0.35  # openness from which a ring is turned by the pointer's angle about its centre
SLOW = 0.5  # x a ring's radius per radian: where it is seen to move slower, it runs into depth
LEAST_BALL = 0.4  # x the outer ring's radius: nearer to the middle a point is held by this ball
DEPTH_STEP = 0.05  # object diameters per notch of the wheel
SCALE_SNAP = 0.1  # with Shift
MIN_SCALE, MAX_SCALE = 0.02, 50.0
OTHER = "other"  # another object, which a press takes instead
SHAPES = {
    "move": PointerShape.MOVE, OTHER: PointerShape.MOVE, "scale": PointerShape.SIZE,
    "depth": PointerShape.SIZE, "horizon": PointerShape.HAND,
}  # fmt: skip

Change = Callable[[Pointer, float], Placement]  # of the pointer now, diameters by the wheel


class PlaceTool:
    """Drag an object to move it, a corner to scale, a ring to turn about its axis.

    Within the rings, or with Ctrl, it is turned as a ball is with a finger; elsewhere freely.
    """

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        part = self.part_at(editor, pointer)
        if part is None or pointer.button is not Button.LEFT:
            return ignore()
        editor.hover = replace(editor.hover, part=part)
        if part == "horizon":
            return self._drag_horizon(editor, pointer)
        if part == OTHER:
            return self._take_other(editor, pointer)
        return self._drag(editor, pointer, part)

    def _take_other(self, editor: Editor, pointer: Pointer) -> Stroke:
        """Another object becomes the current one and is moved; Esc takes both back."""
        other = editor.objects.other_at(pointer.xy)
        assert other is not None
        restore = editor.objects.take(other)
        editor.hover = replace(editor.hover, part="move", other=None)
        return _with_way_back(self._drag(editor, pointer, "move"), restore)

    def _drag(self, editor: Editor, first: Pointer, part: str) -> Stroke:
        is_moved, away = False, 0.0
        editor.placing.say_why_no_ground()
        change = _CHANGES[part](editor, first)
        while (pointer := (yield)).is_down:
            is_moved = is_moved or has_moved(editor, first, pointer) or pointer.wheel != 0
            away -= pointer.wheel * DEPTH_STEP
            changed = change(pointer, away)  # also of a slip: which way along a ring it began
            if is_moved:
                editor.placing.move_to(changed)
        editor.commit(_labels()[part] if is_moved else "")
        editor.placing.say_why_no_ground()  # a step takes back what was said before it

    def _drag_horizon(self, editor: Editor, first: Pointer) -> Stroke:
        start, is_moved = editor.placing.horizon, False
        while (pointer := (yield)).is_down:
            is_moved = is_moved or has_moved(editor, first, pointer)
            if is_moved:
                editor.placing.drag_horizon(start + (pointer.y - first.y) / editor.view.zoom)
        editor.commit(t("Move the horizon") if is_moved else "")

    def part_at(self, editor: Editor, pointer: Pointer) -> str | None:
        """Return the part that a press would take: the middle, then a grip, then the object."""
        shown = gizmo(editor)
        if shown is None:
            return None
        if pointer.ctrl:
            return "ball"
        reach = REACH * editor.view.scale
        from_centre = float(np.linalg.norm(pointer.xy - shown.centre)) / shown.radius
        if from_centre * shown.radius < 0.5 * shown.hole:
            return OTHER if editor.objects.other_at(pointer.xy) is not None else "move"
        if from_centre < MIDDLE and editor.posing.surface_at(pointer.xy) is not None:
            return OTHER if editor.objects.other_at(pointer.xy) is not None else "move"
        part = _handle_at(shown, pointer.xy, reach)
        if part is not None:
            return part
        if editor.objects.other_at(pointer.xy) is not None:
            return OTHER
        if editor.posing.surface_at(pointer.xy) is not None:
            return "move"
        is_horizon = shown.horizon is not None and abs(pointer.y - shown.horizon) <= reach
        if is_horizon:
            return "horizon"
        return "ball" if from_centre < 1.0 else "turn"

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        part = self.part_at(editor, pointer)
        other = editor.objects.other_at(pointer.xy) if part == OTHER else None
        editor.hover = replace(editor.hover, part=part, other=other)
        return PointerShape.ARROW if part is None else SHAPES.get(part, PointerShape.TURN)

    def hint(self, editor: Editor) -> str:
        text = _hints().get(editor.hover.part or "")
        return text or t("Drag the object to move it, a corner to scale it, a ring to turn it")


def _handle_at(shown: Gizmo, xy: np.ndarray, reach: float) -> str | None:
    """The corner, arrow or ring within reach of canvas px (2,)."""
    if np.linalg.norm(shown.corners - xy, axis=1).min() <= reach:
        return "scale"
    if shown.arrow.gap(xy) <= reach:
        return "depth"
    gaps = {part: ring.gap(xy) for part, ring in shown.rings.items()}
    nearest = min(gaps, key=gaps.__getitem__)
    return nearest if gaps[nearest] <= reach else None


def _with_way_back(stroke: Stroke, restore: Callable[[], None]) -> Stroke:
    """The stroke; `restore` is called where it is aborted."""
    is_over = False
    try:
        yield from stroke
        is_over = True
    finally:
        if not is_over:
            restore()


def _move(editor: Editor, first: Pointer) -> Change:
    """What was grabbed stays under the pointer; on the ground, what the object stands on."""
    hold = editor.placing.hold(first.xy)

    def change(now: Pointer, away: float) -> Placement:
        delta = one_axis((now.xy - first.xy) / editor.view.zoom, now)
        return hold.moved(delta, away)

    return change


def _depth(editor: Editor, first: Pointer) -> Change:
    """The grabbed point of the arrow stays under the pointer: f r / z px from the centre."""
    shown, hold = gizmo(editor), editor.placing.hold()
    assert shown is not None
    start = max(shown.arrow.along(first.xy), 1.0)

    def change(now: Pointer, away: float) -> Placement:
        ratio = start / max(shown.arrow.along(now.xy), 1.0)  # of the depths, now and at first
        return hold.moved(np.zeros(2), (ratio - 1) * hold.point[2] / hold.unit + away)

    return change


def _scale(editor: Editor, first: Pointer) -> Change:
    """By how much farther from what stays the corner was pulled: its foot, or its centre."""
    start, document = editor.placing.placement, editor.opened
    assert start is not None
    stays = editor.view.canvas_from_image(document.photo.camera.project(editor.placing.pivot()))
    reach = max(float(np.linalg.norm(first.xy - stays)), 1.0)

    def change(now: Pointer, away: float) -> Placement:
        scale = start.scale * float(np.linalg.norm(now.xy - stays)) / reach
        if now.shift:
            scale = round(scale / SCALE_SNAP) * SCALE_SNAP
        scale = float(np.clip(scale, MIN_SCALE, MAX_SCALE))
        return editor.placing.scaled(replace(start, depth=start.depth + away), scale)

    return change


def _along(part: str) -> Callable[[Editor, Pointer], Change]:
    """Turns about one axis by the angle that the pointer goes along its ring."""
    axis = TURNS.index(part)

    def begin(editor: Editor, first: Pointer) -> Change:
        shown, start = gizmo(editor), editor.placing.placement
        assert shown is not None and start is not None
        ring = shown.rings[part]
        went, before = _went(ring, first.xy), editor.placing.angles

        def change(now: Pointer, away: float) -> Placement:
            turn = list(before)
            turn[axis] += float(np.degrees(went(now.xy)))
            if now.shift:
                turn[axis] = round(turn[axis] / SNAP) * SNAP
            turn[axis] = wrapped(turn[axis])
            farther = replace(start, depth=start.depth + away)
            return editor.placing.turned_to(farther, (turn[0], turn[1], turn[2]))

        return change

    return begin


def _went(ring: Ring, first: np.ndarray) -> Callable[[np.ndarray], float]:
    """How far, radians, a pointer that began at canvas px (2,) has gone along a ring.

    By its angle about the centre, however far from there, where the ring is seen as one. A ring
    that is seen from its edge is followed; at its ends, where a few px would be a quarter turn,
    it goes by the way along its tangent, as a wheel does.
    """
    begun = last = ring.nearest(first)
    if ring.openness >= ROUND:
        angle, total = ring.angle_at(first), 0.0

        def about(xy: np.ndarray) -> float:
            nonlocal angle, total
            now = ring.angle_at(xy)
            total += wrapped_radians(now - angle)
            angle = now
            return total

        return about
    if ring.speed(begun) < SLOW * ring.reach:
        outward = ring.seen(np.array([begun]))[0] - ring.camera.project(ring.centre)
        side = 1.0 if ring.is_front(np.array([begun + 0.1]))[0] else -1.0
        inward = -outward / max(float(np.linalg.norm(outward)), 1e-9)
        return lambda xy: side * float((xy - first) @ inward) / ring.reach

    def along(xy: np.ndarray) -> float:
        nonlocal last
        last = ring.followed(xy, last)
        return last - begun

    return along


def _ball(editor: Editor, first: Pointer) -> Change:
    """The grabbed point stays under the pointer, as far as a turn about the middle can take it.

    Such a turn leaves it on a ball about the middle. Off that ball the pointer counts as at its
    rim. What is near the middle, where the ball would spin, and what is beside the object is held
    by a larger one.
    """
    start, document, shown = editor.placing.placement, editor.opened, gizmo(editor)
    assert start is not None and shown is not None
    camera, centre = editor.view.camera(document.photo.camera), editor.placing.centre()
    reach, side = shown.radius * centre[2] / camera.focal, -1.0
    seen = editor.posing.surface_at(first.xy)
    if seen is not None:
        arm = np.asarray(seen.world, np.float64) - centre
        reach = max(float(np.linalg.norm(arm)), LEAST_BALL * reach)
        side = 1.0 if arm @ seen.world > 0 and np.linalg.norm(arm) >= reach else -1.0

    def on_ball(xy: np.ndarray) -> np.ndarray:
        """(3,) unit, from the middle to where the ball is seen at canvas px (2,)."""
        ray = camera.unproject(xy, 1.0)
        ray /= np.linalg.norm(ray)
        along = float(ray @ centre)
        across = centre - along * ray  # from the ray's nearest point to the middle
        gap = float(np.linalg.norm(across))
        if gap < reach:
            return (side * np.sqrt(reach**2 - gap**2) * ray - across) / reach
        far = float(np.linalg.norm(centre))  # the rim is where a ray touches the ball
        outward, towards = -across / gap, centre / far
        outward -= (outward @ towards) * towards
        sine = min(reach / far, 1.0)
        rim = np.sqrt(1 - sine**2) * outward / np.linalg.norm(outward) - sine * towards
        return rim / np.linalg.norm(rim)

    begun, matrix = on_ball(first.xy), turn_matrix(*start.turn)

    def change(now: Pointer, away: float) -> Placement:
        there = on_ball(now.xy)
        across = np.cross(begun, there)
        size, along = float(np.linalg.norm(across)), float(begun @ there)
        angle = np.arctan2(size, along)
        if now.shift:
            angle = np.radians(SNAP) * round(np.degrees(angle) / SNAP)
        turned = matrix_from_vector(angle * across / size if size > 1e-9 else np.zeros(3))
        turn = start.turn if size <= 1e-9 else turn_of(turned @ matrix)
        return editor.placing.rolled(replace(start, depth=start.depth + away), turn)

    return change


def _turn(editor: Editor, first: Pointer) -> Change:
    """What faces the camera follows the pointer: to the right is a negative yaw."""
    start, (yaw, pitch, roll) = editor.placing.placement, editor.placing.angles
    assert start is not None

    def change(now: Pointer, away: float) -> Placement:
        delta = one_axis((now.xy - first.xy) / editor.view.scale * TURN_SPEED, now)
        turn = (wrapped(yaw - delta[0]), wrapped(pitch + delta[1]), roll)
        return editor.placing.turned_to(replace(start, depth=start.depth + away), turn)

    return change


def wrapped_radians(angle: float) -> float:
    """Return the same direction in (-pi, pi]."""
    return float(np.pi - (np.pi - angle) % (2 * np.pi))


_CHANGES: dict[str, Callable[[Editor, Pointer], Change]] = {
    "move": _move, "depth": _depth, "scale": _scale, "turn": _turn, "ball": _ball,
    **{part: _along(part) for part in TURNS},
}  # fmt: skip


def _labels() -> dict[str, str]:
    """What the steps are called."""
    turn = t("Turn object")
    return {
        "move": t("Move object"), "depth": t("Move object in depth"), "scale": t("Scale object"),
        "turn": turn, "ball": turn, "yaw": turn, "pitch": turn, "roll": t("Roll object"),
    }  # fmt: skip


def _hints() -> dict[str, str]:
    ring = t("Drag along the ring to turn the object · Shift turns in steps of 15°")
    return {
        OTHER: t("Click chooses this object · Drag moves it"),
        "move": t(
            "Drag moves the object · Ctrl-drag turns it · Wheel while dragging: depth"
            " · Shift: one axis"
        ),
        "depth": t("Drag the arrow to bring the object nearer or farther"),
        "scale": t("Drag a corner to scale the object · Shift scales in steps of 10 %"),
        "yaw": ring, "pitch": ring, "roll": ring,
        "turn": t("Drag turns the object in 3D · Shift keeps one axis"),
        "ball": t("Drag turns the object like a ball under the finger · Shift: steps of 15°"),
        "horizon": t("Drag the horizon to where it is in the photo"),
    }  # fmt: skip
