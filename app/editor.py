"""The editor without a window: its state, and one method for each thing a user may intend.

State: the history of documents and the preview of the stroke in progress; what is derived from
them; the view; the jobs in flight; what the user points at. Panels, menu, shortcuts, tools and
tests call the same methods. No GL, no ImGui, no window in here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core import edits
from objectmorpher_core.arrays import F64, Mask
from objectmorpher_core.document import Click, Document, EditObject, Placement, Prompt

from .derived import Derived, ObjectFrame, Spot
from .feedback import Hover, Message
from .filing import Filing
from .history import History
from .job_functions import WARM
from .jobs import JobError, Jobs
from .settings import Settings
from .tasks import Tasks
from .tools.pointer import Hand
from .view import Shown, ToolName, View

if TYPE_CHECKING:
    from objectmorpher_core.puppet import SurfacePoint

SELECT = "segment"  # kinds of jobs
NUDGE_LABEL = "Nudge point"
AT_REST = 2e-4  # x diameter: a smaller motion of a frame is none
DRAG_SECONDS = 0.012  # of a drag's frame, for the solver; the rest when the drag ends


class Editor:
    """Everything that the window shows and changes."""

    def __init__(self, settings: Settings, wake: Callable[[], None] = lambda: None) -> None:
        """`wake` is called from another thread when `poll` has something to do."""
        self.settings = settings
        self.view = View()
        self.hand = Hand()
        self.jobs = Jobs(WARM, wake)
        self.derived = Derived()
        self.tasks = Tasks(self)
        self.filing = Filing(self)
        self.derived.layers.ask = self.tasks.render_exact
        self.history: History | None = None
        self.preview: Document | None = None  # of the stroke in progress
        self._restless: Document | None = None  # the preview, as long as its pose is not at rest
        self.path: Path | None = None  # the session's file
        self.source: Path | None = None  # the photo's file
        self.current = 0  # index of the object that the tools change
        self.handle: int | None = None  # selected
        self.hover = Hover()
        self.rubber: tuple[float, float, float, float] | None = None  # box being drawn, canvas px
        self.message: Message | None = None
        self.is_over = False  # the window closes

    # What there is

    @property
    def document(self) -> Document | None:
        if self.preview is not None:
            return self.preview
        return self.history.document if self.history else None

    @property
    def object(self) -> EditObject | None:
        """The object that the tools change, if it exists already."""
        document = self.document
        if document is None or self.current >= len(document.objects):
            return None
        return document.objects[self.current]

    @property
    def mask(self) -> Mask | None:
        return self.object.mask if self.object else None

    @property
    def is_lifted(self) -> bool:
        return self.object is not None and self.object.lifted is not None

    @property
    def pending(self) -> Prompt | None:
        """What is being segmented now; shown at once, in the document when the mask is there."""
        return self.tasks.prompt

    @property
    def prompt(self) -> Prompt:
        """What the user said about the current object, asked or answered."""
        if self.pending is not None:
            return self.pending
        return self.object.prompt if self.object else Prompt()

    @property
    def photo_size(self) -> tuple[int, int] | None:
        return self.document.photo.size if self.document else None

    @property
    def is_saved(self) -> bool:
        return self.history is None or self.history.is_saved

    def is_on_photo(self, canvas_xy: np.ndarray) -> bool:
        if self.photo_size is None:
            return False
        xy = self.view.image_from_canvas(canvas_xy)
        return bool((xy >= 0).all() and (xy < self.photo_size).all())

    # Saying things

    def say(self, text: str) -> None:
        self.message = Message(text)

    def complain(self, text: str, details: str = "") -> None:
        """An error: one sentence, its first letter a capital."""
        self.message = Message(text[:1].upper() + text[1:], is_error=True, details=details)

    def complain_of(self, error: JobError) -> None:
        self.complain(error.sentence, error.trace)

    # Steps

    def start(self, document: Document) -> None:
        """A photo or a session was opened."""
        self.close_document()
        self.history = History(document)
        self.current = max(len(document.objects) - 1, 0)
        self.view.tool = ToolName.POSE if self.is_lifted else ToolName.SELECT
        self.view.split, self.view.shown = None, Shown.COMPOSITE
        self.view.fit(document.photo.size)
        if not self.is_lifted:
            self.tasks.read_photo()

    def close_document(self) -> None:
        self.hand.abort(self)
        self.jobs.cancel()
        self.tasks.forget()
        self.history = self.preview = self.path = self.source = self.handle = None
        self.hover, self.rubber, self.message = Hover(), None, None

    def quit(self) -> None:
        """Closes the program; nothing is asked here."""
        self.close_document()
        self.is_over = True

    def apply(self, label: str, document: Document) -> None:
        """`document` is the next step."""
        assert self.history is not None
        self.preview = None
        self.history.apply(label, document)

    def commit(self, label: str) -> None:
        """The preview becomes a step; without a label it is dropped."""
        preview, self.preview = self.preview, None
        if preview is not None and label:
            self.apply(label, preview)

    def undo(self) -> None:
        if self.hand.abort(self) or self.history is None:
            return
        if self.pending is not None:
            self.jobs.cancel(SELECT)
            return
        label = self.history.undo_label
        self.history.undo()
        self._after_travel(f"Undone: {label}" if label else "Nothing to undo")

    def redo(self) -> None:
        if self.hand.is_busy or self.history is None:
            return
        label = self.history.redo_label
        self.history.redo()
        self._after_travel(f"Done again: {label}" if label else "Nothing to redo")

    def _after_travel(self, text: str) -> None:
        """The document may have lost what the view points at."""
        self.hover = Hover()
        if self.object is None or (self.handle or 0) >= len(self.object.handles):
            self.handle = None
        if not self.is_lifted:
            self.view.tool = ToolName.SELECT
        self.say(text)

    def escape(self) -> None:
        """Takes back the stroke; without one, ends what runs; else deselects."""
        if self.hand.abort(self):
            self.rubber = None
        elif self.pending is not None:
            self.jobs.cancel(SELECT)
        else:
            self.handle = None
            self.message = None

    # Selecting

    def add_click(self, x: float, y: float, is_foreground: bool) -> None:
        """A point of the photo, image px, that belongs to the object or does not."""
        if self.photo_size is None:
            return
        if not (0 <= x < self.photo_size[0] and 0 <= y < self.photo_size[1]):
            return
        before = self.prompt
        if before.is_empty and not is_foreground:
            self.say("Click the object first; then right-click what does not belong to it")
            return
        clicks = (*before.clicks, Click(x, y, is_foreground))
        self.tasks.segment(
            Prompt(clicks, before.box, before.is_subject),
            "Add to selection" if is_foreground else "Remove from selection",
        )

    def set_box(self, box: tuple[float, float, float, float]) -> None:
        """The object is inside a box x0, y0, x1, y1 image px: a selection made anew."""
        self.tasks.segment(Prompt(box=box), "Select by box")

    def select_subject(self) -> None:
        self.tasks.segment(Prompt(is_subject=True), "Select subject")

    def clear_selection(self) -> None:
        self.jobs.cancel(SELECT)
        if self.document is not None and self.mask is not None:
            cleared = edits.set_mask(self.document, self.current, None, Prompt())
            self.handle = None
            self.view.tool = ToolName.SELECT
            self.apply("Clear selection", cleared)

    def choose_tool(self, tool: ToolName) -> None:
        """Changes the tool; the ones that need a lifted object say so."""
        self.hand.abort(self)
        if tool is not ToolName.SELECT and not self.is_lifted:
            self.say("Lift an object first")
            return
        self.view.tool = tool
        self.hover = Hover()

    # Objects

    @property
    def mask_share(self) -> float:
        """How much of the photo is selected, in [0, 1]."""
        mask = self.mask
        return 0.0 if mask is None else self.derived.share(mask)

    def start_object(self) -> None:
        """The next click selects another object."""
        if self.document is not None:
            self.hand.abort(self)
            self.current, self.handle = len(self.document.objects), None
            self.view.tool = ToolName.SELECT

    def choose_object(self, k: int) -> None:
        """The tools change object `k` now."""
        self.hand.abort(self)
        self.current, self.handle = k, None
        if not self.is_lifted:
            self.view.tool = ToolName.SELECT

    def toggle_visible(self, k: int) -> None:
        if self.document is not None:
            is_visible = not self.document.objects[k].is_visible
            label = "Show object" if is_visible else "Hide object"
            self.apply(label, edits.set_visible(self.document, k, is_visible))

    # Posing

    def surface_at(self, canvas_xy: np.ndarray) -> SurfacePoint | None:
        """The point of the object's surface that is seen at canvas px."""
        if self.document is None or not self.is_lifted:
            return None
        return self.derived.surface_at(self.document, self.current, self.view, canvas_xy)

    def handle_positions(self) -> F64:
        """Where the handles' targets are seen: (H, 2) image px."""
        if self.document is None or self.object is None or not self.object.handles:
            return np.empty((0, 2))
        targets = np.array([h.target for h in self.object.handles])
        return self.derived.project(self.document, self.current, targets)

    def handle_position(self, handle: int) -> Spot:
        assert self.document is not None
        assert self.object is not None
        return self.derived.spot(self.document, self.current, self.object.handles[handle].target)

    def start_handle(self, canvas_xy: np.ndarray, is_pin: bool) -> int | None:
        """Previews a new handle on the surface; its index, or None beside the object."""
        seen = self.surface_at(canvas_xy)
        if seen is None or self.document is None or self.object is None:
            return None
        k, item = self.current, self.object
        assert item.lifted is not None
        nearest = edits.nearest_control_point(item.lifted, seen.rest)
        for h, other in enumerate(item.handles):
            if other.control_point == nearest:  # one control point, one handle
                self.handle = h
                self.preview = self.document
                return h
        target = self.derived.unplaced(self.document, k, seen.world)
        changed = edits.add_handle(self.document, k, seen.rest, target, is_pin)
        self.preview = self._restless = self.derived.solved(changed, k, item.pose, DRAG_SECONDS)
        self.handle = len(item.handles)
        return self.handle

    def drag_handle(self, handle: int, spot: Spot) -> None:
        """Previews the handle at another place of the picture."""
        if self.document is None or self.object is None:
            return
        try:
            target = self.derived.object_point(self.document, self.current, spot)
        except ValueError as error:
            self.complain(str(error))
            return
        k, start = self.current, self.object.pose
        changed = edits.move_handle(self.document, k, handle, target)
        self.preview = self._restless = self.derived.solved(changed, k, start, DRAG_SECONDS)

    @property
    def is_restless(self) -> bool:
        """Whether the previewed pose still moves towards its rest."""
        return self._restless is not None and self._restless is self.preview

    def relax(self) -> None:
        """Goes on with a drag's solve: for a frame in which the pointer holds still."""
        if not self.is_restless:
            return
        document, self._restless = self._restless, None
        assert document is not None
        before = document.objects[self.current].pose
        after = self.derived.solved(document, self.current, before, DRAG_SECONDS)
        pose, lifted = after.objects[self.current].pose, after.objects[self.current].lifted
        assert before is not None and pose is not None and lifted is not None
        self.preview = after
        if np.abs(pose.points - before.points).max() > AT_REST * lifted.diameter:
            self._restless = after

    def settle(self) -> None:
        """Lets the preview's pose come to rest: at the end of a stroke that changed something."""
        document = self.history.document if self.history else None
        if self.preview is not None and self.preview is not document and self.object is not None:
            self.preview = self.derived.solved(self.preview, self.current, self.object.pose)

    def nudge_handle(self, dx: float, dy: float) -> None:
        """Moves the selected handle by image px; one step each."""
        if self.handle is not None and not self.hand.is_busy:
            spot = self.handle_position(self.handle)
            self.drag_handle(self.handle, spot.moved(np.array([dx, dy]), 0.0))
            self.settle()
            self.commit(NUDGE_LABEL)

    def select_handle(self, handle: int | None) -> None:
        self.handle = handle

    def remove_handle(self, handle: int | None = None) -> None:
        """Removes a handle, or the selected one; the object relaxes to what is left."""
        handle = self.handle if handle is None else handle
        if handle is None or self.document is None or self.hand.is_busy:
            return
        what = "pin" if self.object and self.object.handles[handle].is_pin else "handle"
        changed = edits.remove_handle(self.document, self.current, handle)
        self.handle = None
        self.apply(f"Remove {what}", self.derived.solved(changed, self.current, None))

    def set_auto_anchors(self, has_auto_anchors: bool) -> None:
        """Whether the far side of the object holds still by itself."""
        if self.document is not None and self.is_lifted:
            changed = edits.set_auto_anchors(self.document, self.current, has_auto_anchors)
            solved = self.derived.solved(changed, self.current, None)
            self.apply("Hold far side" if has_auto_anchors else "Free far side", solved)

    def clear_handles(self) -> None:
        """The object's shape as it was in the photo."""
        document, k = self.document, self.current
        if document is None or self.object is None or not self.object.handles:
            return
        for h in reversed(range(len(self.object.handles))):
            document = edits.remove_handle(document, k, h)
        self.handle = None
        self.apply("Reset pose", edits.set_pose(document, k, None))

    # Placing

    @property
    def placement(self) -> Placement | None:
        return self.object.placement if self.is_lifted and self.object else None

    def object_frame(self) -> ObjectFrame | None:
        """The object's outline box in the picture."""
        if self.document is None or not self.is_lifted:
            return None
        return self.derived.frame(self.document, self.current)

    def place(self, placement: Placement) -> None:
        """Previews the whole object elsewhere."""
        document = self.history.document if self.history else None
        if document is None or not self.is_lifted:
            return
        try:
            self.preview = edits.set_placement(document, self.current, placement)
        except ValueError as error:
            self.preview = None
            self.complain(str(error))

    def reset_placement(self) -> None:
        if self.placement is not None and not self.placement.is_identity:
            self.place(Placement())
            self.commit("Reset placement")

    # Time

    def poll(self) -> bool:
        """Takes in what the worker sent; once a frame. Whether anything changed."""
        is_changed = self.jobs.poll()
        return self.tasks.ensure_plate() or is_changed

    def set_theme(self, theme: str) -> None:
        """ "dark" or "light"."""
        self.settings = replace(self.settings, theme=theme)

    def shut_down(self) -> None:
        self.jobs.close()
