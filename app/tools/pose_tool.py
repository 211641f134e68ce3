"""Dragging points of the lifted object: the surface point stays under the pointer."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .pointer import Button, Pointer, Shape, Stroke, has_moved

if TYPE_CHECKING:
    from ..editor import Editor

REACH = 10.0  # points around a handle where a press takes it
DEPTH_STEP = 0.03  # object diameters per notch of the wheel


class PoseTool:
    """Click adds a handle, Alt-click a pin; dragging moves the point in the picture's plane."""

    def press(self, editor: Editor, pointer: Pointer) -> Stroke:
        handle = self.handle_at(editor, pointer)
        if pointer.button is Button.RIGHT:
            return self._remove(editor, handle)
        if handle is not None:
            return self._drag(editor, pointer, handle, is_new=False)
        return self._add(editor, pointer)

    def _remove(self, editor: Editor, handle: int | None) -> Stroke:
        while (yield).is_down:
            pass
        if handle is not None:
            editor.posing.remove(handle)

    def _add(self, editor: Editor, pointer: Pointer) -> Stroke:
        """A new handle at the surface point under the pointer."""
        handle = editor.posing.start_handle(pointer.xy, is_pin=pointer.alt)
        if handle is None:
            editor.posing.select(None)
            while (yield).is_down:
                pass
            return
        yield from self._drag(editor, pointer, handle, is_new=True)

    def _drag(self, editor: Editor, pointer: Pointer, handle: int, is_new: bool) -> Stroke:
        """The handle follows the pointer at its own depth, which the wheel changes."""
        editor.posing.select(handle)
        start, is_moved, depth = pointer, False, 0.0
        held = editor.posing.spot(handle)
        while (pointer := (yield)).is_down:
            depth -= pointer.wheel * DEPTH_STEP
            is_moved = is_moved or has_moved(editor, start, pointer) or pointer.wheel != 0
            if is_moved:
                delta = (pointer.xy - start.xy) / editor.view.zoom
                if pointer.shift:  # along one axis of the picture
                    delta[np.abs(delta).argmin()] = 0.0
                editor.posing.drag(handle, held.moved(delta, depth))
        editor.posing.settle()
        label = "Drag point" if is_moved else "Add pin" if start.alt else "Add handle"
        editor.commit(label if is_new or is_moved else "")

    def handle_at(self, editor: Editor, pointer: Pointer) -> int | None:
        """The handle a press would take."""
        positions = editor.posing.positions()  # (H, 2) image px
        if len(positions) == 0:
            return None
        gaps = np.linalg.norm(editor.view.canvas_from_image(positions) - pointer.xy, axis=1)
        nearest = int(gaps.argmin())
        return nearest if gaps[nearest] <= REACH * editor.view.scale else None

    def hover(self, editor: Editor, pointer: Pointer) -> Shape:
        handle = self.handle_at(editor, pointer)
        point = None if handle is not None else editor.posing.surface_at(pointer.xy)
        editor.hover = replace(editor.hover, handle=handle, surface=point, is_pin=pointer.alt)
        if handle is not None:
            return Shape.MOVE
        return Shape.CROSS if point is not None else Shape.ARROW

    def hint(self, editor: Editor) -> str:
        if editor.hand.is_busy:
            return "Wheel moves it in depth · Shift keeps one axis · Esc takes it back"
        if editor.hover.handle is not None:
            return "Drag moves the point · Right-click or Del removes it · Arrows nudge"
        if editor.hover.surface is not None:
            return "Drag this point · Click sets a handle · Alt-click sets a pin that stays"
        return "Point at the object and drag · Space-drag pans · Wheel zooms"
