"""Dragging points of the lifted object, and what holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core import edits
from objectmorpher_core.arrays import F64
from objectmorpher_core.document import Document

from ..derived import Spot
from ..texts import t

if TYPE_CHECKING:
    from objectmorpher_core.puppet import SurfacePoint

    from ..editor import Editor

AT_REST = 2e-4  # x diameter: a smaller motion of a frame is none
DRAG_SECONDS = 0.012  # of a drag's frame, for the solver; the rest when the drag ends


class Posing:
    """The current object's handles and pose."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.handle: int | None = None  # selected
        self._restless: Document | None = None  # the preview, as long as its pose is not at rest

    # What there is

    def surface_at(self, canvas_xy: np.ndarray) -> SurfacePoint | None:
        """The point of the object's surface that is seen at canvas px."""
        editor = self._editor
        if editor.document is None or not editor.is_lifted:
            return None
        return editor.derived.surface_at(editor.document, editor.current, editor.view, canvas_xy)

    def positions(self) -> F64:
        """Where the handles' targets are seen: (H, 2) image px."""
        editor = self._editor
        if editor.document is None or editor.object is None or not editor.object.handles:
            return np.empty((0, 2))
        targets = np.array([h.target for h in editor.object.handles])
        return editor.derived.project(editor.document, editor.current, targets)

    def spot(self, handle: int) -> Spot:
        """Where a handle's target is seen, and how far away."""
        editor = self._editor
        assert editor.document is not None
        assert editor.object is not None
        target = editor.object.handles[handle].target
        return editor.derived.spot(editor.document, editor.current, target)

    @property
    def is_restless(self) -> bool:
        """Whether the previewed pose still moves towards its rest."""
        return self._restless is not None and self._restless is self._editor.preview

    # Selecting

    def select(self, handle: int | None) -> None:
        """The handle that keys and fields change."""
        self.handle = handle

    def forget_lost(self) -> None:
        """Deselects what the document does not have any more."""
        thing = self._editor.object
        if thing is None or (self.handle or 0) >= len(thing.handles):
            self.handle = None

    # Strokes

    def start_handle(self, canvas_xy: np.ndarray, is_pin: bool) -> int | None:
        """Previews a new handle on the surface; its index, or None beside the object."""
        editor = self._editor
        seen = self.surface_at(canvas_xy)
        if seen is None or editor.document is None or editor.object is None:
            return None
        k, item = editor.current, editor.object
        assert item.lifted is not None
        nearest = edits.nearest_control_point(item.lifted, seen.rest)
        for h, other in enumerate(item.handles):
            if other.control_point == nearest:  # one control point, one handle
                self.handle = h
                editor.preview = editor.document
                return h
        target = editor.derived.unplaced(editor.document, k, seen.world)
        changed = edits.add_handle(editor.document, k, seen.rest, target, is_pin)
        self._preview(changed, DRAG_SECONDS)
        self.handle = len(item.handles)
        return self.handle

    def drag(self, handle: int, spot: Spot) -> None:
        """Previews the handle at another place of the picture."""
        editor = self._editor
        if editor.document is None or editor.object is None:
            return
        try:
            target = editor.derived.object_point(editor.document, editor.current, spot)
        except ValueError as error:
            editor.complain(str(error))
            return
        changed = edits.move_handle(editor.document, editor.current, handle, target)
        self._preview(changed, DRAG_SECONDS)

    def _preview(self, changed: Document, seconds: float) -> None:
        """Solves for the handles of `changed`, from the pose that is shown."""
        editor = self._editor
        assert editor.object is not None
        start = editor.object.pose
        solved = editor.derived.solved(changed, editor.current, start, seconds)
        editor.preview = self._restless = solved

    def relax(self) -> None:
        """Goes on with a drag's solve: for a frame in which the pointer holds still."""
        if not self.is_restless:
            return
        editor = self._editor
        document, self._restless = self._restless, None
        assert document is not None
        before = document.objects[editor.current].pose
        after = editor.derived.solved(document, editor.current, before, DRAG_SECONDS)
        changed = after.objects[editor.current]
        assert before is not None and changed.pose is not None and changed.lifted is not None
        editor.preview = after
        motion = np.abs(changed.pose.points - before.points).max()
        if motion > AT_REST * changed.lifted.diameter:
            self._restless = after

    def settle(self) -> None:
        """Lets the preview's pose come to rest: at the end of a stroke that changed something."""
        editor = self._editor
        preview = editor.preview
        if preview is not None and preview is not editor.committed and editor.object is not None:
            editor.preview = editor.derived.solved(preview, editor.current, editor.object.pose)

    # Steps

    def nudge(self, dx: float, dy: float) -> None:
        """Moves the selected handle by image px; one step each."""
        editor = self._editor
        if self.handle is not None and not editor.hand.is_busy:
            spot = self.spot(self.handle)
            self.drag(self.handle, spot.moved(np.array([dx, dy]), 0.0))
            self.settle()
            editor.commit(t("Nudge point"))

    def remove(self, handle: int | None = None) -> None:
        """Removes a handle, or the selected one; the object relaxes to what is left."""
        editor = self._editor
        handle = self.handle if handle is None else handle
        if handle is None or editor.document is None or editor.hand.is_busy:
            return
        is_pin = editor.object is not None and editor.object.handles[handle].is_pin
        changed = edits.remove_handle(editor.document, editor.current, handle)
        self.handle = None
        solved = editor.derived.solved(changed, editor.current, None)
        editor.apply(t("Remove pin") if is_pin else t("Remove handle"), solved)

    def set_auto_anchors(self, has_auto_anchors: bool) -> None:
        """Whether the far side of the object holds still by itself."""
        editor = self._editor
        if editor.document is not None and editor.is_lifted:
            changed = edits.set_auto_anchors(editor.document, editor.current, has_auto_anchors)
            solved = editor.derived.solved(changed, editor.current, None)
            editor.apply(t("Hold far side") if has_auto_anchors else t("Free far side"), solved)

    def reset(self) -> None:
        """The object's shape as it was in the photo."""
        editor = self._editor
        document, k = editor.document, editor.current
        if document is None or editor.object is None or not editor.object.handles:
            return
        for h in reversed(range(len(editor.object.handles))):
            document = edits.remove_handle(document, k, h)
        self.handle = None
        editor.apply(t("Reset pose"), edits.set_pose(document, k, None))
