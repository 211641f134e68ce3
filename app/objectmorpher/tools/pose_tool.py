"""Dragging points of the lifted object: the surface point stays under the pointer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..editor.view import BRUSHES, Hover, PoseMode
from ..system.texts import t
from . import pose_strokes
from .pointer import Button, Pointer, PointerShape, Stroke, ignore

if TYPE_CHECKING:
    from ..editor.editor import Editor


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
            return pose_strokes.turn(editor, pointer, editor.posing.handle, is_ring=True)
        if handle is None and (other := editor.objects.other_at(pointer.xy)) is not None:
            return pose_strokes.box(editor, pointer, other)
        if handle is None:
            return self._add(editor, pointer)
        if pointer.ctrl:
            return pose_strokes.turn(editor, pointer, handle, is_ring=False)
        return pose_strokes.drag(editor, pointer, handle, is_new=False)

    def _remove(self, editor: Editor, handle: int | None) -> Stroke:
        yield from ignore()
        if handle is not None:
            editor.posing.remove(handle)

    def _add(self, editor: Editor, pointer: Pointer) -> Stroke:
        """A new handle at the surface point under the pointer; a box where there is none."""
        is_pin = pointer.alt and not pointer.ctrl
        handle = editor.posing.start_handle(pointer.xy, is_pin, is_added=pointer.shift)
        if handle is None:
            yield from pose_strokes.box(editor, pointer)
        elif pointer.ctrl:
            yield from pose_strokes.turn(editor, pointer, handle, is_ring=False)
        else:
            is_new = editor.preview is not editor.committed
            yield from pose_strokes.drag(editor, pointer, handle, is_new)

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
