"""The editor without a window: its parts, put together, and the steps that concern several.

What a user may intend are the methods of its parts (`intents/`): selection, objects, posing,
placing, composing. Panels, menu, shortcuts, tools and tests call the same ones. No GL, no ImGui,
no window in here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from objectmorpher_core.document.model import Document

from ..canvas.frame import Cache
from ..canvas.shape import Shapes
from ..system.freed_memory import give_back
from ..system.texts import t
from ..worker.jobs import RELUCTANCE
from ..worker.requests import READY
from .candidate import Candidates, CloserLook
from .filing import OPEN, Dialog, Filing, SampleOpening
from .history import History
from .intents.composing import Composing
from .intents.computing import Computing
from .intents.edging import Edging
from .intents.exporting import COPY, Exporting
from .intents.hinting import Hinting
from .intents.keying import Keying
from .intents.landing import Landing
from .intents.looking import LookingIntents
from .intents.masking import Masking
from .intents.methods import Methods
from .intents.models import Models
from .intents.objects import Objects, Pasting
from .intents.old_shadows import OldShadows
from .intents.painting import Painting
from .intents.placing import Placing
from .intents.posing import HandleNumbers, Posing
from .intents.refining import RefiningIntents
from .intents.rigging import Rigging
from .intents.selection import LeavingOut, Selection
from .intents.shaping import Shaping
from .recovery import Recovery
from .refits import Refits
from .settings import Settings
from .state import EditorState
from .tabs import Tabs
from .tasks import SELECT, WRITE, Tasks
from .view import USUAL_LEVEL, Hover, Shown, ToolName


class Editor(EditorState):
    """Everything that the window shows and changes."""

    def __init__(self, settings: Settings, wake: Callable[[], None] = lambda: None) -> None:
        """`wake` is called from another thread when `poll` has something to do."""
        super().__init__(settings, wake)
        self.posing, self.rigging = Posing(self), Rigging(self)
        self.handle_numbers = HandleNumbers(self, self.posing)
        self.placing, self.objects = Placing(self, self.posing), Objects(self, self.posing)
        self.keying = Keying(self, self.posing)
        self.landing = Landing(self, self.objects)
        self.looking = LookingIntents(self, self.landing)
        self.tasks = Tasks(self, self.posing)
        self.refits = Refits(self, self.posing, self.tasks)
        self.masking = Masking(self, self.landing, self.posing)
        self.edging = Edging(self, self.landing, self.masking)
        self.candidates = Candidates(self, self.tasks)
        self.closer_look = CloserLook(self, self.tasks)
        self.selection = Selection(
            self, self.tasks, self.masking, self.candidates, self.closer_look
        )
        self.shaping = Shaping(self, self.landing, self.posing, self.tasks)
        self.computing = Computing(self, self.tasks)
        self.methods = Methods(self, self.computing, self.tasks)
        self.models = Models(self, self.methods, self.shaping, self.tasks)
        self.composing = Composing(self, self.methods, self.tasks)
        self.old_shadows = OldShadows(self, self.composing, self.choose_tool)
        self.hinting = Hinting(self, self.composing)
        self.painting = Painting(self)
        self.refining, self.exporting = RefiningIntents(self, self.methods), Exporting(self)
        self.tabs = Tabs(self, self.posing, self.tasks, self.start, self.leave)
        self.filing = Filing(self, self.tasks, self.exporting, self._uses(), self.tabs)
        self.leaving_out = LeavingOut(self, self.landing)
        self.sample = SampleOpening(self, self.filing, self.selection, self.tasks)
        self.recovery = Recovery(self, self.tabs)
        self.pasting = Pasting(self, self.objects, self.tabs)
        self._pollers = self._in_order()
        self._ask_elsewhere()

    def _uses(self) -> dict[Dialog, Callable[[Path], None]]:
        """What is done with the files that were chosen, but for documents and exports."""
        return {
            Dialog.MASK_OPEN: self.masking.open_file,
            Dialog.MASK_SAVE: self.masking.write_file,
            Dialog.SHAPE_OPEN: self.shaping.open_file,
            Dialog.VIEW_OPEN: lambda path: self.shaping.add_photo(self.tabs.selected(path) or path),
            Dialog.MODEL_OPEN: self.models.add,
            Dialog.MODEL_FOLDER: self.models.hub.use_folder,
            Dialog.PROFILE_OPEN: self.looking.use_profile,
            Dialog.PROOF_OPEN: self.looking.proof_by,
        }

    def _in_order(self) -> tuple[Callable[[], bool], ...]:
        """What is called once a frame; each says whether it has changed anything."""
        tasks = self.tasks
        return (
            self.jobs.poll, self.chores.poll, self.answers.deliver, tasks.rehearse,
            tasks.ensure_fronts,
            self.refits.ensure, tasks.ensure_plate, self.composing.deliver, self.painting.deliver,
            self.refining.deliver,
            self.tabs.keep_safe, self.candidates.poll, self.closer_look.poll, self.sample.poll,
            self.leaving_out.poll, self.old_shadows.poll, self.filing.poll,
        )  # fmt: skip

    def _ask_elsewhere(self) -> None:
        """What takes longer than a frame is computed beside it."""
        self.cache.layers.ask, self.cache.lights.ask = self.tasks.render_exact, self.tasks.light

    # Steps

    def start(self, document: Document, shapes: Shapes = ()) -> None:
        """A photo or a session was opened; `shapes` of its objects are ready."""
        is_of_another = self.committed is not None and self.committed.photo is not document.photo
        self.close_document()
        if is_of_another:
            self._forget_derived()
        self.derived.adopt(shapes)
        self.tab.history = History(document, limit=self.settings.history_mb << 20)
        self.tab.exported, self.tab.asked = frozenset(), None
        self.current = max(len(document.objects) - 1, 0)
        self.view.tool = ToolName.POSE if self.is_lifted else ToolName.SELECT
        self.view.split, self.view.shown = None, Shown.COMPOSITE
        self.view.selecting.level = USUAL_LEVEL
        self.view.orbit = None
        self.view.fit(document.photo.size)
        self.view.suit_brush(document.photo.size)
        if not self.is_lifted:
            self.tasks.read_photo()
        self.recovery.offer()

    def leave(self) -> None:
        """The tab is not shown any more: what runs for it ends, and what was computed for it goes.

        That may be gigabytes.
        """
        self._stop()
        self.recovery.put_off()
        self.message, self.hover = None, Hover()
        self._forget_derived()

    def _forget_derived(self) -> None:
        patience, self.cache = self.cache.frame_time, Cache()
        self.cache.frame_time = patience
        self._ask_elsewhere()
        give_back()

    def close_document(self) -> None:
        """The tab shows none."""
        self.chores.cancel(OPEN)
        self._stop()
        self.forget_document()

    def _stop(self) -> None:
        """Ends what was begun and asked about the document; files are written to their end."""
        self.hand.abort(self)
        self.preview = None
        for kind in self.jobs.kinds:
            if kind != COPY and not kind.startswith(WRITE):
                self.jobs.cancel(kind, RELUCTANCE)
        for kind in self.chores.kinds:
            if kind.startswith(READY):
                self.chores.cancel(kind)
        self.exporting.close()
        self.objects.carried = self.objects.renaming = None
        self.answers.forget()
        self.tasks.forget()
        self.masking.forget()
        self.refits.forget()
        self.edging.forget()
        self.composing.forget()
        self.old_shadows.forget()
        self.painting.forget()
        self.hinting.forget()
        self.refining.forget()
        self.posing.forget()
        self.keying.forget()
        self.posing.select(None)

    def quit(self) -> None:
        """Closes the program; nothing is asked here."""
        self.close_document()
        self.tabs.forget_all()
        self.is_over = True

    @property
    def undo_label(self) -> str | None:
        """Of what `undo` takes back: a stroke that is not laid yet, or the last step; or None."""
        waiting = self._newest_waiting
        return (waiting or self.history).undo_label if self.history is not None else None

    @property
    def _newest_waiting(self) -> Painting | Composing | Edging | Masking | None:
        """What has a stroke that is not laid yet and came after the last step; None: nothing."""
        waiting = (self.painting, self.composing, self.edging, self.masking)
        newest = max(waiting, key=lambda strokes: strokes.newest if strokes.undo_label else -1)
        step = None if self.history is None else self.history.step
        is_newer = newest.undo_label and step is not None and newest.newest > step.number
        return newest if is_newer else None

    def undo(self) -> None:
        if self.hand.abort(self) or self.history is None:
            return
        if self.tasks.question is not None:
            self.jobs.cancel(SELECT)
            return
        label = self.undo_label
        text = t("Undone: {label}", label=label) if label else t("Nothing to undo")
        if (strokes := self._newest_waiting) is not None:
            strokes.take_back()
            self.say(text)
            return
        self._travel(self.history.undo, text)

    def redo(self) -> None:
        if self.hand.is_busy or self.history is None:
            return
        label = self.history.redo_label
        text = t("Redone: {label}", label=label) if label else t("Nothing to redo")
        self._travel(self.history.redo, text)

    def travel(self, index: int) -> None:
        """Go to the step at `index` of the history, back or forth."""
        if self.hand.is_busy or self.history is None or index == self.history.cursor:
            return
        text = t("Back at: {label}", label=self.history.label(index))
        self._travel(partial(self.history.jump, index), text)

    def keep_snapshot(self, name: str = "") -> None:
        """Keep the edit as it is under a name, by default the next number."""
        history = self.history
        if history is None or self.hand.is_busy:
            return
        taken = {step.label for step in history.snapshots}
        numbered = (t("Snapshot {number}", number=n) for n in range(1, len(taken) + 2))
        name = name.strip() or next(label for label in numbered if label not in taken)
        history.keep(name)
        self.say(t("{name} is kept in the history (Ctrl+H)", name=name))

    def take_snapshot(self, name: str) -> None:
        """Go to the snapshot of this name: a step of its own, so that nothing is lost."""
        history = self.history
        if history is None or self.hand.is_busy:
            return
        found = next(step.document for step in history.snapshots if step.label == name)
        self._travel(partial(history.apply, name, found), t("Back at: {label}", label=name))

    def _travel(self, go: Callable[[], None], text: str) -> None:
        """Goes to another step, which may lack what the view points at."""
        before, own, history = self.committed, self.current, self.history
        assert before is not None and history is not None
        cursor, self.preview = history.cursor, None
        go()
        self.objects.follow(before, history.cursor > cursor)
        self.hover = Hover()
        self.posing.follow(before.objects[own] if own < len(before.objects) else None)
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
        elif self.old_shadows.offer is not None:
            self.old_shadows.refuse()
        else:
            if self.view.tool is ToolName.LOOK:
                self.looking.reset()
            self.posing.select(None)
            self.message = None

    # Tools

    def choose_tool(self, tool: ToolName) -> None:
        """Changes the tool; the ones that need a lifted object say so."""
        self.hand.abort(self)
        self.preview = None  # of a field that may vanish before it is let go
        if tool not in (ToolName.SELECT, ToolName.MASK) and not self.is_lifted:
            self.say(self.why_no_shape)
            return
        if tool is not self.view.tool and not self.objects.is_copy_announced:
            self.drop_hint()
        self.view.tool = tool
        self.hover = Hover()

    # Time

    def poll(self) -> bool:
        """Takes in what was computed elsewhere; once a frame. Whether more than progress came."""
        return any([poll() for poll in self._pollers])

    def shut_down(self) -> None:
        self.chores.close()
        self.tabs.end()
        self.jobs.close()
