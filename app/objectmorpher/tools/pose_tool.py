"""Dragging points of the lifted object: the surface point stays under the pointer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import turn_about, turn_matrix, vector_from_matrix

from ..editor.view import BRUSHES, Hover, PoseMode
from ..system.texts import t
from .pointer import (
    SNAP,
    TURN_SPEED,
    Button,
    Pointer,
    PointerShape,
    Stroke,
    draw_box,
    has_moved,
    ignore,
    one_axis,
)

if TYPE_CHECKING:
    from ..canvas.derived import Spot
    from ..editor.editor import Editor

# The Pose tool's strokes on handles: moving, turning, choosing by a box.

DEPTH_STEP = 0.03  # object diameters per notch of the wheel
STEADY = 5.0  # points around a handle within which the pointer has no direction
BACK = 1.0  # degrees, by which a turn that ends where it began may be off
SIGHT = np.array([0.0, 0.0, 1.0])  # world, into the picture


@dataclass(frozen=True, eq=False)
class HeldHandles:
    """The places of the dragged handles when the stroke began."""

    spots: dict[int, Spot]
    lines: dict[int, tuple[F64, F64]]  # place and normal (3,) each, world


def drag(editor: Editor, start: Pointer, handle: int, is_new: bool) -> Stroke:
    """The selected handles follow the pointer, each at its own depth, which the wheel changes.

    Shift keeps one axis of the picture, Alt moves along the surface's normal. A press that does
    not move, or ends where it began, is a click: it chooses a handle that was there, or sets a new
    one. Solved for again, the pose would be another one where little holds the object.
    """
    posing, began = editor.posing, editor.preview
    before = posing.selected
    chosen = _chosen(before, handle, start.shift)
    posing.select(*chosen)
    held = HeldHandles({h: posing.spot(h) for h in chosen}, {h: posing.line(h) for h in chosen})
    posing.expect_drag(chosen)
    pointer, is_moved, depth = start, False, 0.0
    while (pointer := (yield)).is_down:
        depth -= pointer.wheel * DEPTH_STEP
        was_moved = is_moved
        is_moved = is_moved or has_moved(editor, start, pointer) or pointer.wheel != 0
        if is_moved and not was_moved:
            if is_new and start.alt:
                posing.unpin(handle)  # Alt and no motion would have been a pin
            posing.let_go(chosen)
        if is_moved:
            _follow(editor, held, start, pointer, depth)
    if depth == 0 and (pointer.xy == start.xy).all():
        editor.preview, is_moved = began, False
    if is_moved:
        count = len(chosen)
        posing.finish(t("Drag {count} points", count=count) if count > 1 else t("Drag point"))
    elif is_new:
        editor.commit(t("Add pin") if start.alt else t("Add handle"))
    else:
        editor.commit("")
        if start.shift and handle in before:
            posing.toggle(handle)
        elif not start.shift:
            posing.select(handle)


def _chosen(before: tuple[int, ...], handle: int, is_added: bool) -> tuple[int, ...]:
    """What a press on a handle selects: it alone, or the group it is in; the handle last."""
    if is_added or handle in before:
        return (*(h for h in before if h != handle), handle)
    return (handle,)


def _follow(editor: Editor, held: HeldHandles, start: Pointer, now: Pointer, depth: float) -> None:
    delta = (now.xy - start.xy) / editor.view.zoom  # (2,) image px
    if now.alt:
        camera = editor.opened.photo.camera
        place, normal = list(held.lines.values())[-1]  # of the handle that was taken
        gone = along_line(camera, place, normal, delta)
        editor.posing.move_all({h: p + gone * n for h, (p, n) in held.lines.items()})
        return
    delta = one_axis(delta, now)
    editor.posing.drag_all({h: spot.moved(delta, depth) for h, spot in held.spots.items()})


def turn(editor: Editor, start: Pointer, handle: int, is_ring: bool) -> Stroke:
    """The handle turns with the pointer's angle around it.

    On the ring Shift turns in steps; elsewhere Shift turns out of the picture's plane. What ends
    where it began, and has not gone round, has not turned.
    """
    posing, began = editor.posing, editor.preview
    if handle not in posing.selected:
        posing.select(handle)
    frame = editor.cache.facts.turn_of(editor.opened, editor.current)
    first = posing.turn_of(handle)
    roll = float(np.degrees(turn_about(frame @ first, SIGHT)))
    centre = editor.view.canvas_from_image(posing.spot(handle).xy)
    is_moved, swept, last = False, 0.0, start.xy
    try:
        while (pointer := (yield)).is_down:
            is_moved = is_moved or has_moved(editor, start, pointer)
            swept += _swept(last - centre, pointer.xy - centre, STEADY * editor.view.scale)
            last = pointer.xy
            if not is_moved:
                continue
            if pointer.shift and not is_ring:
                posing.turn(handle, first, _tilt(editor, start, pointer))
                continue
            angle = roll + swept
            if pointer.shift:
                angle = round(angle / SNAP) * SNAP
            posing.readout = f"{angle:.0f}°"
            posing.turn(handle, first, np.radians(angle - roll) * SIGHT)
        if (pointer.xy == start.xy).all() and abs(swept) < BACK:
            editor.preview, is_moved = began, False
        if is_moved:
            posing.finish(t("Turn point"))
        else:
            editor.commit(t("Add handle") if editor.preview is not editor.committed else "")
    finally:
        posing.readout = ""


def _swept(before: F64, after: F64, steady: float) -> float:
    """Degrees, clockwise, from one place around the handle to the next, (2,) canvas px each."""
    if min(np.linalg.norm(before), np.linalg.norm(after)) < steady:
        return 0.0
    across = before[0] * after[1] - before[1] * after[0]
    return float(np.degrees(np.arctan2(across, before @ after)))


def _tilt(editor: Editor, start: Pointer, now: Pointer) -> F64:
    """(3,) rotation vector, world: what faces the camera follows the pointer."""
    across, down = (now.xy - start.xy) / editor.view.scale * TURN_SPEED
    editor.posing.readout = f"{across:.0f}° · {down:.0f}°"
    return vector_from_matrix(turn_matrix(-float(across), float(down), 0.0))


def box(editor: Editor, start: Pointer, other: int | None = None) -> Stroke:
    """A box around handles selects them, Shift adds them; a click beside the object deselects.

    A click on the `other` object makes that one the current one.
    """
    end = yield from draw_box(editor, start)
    if end is not None:
        corners = editor.view.image_from_canvas(np.array([start.xy, end.xy]))
        editor.posing.select_box(corners.min(0), corners.max(0), start.shift)
    elif other is not None:
        editor.objects.take(other)
    elif not start.shift:
        editor.posing.select(None)


# A point that is moved along a line in space, led by a place of the picture.

LEAST_SLANT = 0.3  # of a line's length that its picture shows; less, and the point would run off
UP = np.array([0.0, -1.0])  # px


def along_line(
    camera: Camera, point: np.ndarray, direction: np.ndarray, delta: np.ndarray
) -> float:
    """Return how far a point goes along a line when its picture is led by `delta` (2,) px.

    The line goes through `point` (3,) world, along the unit `direction` (3,). The point's picture
    goes where the led place is nearest to the line's picture. Of a line that points nearly at the
    camera the picture is too short for that: there, up is outwards, towards the camera.
    """
    focal, depth = camera.focal, float(point[2])
    start = camera.project(point)
    ray = (start - (camera.cx, camera.cy)) / focal
    rate = (direction[:2] - direction[2] * ray) * focal / depth  # px per unit of the line
    length = float(np.linalg.norm(rate))
    usual = focal / depth
    if length < LEAST_SLANT * usual:
        towards = -np.sign(direction[2]) or 1.0
        return float(delta @ UP) * towards / usual
    along = rate / length
    gone = float(delta @ along)
    at = float((start - (camera.cx, camera.cy)) @ along) + gone
    steepness = focal * float(direction[:2] @ along) - at * float(direction[2])
    if steepness * length <= 0:  # past the line's vanishing point
        return gone / length
    return gone * depth / steepness


# The Pose tool's brushes: painting regions that move in a way of their own, cutting, gluing.

HINTS = {
    PoseMode.FREEZE: "Paint what must stay as it is now · Alt erases · [ and ] size the brush",
    PoseMode.STIFFEN: "Paint what must bend less · Alt erases · [ and ] size the brush",
    PoseMode.BODY: "Paint what must move as one rigid piece · Alt erases · [ and ] size the brush",
    PoseMode.CUT: "Draw a line where parts must come loose; it cuts right through · Alt erases",
    PoseMode.GLUE: "Drag from one part to another: the ends are joined · Alt erases glue",
}


def paint(editor: Editor, start: Pointer) -> Stroke:
    """Marks what the brush covers on the side that is seen; the release makes it so."""
    rigging, mode = editor.rigging, editor.view.pose.mode
    is_erasing = start.alt or start.button is Button.RIGHT
    try:
        pointer = start
        _extend(editor, start)
        while (pointer := (yield)).is_down:
            _extend(editor, pointer)
        nodes, way = rigging.painted, rigging.drawn
        if mode in BRUSHES:
            rigging.paint(mode, nodes, is_erasing)
        elif is_erasing:
            rigging.unseam(mode, nodes)
        elif mode is PoseMode.CUT:
            rigging.cut(way)
        else:
            rigging.glue(way)
    finally:
        rigging.painted, rigging.drawn = np.empty(0, np.int32), np.empty((0, 2))


def _extend(editor: Editor, pointer: Pointer) -> None:
    """The way up to here, and the control points under it, in the order they were met."""
    rigging = editor.rigging
    here = editor.view.image_from_canvas(pointer.xy)
    rigging.drawn = np.concatenate([rigging.drawn, here[None]])
    found = rigging.near(rigging.drawn[-2:])
    new = np.setdiff1d(found, rigging.painted)
    rigging.painted = np.concatenate([rigging.painted, new]).astype(np.int32)


def hint(editor: Editor) -> str:
    return t(HINTS[editor.view.pose.mode])


REACH = 10.0  # points around a handle where a press takes it
RING = 28.0  # points, radius of the ring around the current handle
RING_REACH = 6.0  # points beside the ring where a press takes it
RING_PART = "ring"


class PoseTool:
    """Click adds a handle, Alt-click a pin; dragging moves the point, Ctrl turns it."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        if editor.view.pose.mode is not PoseMode.DRAG:
            return paint(editor, pointer)
        handle = self.handle_at(editor, pointer)
        if pointer.button is Button.RIGHT:
            return self._remove(editor, handle)
        if handle is None and self.is_on_ring(editor, pointer):
            assert editor.posing.handle is not None
            return turn(editor, pointer, editor.posing.handle, is_ring=True)
        if handle is None and (other := editor.objects.other_at(pointer.xy)) is not None:
            return box(editor, pointer, other)
        if handle is None:
            return self._add(editor, pointer)
        if pointer.ctrl:
            return turn(editor, pointer, handle, is_ring=False)
        return drag(editor, pointer, handle, is_new=False)

    def _remove(self, editor: Editor, handle: int | None) -> Stroke:
        yield from ignore()
        if handle is not None:
            editor.posing.remove(handle)

    def _add(self, editor: Editor, pointer: Pointer) -> Stroke:
        """A new handle at the surface point under the pointer; a box where there is none."""
        is_pin = pointer.alt and not pointer.ctrl
        handle = editor.posing.start_handle(pointer.xy, is_pin, is_added=pointer.shift)
        if handle is None:
            yield from box(editor, pointer)
        elif pointer.ctrl:
            yield from turn(editor, pointer, handle, is_ring=False)
        else:
            is_new = editor.preview is not editor.committed
            yield from drag(editor, pointer, handle, is_new)

    def handle_at(self, editor: Editor, pointer: Pointer) -> int | None:
        """The handle a press would take."""
        positions = editor.posing.positions()  # (H, 2) image px
        if len(positions) == 0:
            return None
        gaps = np.linalg.norm(editor.view.canvas_from_image(positions) - pointer.xy, axis=1)
        nearest = int(gaps.argmin())
        return nearest if gaps[nearest] <= REACH * editor.view.scale else None

    def is_on_ring(self, editor: Editor, pointer: Pointer) -> bool:
        """Whether a press would turn the current handle by its ring."""
        current = editor.posing.handle
        if current is None or not editor.view.pose.has_ring:
            return False
        centre = editor.view.canvas_from_image(editor.posing.spot(current).xy)
        gap = float(np.linalg.norm(pointer.xy - centre)) / editor.view.scale
        return abs(gap - RING) <= RING_REACH

    def hover(self, editor: Editor, pointer: Pointer) -> PointerShape:
        if editor.view.pose.mode is not PoseMode.DRAG:
            editor.hover = Hover()
            return PointerShape.CROSS
        handle = self.handle_at(editor, pointer)
        is_ring = handle is None and self.is_on_ring(editor, pointer)
        is_beside = handle is None and not is_ring
        other = editor.objects.other_at(pointer.xy) if is_beside else None
        if other is not None:
            editor.hover = Hover(other=other)
            return PointerShape.HAND
        point = editor.posing.surface_at(pointer.xy) if is_beside else None
        is_pin = pointer.alt and not pointer.ctrl
        part = RING_PART if is_ring else None
        editor.hover = Hover(handle=handle, surface=point, is_pin=is_pin, part=part)
        if is_ring or (pointer.ctrl and not (is_beside and point is None)):
            return PointerShape.TURN
        if handle is not None:
            return PointerShape.MOVE
        return PointerShape.CROSS if point is not None else PointerShape.ARROW

    def hint(self, editor: Editor) -> str:
        if editor.view.pose.mode is not PoseMode.DRAG:
            return hint(editor)
        if editor.hand.is_busy:
            if editor.posing.readout:
                return t("Shift on the ring turns in steps of 15° · Esc takes it back")
            return t("Shift keeps one axis · Alt follows the surface's normal · Wheel: depth · Esc")
        if editor.hover.part == RING_PART:
            return t("Drag along the ring to turn the point · Shift: steps of 15° · R hides it")
        if editor.hover.handle is not None:
            return t("Drag moves it · Ctrl-drag turns it · Shift-click adds it · Del removes it")
        if editor.hover.other is not None:
            return t("Click chooses this object · Drag draws a box around handles")
        if editor.hover.surface is not None:
            return t(
                "Drag this point · Ctrl-drag turns it · Click sets a handle · Alt-click or P a pin"
            )
        return t("Drag a point of the object · Drag beside it selects handles · Space-drag pans")
