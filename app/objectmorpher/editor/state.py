"""What the editor holds: the document and its history, what is shown, what runs, what was said.

The intents (`intents/`) take this as what they work on, and besides it only the intents that they
use; the editor (`editor.py`) puts them together. No GL, no ImGui, no window in here.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.document import hold_edits, visitor_edits
from objectmorpher_core.document.model import Document, EditObject

from ..canvas.derived import Derived
from ..canvas.frame import Cache
from ..canvas.shape import Shapes
from ..system.texts import sentence, t
from ..tools.pointer import Hand, Pointer
from ..worker.job_functions import WARM
from ..worker.jobs import Jobs
from ..worker.requests import LIFT, READY, Chores, JobError
from .autosave import Autosave
from .export_plan import What
from .history import CLOCK, History, Step
from .settings import Settings
from .view import CHANGING, MOVING, Action, ComposeView, Hover, StatusMessage, ViewState

if TYPE_CHECKING:
    from objectmorpher_core.lift.registration.other_photo import OtherPhoto


class Answers:
    """What a worker has made: it is taken in, in its order, as soon as the hand is idle."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self._waiting: list[Callable[[], None]] = []

    def add(self, take: Callable[[], None]) -> None:
        self._waiting.append(take)

    def take(self, take: Callable[[], None]) -> None:
        """Takes it in at once, or after the stroke or the field in progress."""
        self.add(take)
        self.deliver()

    def forget(self) -> None:
        self._waiting = []

    def deliver(self) -> bool:
        """Takes in what waits; whether there was anything."""
        editor = self._editor
        if not self._waiting or editor.hand.is_busy or editor.preview is not None:
            return False
        waiting, self._waiting = self._waiting, []
        for take in waiting:
            take()
        return True


class LabelledChange(Protocol):
    """A change that becomes a step."""

    @property
    def label(self) -> str: ...


C = TypeVar("C", bound=LabelledChange)


class WaitingChanges(Generic[C]):
    """Changes that become steps one after the other; a job makes the first one."""

    kind = ""  # of these jobs

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self._waiting: list[C] = []
        self.newest = 0  # number of the last one, as of the history's steps

    def forget(self) -> None:
        """Drop them all, such as those of another document."""
        self._waiting.clear()

    @property
    def undo_label(self) -> str | None:
        """Of the last one, which is not made yet; None: there is none."""
        return self._waiting[-1].label if self._waiting else None

    def take_back(self) -> None:
        """Forget the last one."""
        self._waiting.pop()
        if not self._waiting:
            self._editor.jobs.cancel(self.kind)

    def _add(self, change: C) -> bool:
        """It is made after the others; whether it is the only one."""
        self._waiting.append(change)
        self.newest = next(CLOCK)
        return len(self._waiting) == 1

    def _is_first(self, change: C) -> bool:
        """Whether it is the one that is being made: it was not taken back."""
        return bool(self._waiting) and self._waiting[0] is change

    def _end_first(self) -> None:
        """It is a step now, and the others come after that."""
        self._waiting.pop(0)
        self.newest = next(CLOCK)


@dataclass(frozen=True, eq=False)
class Wish:
    """A lift that was asked for and is not there yet."""

    mask: Mask  # known by its identity: with another one the answer is too late
    label: str | None = None  # of the step; None: the first lift of the object
    words: Mapping[str, object] = field(default_factory=dict)  # fields of `LiftSettings`
    other: Path | OtherPhoto | None = None  # a further photo of the object

    def is_before(self, thing: EditObject) -> bool:
        """Whether the outline of an object that is not lifted yet has changed since."""
        return thing.lifted is None and thing.mask is not self.mask

    def after(self, older: Wish | None) -> Wish:
        """Return both wishes as one, for one step."""
        if older is None or older.mask is not self.mask:
            return self
        labels = dict.fromkeys(label for label in (older.label, self.label) if label)
        words, other = {**older.words, **self.words}, self.other or older.other
        return Wish(self.mask, ", ".join(labels) or None, words, other)


# A photo or session that is open: its document and steps, its files, and how it was looked at.

# Of the view, what belongs to the photo; brushes, panels and the like are the window's.
OWN_VIEW = (
    "width", "height", "scale", "zoom", "left", "top", "is_fitted", "tool", "split", "shown",
    "orbit",
)  # fmt: skip
OWN_COMPOSE = ("is_bare", "is_painting", "source")  # likewise of `ComposeView`


@dataclass(eq=False)
class Tab:
    """Mutable. While another tab is shown it keeps no more than what is here."""

    history: History | None = None  # None: the start screen
    path: Path | None = None  # the session's file
    source: Path | None = None  # the photo's file
    current: int = 0  # index of the object that the tools change
    selected: tuple[int, ...] = ()  # handles, as the tab was left
    wishes: dict[int, Wish] = field(default_factory=dict)  # lifts that were stopped then
    mirrored: list[weakref.ref[Mask]] = field(default_factory=list)  # of objects with symmetry
    shapes: Shapes = ()  # of its objects; kept for the tab that was left last
    looked: dict[str, Any] = field(default_factory=dict)  # OWN_VIEW, as the tab was left
    composed: dict[str, Any] = field(default_factory=dict)  # OWN_COMPOSE, likewise
    exported: frozenset[What] = frozenset()  # what of it was exported
    asked: Mask | None = None  # (H, W) px of pieces that were offered as parts of an object
    writing: Step | None = None  # which a session's file is to hold, that is not written yet
    autosave: Autosave = field(init=False)

    def __post_init__(self) -> None:
        self.autosave = Autosave(self)

    @property
    def document(self) -> Document | None:
        """The document without a stroke in progress."""
        return self.history.document if self.history else None

    @property
    def is_saved(self) -> bool:
        return self.history is None or self.history.is_saved

    @property
    def is_being_saved(self) -> bool:
        """Whether what is shown is on its way to the disk."""
        return self.history is not None and self.history.step is self.writing

    @property
    def name(self) -> str:
        """The session's name, or the photo's; "" of the start screen."""
        if self.path is not None:
            return self.path.name
        return self.document.photo.name if self.document is not None else ""

    def keep_view(self, view: ViewState) -> None:
        """The tab is left while `view` shows it."""
        self.looked = {name: getattr(view, name) for name in OWN_VIEW}
        self.composed = {name: getattr(view.compose, name) for name in OWN_COMPOSE}

    def restore_view(self, view: ViewState) -> None:
        """The tab is shown again, by a canvas that may have another size now."""
        for name in OWN_COMPOSE:
            setattr(view.compose, name, self.composed.get(name, getattr(ComposeView, name)))
        if self.document is None:
            return
        size, scale = (view.width, view.height), view.scale
        for name, value in self.looked.items():
            setattr(view, name, value)
        view.resize(size, scale, self.document.photo.size)


class EditorState:
    """What everything that the user intends reads and changes."""

    def __init__(self, settings: Settings, wake: Callable[[], None] = lambda: None) -> None:
        """`wake` is called from another thread when a job has something to deliver."""
        self.settings = settings
        self.view = ViewState()
        self.hand = Hand()
        self.jobs = Jobs(WARM, wake)
        self.chores = Chores(wake)
        self.answers = Answers(self)
        self.cache = Cache()
        self.tab = Tab()  # the one that is shown
        self.all_tabs: tuple[Tab, ...] = (self.tab,)  # in the order of the bar
        self._preview: Document | None = None
        self.hover = Hover()
        self.pointer: Pointer | None = None  # where it is now, on the canvas
        self.rubber: tuple[float, float, float, float] | None = None  # box being drawn, canvas px
        self.message: StatusMessage | None = None
        self.is_over = False  # the window closes

    # Of the tab that is shown

    @property
    def history(self) -> History | None:
        return self.tab.history

    @property
    def path(self) -> Path | None:
        """The session's file."""
        return self.tab.path

    @property
    def source(self) -> Path | None:
        """The photo's file."""
        return self.tab.source

    @property
    def current(self) -> int:
        """Index of the object that the tools change."""
        return self.tab.current

    @current.setter
    def current(self, current: int) -> None:
        self.tab.current = current

    @property
    def autosave(self) -> Autosave:
        return self.tab.autosave

    # What there is

    @property
    def document(self) -> Document | None:
        if self.preview is not None:
            return self.preview
        return self.committed

    @property
    def preview(self) -> Document | None:
        """The document of the stroke in progress; none that changes a locked object."""
        return self._preview

    @preview.setter
    def preview(self, preview: Document | None) -> None:
        self._preview = None if preview is not None and self._is_refused(preview) else preview

    @property
    def derived(self) -> Derived:
        """Shapes, posed Gaussians and places of the document's objects."""
        return self.cache.derived

    @property
    def committed(self) -> Document | None:
        """The document without the stroke in progress."""
        return self.tab.document

    @property
    def object(self) -> EditObject | None:
        """The object that the tools change, if it exists already."""
        document = self.document
        if document is None or self.current >= len(document.objects):
            return None
        return document.objects[self.current]

    @property
    def opened(self) -> Document:
        """The document, for whatever is done only while one is open."""
        assert self.document is not None
        return self.document

    @property
    def chosen(self) -> EditObject:
        """The current object, for whatever is done only where there is one."""
        assert self.object is not None
        return self.object

    @property
    def mask(self) -> Mask | None:
        return self.object.mask if self.object else None

    @property
    def is_lifted(self) -> bool:
        return self.object is not None and self.object.lifted is not None

    @property
    def is_lifting(self) -> bool:
        """Whether the current object is on its way."""
        return self.jobs.is_busy(LIFT) or self.chores.is_busy(f"{READY} {self.current}")

    @property
    def why_no_shape(self) -> str:
        """What is to be done, or awaited, where an object in 3D is needed and there is none."""
        return t("The object is being lifted") if self.is_lifting else t("Lift an object first")

    @property
    def photo_size(self) -> tuple[int, int] | None:
        return self.document.photo.size if self.document else None

    @property
    def is_saved(self) -> bool:
        return self.tab.is_saved

    def is_opened(self, path: Path) -> bool:
        """Whether any tab shows the photo of this file, which nothing may overwrite."""
        sources = (tab.source for tab in self.all_tabs)
        return any(own is not None and own.resolve() == path.resolve() for own in sources)

    def is_on_photo(self, canvas_xy: np.ndarray) -> bool:
        if self.photo_size is None:
            return False
        xy = self.view.image_from_canvas(canvas_xy)
        return bool((xy >= 0).all() and (xy < self.photo_size).all())

    # Saying things

    def say(self, text: str, action: Action | None = None) -> None:
        self.message = StatusMessage(text, action=action)

    def drop_hint(self) -> None:
        """Something else is done: what was said to do next goes, an error or an offer stays."""
        said = self.message
        if said is not None and not said.is_error and said.action is None:
            self.message = None

    def complain(self, text: str, details: str = "", action: Action | None = None) -> None:
        """An error: one sentence, its first letter a capital."""
        self.message = StatusMessage(sentence(text), is_error=True, details=details, action=action)

    def complain_of(self, error: JobError) -> None:
        """A job that failed; where another try may help there is a button for it."""
        retry = Action(t("Retry"), error.retry) if error.retry else None
        self.complain(error.sentence, error.trace, retry)

    # Steps

    def forget_document(self) -> None:
        """No document is open."""
        self.tab.history = self.tab.path = self.tab.source = None
        self.tab.mirrored = []
        self.preview = self.message = None
        self.hover = Hover()

    def apply(self, label: str, document: Document) -> None:
        """`document` is the next step."""
        assert self.history is not None
        self.preview = None
        if document is not self.committed:
            self.drop_hint()
        if not self._is_refused(document):
            self.history.apply(label, document)

    def _is_refused(self, changed: Document) -> bool:
        """Whether it changes a locked object, or the outline of a visitor, which is said."""
        before = self.committed
        visitor = None if before is None else visitor_edits.changes_visitor(before, changed)
        if visitor is not None:
            self.say_visitor(visitor)
            return True
        own = None if before is None else hold_edits.locked_change(before, changed)
        if before is not None and own is not None:
            self.say_locked(next(k for k, each in enumerate(before.objects) if each is own))
        return own is not None

    def say_visitor(self, visitor: EditObject) -> None:
        """That the outline and shape of an object of another photo are changed there."""
        self.say(_of_elsewhere(visitor))

    @property
    def visitor_note(self) -> str | None:
        """The same of the current object; None of one of this photo."""
        own = self.object
        return _of_elsewhere(own) if own is not None and own.is_visitor else None

    def say_left(self, k: int) -> None:
        """That object `k` is not any more where it was clicked in the photo."""
        if self.committed is not None:
            item = self.committed.objects[k]
            has_moved = t("{name} was here and has moved", name=item.name)
            is_hidden = t("{name} was here and is hidden", name=item.name)
            self.say(has_moved if item.is_visible else is_hidden)

    @property
    def why_held(self) -> str | None:
        """Why the tool leaves the current object as it is, or None: nor is one moved unseen."""
        own, tool = self.object, self.view.tool
        if own is not None and own.is_locked and tool in CHANGING:
            return t("{name} is locked", name=own.name)
        if own is not None and not own.is_visible and tool in MOVING:
            return t("{name} is hidden", name=own.name)
        return None

    def say_locked(self, k: int) -> None:
        """That object `k` is locked, with a button that unlocks it."""
        if self.committed is not None:
            name = self.committed.objects[k].name
            self.say(t("{name} is locked", name=name), Action(t("Unlock"), lambda: self.lock(k)))

    def lock(self, k: int) -> None:
        """Locks object `k`, or unlocks it; a step."""
        document = self.committed
        if document is not None and k < len(document.objects) and not self.hand.is_busy:
            is_locked = not document.objects[k].is_locked
            label = t("Lock object") if is_locked else t("Unlock object")
            self.apply(label, hold_edits.set_locked(document, k, is_locked))
            if is_locked:
                self.say_locked(k)
            else:
                self.say(t("It can be changed again"))

    def commit(self, label: str) -> None:
        """The preview becomes a step; without a label it is dropped."""
        preview, self.preview = self.preview, None
        if preview is not None and label:
            self.apply(label, preview)


def _of_elsewhere(visitor: EditObject) -> str:
    assert visitor.lifted is not None and visitor.lifted.origin is not None
    photo = visitor.lifted.origin.photo
    return t("{name} comes from {photo}: change its outline there, and copy it again",
             name=visitor.name, photo=photo)  # fmt: skip
