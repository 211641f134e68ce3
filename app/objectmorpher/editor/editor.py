"""The editor without a window: its state, and the steps from one document to the next.

State: the history of documents and the preview of the stroke in progress; what is derived from
them; the view; the jobs in flight; what the user points at. What a user may intend with them are
the methods of its parts (`editing/`): selection, objects, posing, placing, composing. Panels,
menu, shortcuts, tools and tests call the same ones. No GL, no ImGui, no window in here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.document.model import Document, EditObject

from ..canvas.derived import Derived
from ..canvas.shape import Shapes
from ..system.freed_memory import give_back
from ..system.texts import sentence, t
from ..tools.pointer import Hand, Pointer
from ..worker.job_error import JobError
from ..worker.job_functions import WARM
from ..worker.jobs import RELUCTANCE, Jobs
from ..worker.threads import Chores
from .autosave import Autosave
from .candidate import Candidates, CloserLook
from .feedback import Action, Hover, Message
from .filing import OPEN, Filing
from .history import History
from .intents.composing import Composing
from .intents.computing import Computing
from .intents.exporting import Exporting
from .intents.hinting import Hinting
from .intents.landing import Landing
from .intents.leaving_out import LeavingOut
from .intents.looking import Looking
from .intents.masking import Masking
from .intents.methods import Methods
from .intents.models import Models
from .intents.objects import Objects
from .intents.placing import Placing
from .intents.posing import HandleNumbers, Posing
from .intents.refining import Refining
from .intents.rigging import Rigging
from .intents.selection import Selection
from .intents.shaping import Shaping
from .recovery import Recovery
from .refits import Refits
from .settings import Settings
from .tasks import SELECT, Tasks
from .view import USUAL_LEVEL, SelectMode, Shown, ToolName, View


class Editor:
    """Everything that the window shows and changes."""

    def __init__(self, settings: Settings, wake: Callable[[], None] = lambda: None) -> None:
        """`wake` is called from another thread when `poll` has something to do."""
        self.settings = settings
        self.view = View()
        self.hand = Hand()
        self.jobs = Jobs(WARM, wake)
        self.chores = Chores(wake)
        self.autosave, self.recovery = Autosave(self), Recovery(self)
        self.tasks, self.refits = Tasks(self), Refits(self)
        self.filing = Filing(self)
        self.selection, self.objects = Selection(self), Objects(self)
        self.masking, self.shaping = Masking(self), Shaping(self)
        self.leaving_out = LeavingOut(self)
        self.posing, self.placing = Posing(self), Placing(self)
        self.handle_numbers, self.rigging = HandleNumbers(self), Rigging(self)
        self.exporting, self.models = Exporting(self), Models(self)
        self.composing, self.looking = Composing(self), Looking(self)
        self.methods, self.computing = Methods(self), Computing(self)
        self.hinting, self.refining = Hinting(self), Refining(self)
        self.landing = Landing(self)
        self.candidates = Candidates(self)
        self.closer_look = CloserLook(self)
        self.derived = self._nothing_derived()
        self.history: History | None = None
        self.preview: Document | None = None  # of the stroke in progress
        self.path: Path | None = None  # the session's file
        self.source: Path | None = None  # the photo's file
        self.current = 0  # index of the object that the tools change
        self.hover = Hover()
        self.pointer: Pointer | None = None  # where it is now, on the canvas
        self.rubber: tuple[float, float, float, float] | None = None  # box being drawn, canvas px
        self.message: Message | None = None
        self.is_over = False  # the window closes

    # What there is

    @property
    def document(self) -> Document | None:
        if self.preview is not None:
            return self.preview
        return self.committed

    @property
    def committed(self) -> Document | None:
        """The document without the stroke in progress."""
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
    def is_click_awaited(self) -> bool:
        """Whether a click would begin a selection."""
        return (
            self.document is not None
            and self.view.tool is ToolName.SELECT
            and self.view.selecting.mode is SelectMode.CLICK
            and self.mask is None
            and self.tasks.question is None
        )

    @property
    def is_correction_awaited(self) -> bool:
        """Whether a click would correct what clicks, a box or the subject have selected."""
        return (
            self.document is not None
            and self.preview is None
            and self.view.tool is ToolName.SELECT
            and self.view.selecting.mode is SelectMode.CLICK
            and self.object is not None
            and self.object.mask is not None
            and not self.object.prompt.is_empty
            and self.tasks.question is None
        )

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

    def say(self, text: str, action: Action | None = None) -> None:
        self.message = Message(text, action=action)

    def complain(self, text: str, details: str = "", action: Action | None = None) -> None:
        """An error: one sentence, its first letter a capital."""
        self.message = Message(sentence(text), is_error=True, details=details, action=action)

    def complain_of(self, error: JobError) -> None:
        """A job that failed; where another try may help there is a button for it."""
        retry = Action(t("Retry"), error.retry) if error.retry else None
        self.complain(error.sentence, error.trace, retry)

    # Steps

    def start(self, document: Document, shapes: Shapes = ()) -> None:
        """A photo or a session was opened; `shapes` of its objects are ready."""
        is_of_another = self.committed is not None and self.committed.photo is not document.photo
        self.close_document()
        if is_of_another:
            self._forget_derived()
        self.derived.adopt(shapes)
        self.history = History(document, limit=self.settings.history_mb << 20)
        self.current = max(len(document.objects) - 1, 0)
        self.view.tool = ToolName.POSE if self.is_lifted else ToolName.SELECT
        self.view.split, self.view.shown = None, Shown.COMPOSITE
        self.view.selecting.level = USUAL_LEVEL
        self.view.orbit = None
        self.view.fit(document.photo.size)
        if not self.is_lifted:
            self.tasks.read_photo()
        self.recovery.offer()

    def close(self) -> None:
        """Closes the document, and lets go of what was computed for it: gigabytes, maybe."""
        self.close_document()
        self._forget_derived()

    def _forget_derived(self) -> None:
        self.derived = self._nothing_derived()
        give_back()

    def _nothing_derived(self) -> Derived:
        derived = Derived()
        derived.layers.ask, derived.lights.ask = self.tasks.render_exact, self.tasks.light
        return derived

    def close_document(self) -> None:
        self.hand.abort(self)
        self.jobs.cancel(patience=RELUCTANCE)
        self.chores.cancel(OPEN)
        self.exporting.close()
        self.objects.carried = None
        self.tasks.forget()
        self.refits.forget()
        self.composing.forget()
        self.hinting.forget()
        self.refining.forget()
        self.posing.forget()
        self.history = self.preview = self.path = self.source = None
        self.posing.select(None)
        self.hover, self.message = Hover(), None

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
        if self.tasks.question is not None:
            self.jobs.cancel(SELECT)
            return
        label = self.history.undo_label
        text = t("Undone: {label}", label=label) if label else t("Nothing to undo")
        self._travel(self.history.undo, text)

    def redo(self) -> None:
        if self.hand.is_busy or self.history is None:
            return
        label = self.history.redo_label
        text = t("Done again: {label}", label=label) if label else t("Nothing to redo")
        self._travel(self.history.redo, text)

    def travel(self, index: int) -> None:
        """To the step at `index` of the history, back or forth."""
        if self.hand.is_busy or self.history is None or index == self.history.cursor:
            return
        text = t("Back at: {label}", label=self.history.label(index))
        self._travel(partial(self.history.jump, index), text)

    def _travel(self, go: Callable[[], None], text: str) -> None:
        """Goes to another step, which may lack what the view points at."""
        before = self.committed
        go()
        assert before is not None
        self.objects.follow(before)
        self.hover = Hover()
        self.posing.forget_lost()
        self.objects.forget_lost()
        if not self.is_lifted and self.view.tool is not ToolName.MASK:
            self.view.tool = ToolName.SELECT
        self.say(text)

    def escape(self) -> None:
        """Takes back the stroke; without one, ends what runs; else deselects."""
        if self.hand.abort(self):
            return
        if self.objects.carried is not None:
            self.objects.carried = None
        elif self.tasks.question is not None:
            self.jobs.cancel(SELECT)
        else:
            if self.view.tool is ToolName.LOOK:
                self.looking.reset()
            self.posing.select(None)
            self.message = None

    # Tools

    def choose_tool(self, tool: ToolName) -> None:
        """Changes the tool; the ones that need a lifted object say so."""
        self.hand.abort(self)
        if tool not in (ToolName.SELECT, ToolName.MASK) and not self.is_lifted:
            self.say(t("Lift an object first"))
            return
        self.view.tool = tool
        self.hover = Hover()

    # Time

    def poll(self) -> bool:
        """Takes in what the worker sent; once a frame. Whether anything changed."""
        is_changed = self.jobs.poll()
        is_changed = self.chores.poll() or is_changed
        self.tasks.rehearse()
        is_changed = self.tasks.ensure_fronts() or is_changed
        is_changed = self.tasks.ensure_sample() or is_changed
        is_changed = self.refits.ensure() or is_changed
        is_changed = self.tasks.ensure_plate() or is_changed
        is_changed = self.composing.deliver() or is_changed
        is_changed = self.refining.deliver() or is_changed
        self.autosave.poll()
        self.candidates.poll(time.monotonic())
        is_changed = self.closer_look.poll() or is_changed
        return is_changed

    def shut_down(self) -> None:
        self.chores.close()
        self.autosave.close()
        self.jobs.close()
