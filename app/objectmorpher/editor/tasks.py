"""The editor's long steps: requests to the worker, and the reception of its answers.

An answer is dropped where the question does not stand any more, which `is` tells: the photo and
the mask of a document never change, they are replaced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    LiftedObject,
    LiftSettings,
    Matte,
    Photo,
    Plate,
    Prompt,
)
from objectmorpher_core.document.settings import Hint
from objectmorpher_core.document.transparency import colours_of, continued, seen
from objectmorpher_core.segment import Found

from ..canvas.layer import ExactPicture, Rendered
from ..canvas.memo import same
from ..canvas.shape import CanvasShape, build_ready_shape, rehearse
from ..system.texts import folder_of, t
from ..worker import job_functions
from ..worker.job_functions import BackendChoice, Cut
from ..worker.requests import LIFT, READY, JobError
from .state import Wish
from .view import Action, SelectMode, ToolName

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit
    from objectmorpher_core.lift.registration.other_photo import OtherPhoto

    from .intents.posing import Posing
    from .state import EditorState

REHEARSE, FRONT = "rehearse", "front"  # kinds of what runs in a thread, beside READY
READ, SELECT, PLATE, WRITE = "read", "segment", "plate", "write"  # kinds of jobs, beside LIFT
READ_MASK = "read mask"  # and of the file of one


Wanted = tuple[Mask | Hint | None, ...]  # what a background depends on: masks, then hints


class Combine(Enum):
    """How an answer is combined with the selection that is there."""

    ANEW = "anew"  # instead of it
    REFINED = "refined"  # the same selection, by further clicks
    ADDED = "added"
    REMOVED = "removed"


@dataclass(frozen=True)
class Question:
    """A prompt, and the object that it is about."""

    prompt: Prompt
    label: str  # of the step
    k: int
    combine: Combine = Combine.REFINED
    before: Mask | None = None  # (H, W) what was selected of it then; by its identity


@dataclass(frozen=True, eq=False)
class _Asked:
    """An object that is being lifted."""

    k: int
    wish: Wish
    shape: LiftSettings  # as it was then

    def is_of(self, shape: LiftSettings) -> bool:
        """Whether nothing but the thickness was said since then."""
        names = [each.name for each in fields(shape) if each.name != "thickness"]
        return all(same(getattr(shape, name), getattr(self.shape, name)) for name in names)


def _with_words(shape: LiftSettings, wish: Wish) -> LiftSettings:
    return replace(shape, **dict(wish.words))


class Tasks:
    """Segmenting, lifting, inpainting, writing."""

    def __init__(self, editor: EditorState, posing: Posing) -> None:
        self._editor = editor
        self._posing = posing
        self.question: Question | None = None  # asked, not answered yet
        self.lifts: Question | None = None  # whose answer is lifted at once
        self.wishes: dict[int, Wish] = {}  # by object: what is not lifted yet; the first is asked
        self._plate: tuple[Wanted, Plate] | None = None  # of what was wanted
        self._no_plate: Wanted | None = None  # asked or failed for
        # What stays in front, as it was asked for last: its mask, and the answer
        self._front: tuple[Mask | None, Matte | None] | None = None
        self._unreadable: Photo | None = None  # reading it has ended the worker
        editor.jobs.restarted = self._read_again

    def forget(self) -> None:
        """Another document is opened."""
        self.question = self.lifts = None
        self.wishes = {}  # the older one is that of what was asked
        self._plate = self._no_plate = self._front = None

    @property
    def pending(self) -> Prompt | None:
        """Return the prompt that is being segmented; the document gets it with its mask."""
        question = self.question
        return question.prompt if question and question.k == self._editor.current else None

    @property
    def prompt(self) -> Prompt:
        """Return the prompt about the current object, answered or not."""
        if self.pending is not None:
            return self.pending
        thing = self._editor.object
        return thing.prompt if thing else Prompt()

    @property
    def is_click_awaited(self) -> bool:
        """Whether a click would begin a selection."""
        return self._is_clicking and self._editor.mask is None

    @property
    def is_correction_awaited(self) -> bool:
        """Whether a click would correct what clicks, a box or the subject have selected."""
        item = self._editor.object
        is_told = item is not None and item.mask is not None and not item.prompt.is_empty
        return self._is_clicking and self._editor.preview is None and is_told

    @property
    def _is_clicking(self) -> bool:
        editor, view = self._editor, self._editor.view
        is_select = view.tool is ToolName.SELECT and view.selecting.mode is SelectMode.CLICK
        return editor.document is not None and is_select and self.question is None

    def read_photo(self, is_quiet: bool = False) -> None:
        """Lets the worker look at a photo that was opened, before the first click."""
        self._read(lambda: None, is_quiet)

    def _read(self, cancelled: Callable[[], None], is_quiet: bool, is_spare: bool = False) -> None:
        editor, document = self._editor, self._editor.document
        if document is None:
            return

        def fail(error: JobError) -> None:
            self._unreadable = document.photo

        editor.jobs.start(
            t("Reading the photo"), job_functions.read_photo, seen(document.photo),
            editor.settings.backends.segment,
            done=lambda _: None, failed=fail, cancelled=cancelled, kind=READ,
            is_quiet=is_quiet, is_spare=is_spare,
        )  # fmt: skip

    def _read_again(self) -> None:
        """The worker was started anew; the next click is not to wait for what it has forgotten.

        Nor is what needs no reading, such as saving: the reading gives way, and is done later.
        """
        document = self._editor.committed
        if self._editor.jobs.is_busy(READ):  # a second one would end it, and come back for ever
            return
        if document is not None and document.photo is not self._unreadable:
            self._read(self._read_again, is_quiet=True, is_spare=True)

    def segment(self, question: Question, take: Callable[[Question, Found], None]) -> None:
        """Asks for the mask of a prompt, to be taken; what was said before it is in it."""
        editor, document = self._editor, self._editor.document
        if document is None:
            return
        editor.jobs.promote(READ, READ)  # this waits for it: it does not give way
        editor.message = None
        self.question = question
        photo = document.photo

        def give(found: Found) -> None:
            self.question = None if self.question is question else self.question
            current = editor.document
            if current is not None and current.photo is photo:
                take(question, found)

        def fail(error: JobError) -> None:
            self._drop_question()
            editor.complain_of(error.retried_by(lambda: self.segment(question, take)))

        editor.jobs.start(
            t("Selecting"), job_functions.segment, seen(photo),
            edits.beside(document, question.k, question.prompt),
            BackendChoice(editor.settings.backends.segment, document.seed),
            done=lambda found: editor.answers.take(lambda: give(found)), failed=fail,
            cancelled=self._drop_question, kind=SELECT,
        )  # fmt: skip

    def _drop_question(self) -> None:
        self.question = None

    def lift_when_selected(self) -> None:
        """The object that is being selected is lifted as soon as its selection is there."""
        self.lifts = self.question
        self._editor.say(t("It is lifted as soon as it is selected"))

    @property
    def wished(self) -> LiftSettings | None:
        """The words about the current object's shape, with those that it does not follow yet."""
        thing, wish = self._editor.object, self.wishes.get(self._editor.current)
        if thing is None or wish is None or wish.mask is not thing.mask:
            return None if thing is None else thing.shape
        return _with_words(thing.shape, wish)

    def lift(self, label: str | None = None, **words: object) -> None:
        """Asks for the current object in 3D; with other `words` about its shape it is a step."""
        self._wish(label, words)

    def lift_with(self, other: Path | OtherPhoto, label: str) -> None:
        """Asks for the current object lifted with another photo of it, too; one step."""
        older = self.wishes.get(self._editor.current)
        if older is not None and older.other is not None:
            self._editor.say(self._editor.why_no_shape)  # one after the other
        else:
            self._wish(label, {}, other)

    def resume(self, wishes: Mapping[int, Wish]) -> None:
        """Asks for what was not lifted yet when the document was left."""
        self.wishes = dict(wishes)
        self._ask_lift()

    def _wish(
        self, label: str | None, words: Mapping[str, object],
        other: Path | OtherPhoto | None = None,
    ) -> None:  # fmt: skip
        """Further words about an object that is being lifted begin that anew, for one step."""
        editor, thing = self._editor, self._editor.object
        if editor.document is None or thing is None or thing.selection is None:
            return
        assert thing.mask is not None
        editor.message = None
        k, wish = editor.current, Wish(thing.mask, label, words, other)
        self.wishes[k] = wish.after(self.wishes.get(k))
        if next(iter(self.wishes)) == k:
            self._ask_lift()

    def _ask_lift(self) -> None:
        """For the first object that is to be lifted."""
        editor, document, wishes = self._editor, self._editor.committed, self.wishes
        if document is None or not wishes:
            return
        k, wish = next(iter(wishes.items()))
        thing = document.objects[k] if k < len(document.objects) else None
        if thing is None or thing.mask is not wish.mask or thing.selection is None:
            self._end_lift(k, wish)
            return
        wanted = replace(
            _with_words(thing.shape, wish),
            count=editor.settings.gaussians, horizon=document.horizon,
        )  # fmt: skip
        asked = _Asked(k, wish, thing.shape)
        cut = Cut(
            colours_of(document.photo.picture), document.photo.camera, thing.selection, thing.mixed
        )
        choice = BackendChoice(editor.settings.backends.lift, document.seed)

        def fail(error: JobError) -> None:
            self._end_lift(k, wish)
            editor.complain_of(error.retried_by(lambda: self.resume({**self.wishes, k: wish})))

        if wish.other is None:
            title = t("Lifting the object")
            editor.jobs.start(
                title, job_functions.lift, cut, choice, wanted,
                done=lambda answer: self._take_shape(asked, (wanted, *answer), title),
                failed=fail, cancelled=wishes.clear, kind=LIFT,
            )  # fmt: skip
            return
        title = t("Comparing with {name}", name=wish.other.name)
        editor.jobs.start(
            title, job_functions.lift_with_photo, cut, wish.other,
            (editor.settings.backends.segment, choice), wanted,
            done=lambda answer: self._take_shape(asked, answer, title),
            failed=fail, cancelled=wishes.clear, kind=LIFT,
        )  # fmt: skip

    def _end_lift(self, k: int, wish: Wish) -> None:
        """It is there, or will not be; on to the next one."""
        if self.wishes.get(k) is wish:
            del self.wishes[k]
            self._ask_lift()

    def _take_shape(
        self, asked: _Asked, made: tuple[LiftSettings, Matte, LiftedObject], title: str
    ) -> None:
        """What was asked for; with a label it is another shape of what was lifted, as a step."""
        editor, k, wish = self._editor, asked.k, asked.wish
        settings, matte, lifted = made

        def changed(now: Document) -> Document | None:
            thing = now.objects[k] if k < len(now.objects) else None
            if thing is None or thing.mask is not wish.mask or self.wishes.get(k) is not wish:
                return None
            if wish.label is None:
                return edits.set_lifted(now, k, matte, lifted, settings)
            if thing.lifted is None or not asked.is_of(thing.shape):
                return None
            reshaped = edits.reshape(now, k, matte, lifted, settings)
            if thing.shape.thickness in (asked.shape.thickness, settings.thickness):
                return reshaped
            return edits.set_thickness(reshaped, k, thing.shape.thickness)

        def show(now: Document) -> None:
            if editor.current == k:
                self._posing.select(None)
            if wish.label is None:
                self._show_lift(now, k)
            else:
                derived = editor.derived
                editor.apply(wish.label, derived.keys_again(derived.posed_again(now, k), k))
            self._end_lift(k, wish)

        def drop() -> None:
            """It cannot be had; where shape or outline have changed since it is asked for anew."""
            now = editor.committed
            thing = now.objects[k] if now is not None and k < len(now.objects) else None
            is_lifted = thing is not None and thing.lifted is not None
            is_other = thing is not None and is_lifted and not asked.is_of(thing.shape)
            is_same = self.wishes.get(k) is wish
            if is_other and wish.label is not None and is_same:
                self._ask_lift()
            elif thing is not None and thing.mask is not None and wish.is_before(thing) and is_same:
                self.wishes[k] = replace(wish, mask=thing.mask)
                self._ask_lift()
            else:
                self._end_lift(k, wish)

        self.make_ready(k, changed, title, show, drop)
        now = editor.committed
        ahead = None if wish.label is not None or now is None else changed(now)
        if ahead is not None and not editor.jobs.is_busy(PLATE):
            self._ensure_plate_of(ahead)  # the fill need not wait for what is made ready

    def make_ready(
        self,
        k: int,
        change: Callable[[Document], Document | None],
        title: str,
        show: Callable[[Document], None],
        drop: Callable[[], None] = lambda: None,
    ) -> None:
        """Shows a document in which object `k` is another one, when that can be drawn at once.

        What drawing and dragging it take is made in a thread, under `title`. `change` is asked for
        the document now and again then: much may have happened, and None means that it is too late:
        then `drop` is called.
        """
        editor, before = self._editor, self._editor.committed
        changed = None if before is None else change(before)
        if before is None or changed is None:
            drop()
            return
        camera, thing = changed.photo.camera, changed.objects[k]

        def accept(shape: CanvasShape) -> None:
            now = editor.committed
            changed = None if now is None else change(now)
            if now is None or changed is None:
                drop()
                return
            if now.objects[k] is before.objects[k]:
                editor.derived.remember(changed.objects[k], shape)
            show(changed)

        def fail(error: JobError) -> None:
            drop()
            editor.complain_of(error)

        editor.chores.start(
            title, lambda progress: build_ready_shape(camera, thing),
            kind=f"{READY} {k}", done=lambda shape: editor.answers.take(lambda: accept(shape)),
            failed=fail, replaced=drop,
        )  # fmt: skip

    def _show_lift(self, changed: Document, k: int) -> None:
        editor, name = self._editor, changed.objects[k].name
        editor.apply(t("Lift object"), changed)
        if editor.current == k:
            editor.view.tool = ToolName.POSE
            editor.say(t("{name} is in 3D now · Drag any point of it", name=name))
        else:  # the artist is at work on another one
            editor.say(t("{name} is in 3D now", name=name))

    def rehearse(self) -> bool:
        """Sees to it that the current object can be dragged at once; each frame."""
        editor, document = self._editor, self._editor.committed
        if document is None or editor.current >= len(document.objects):
            return False
        camera, thing = document.photo.camera, document.objects[editor.current]
        if thing.lifted is None or editor.chores.is_busy(REHEARSE):
            return False
        shape = editor.derived.shape(document.photo, thing)
        if shape.is_rehearsed:
            return False
        shape.is_rehearsed = True
        editor.chores.start(
            "Getting ready", lambda progress: rehearse(shape, camera, thing.placement),
            kind=REHEARSE, done=lambda _: None, failed=editor.complain_of, is_quiet=True,
        )  # fmt: skip
        return False

    def ensure_fronts(self) -> bool:
        """Sees to it that what stays in front is cut out; each frame."""
        document = self._editor.document
        objects = document.objects if document else ()
        for k, item in enumerate(objects):
            if item.stays_in_front and item.matte is None and item.mask is not None:
                return self._ensure_front(k, item)
        return False

    def _ensure_front(self, k: int, item: EditObject) -> bool:
        editor, document, mask = self._editor, self._editor.opened, item.mask
        if self._front is not None and self._front[0] is mask:
            matte = self._front[1]
            if matte is None:  # asked, or failed
                return False
            self._amend(lambda now: edits.keep_in_front(now, k, matte))
            return True

        def accept(matte: Matte) -> None:
            self._front = (mask, matte)

        self._front = (mask, None)
        editor.jobs.start(
            t("Cutting out what stays in front"), job_functions.cut_front,
            colours_of(document.photo.picture), item.selection, item.mixed,
            done=accept, failed=editor.complain_of, kind=FRONT,
        )  # fmt: skip
        return True

    def ensure_plate(self) -> bool:
        """Sees to it that lifted objects have a background behind them; each frame."""
        document = self._editor.document
        return document is not None and self._ensure_plate_of(document)

    def _ensure_plate_of(self, document: Document) -> bool:
        if document.plate is not None:
            return False
        # A fill is of these masks, and of the hints that are in force.
        wanted = (*(o.mask for o in document.objects if o.hides_background), *document.hints)
        if not any(o.lifted and not o.is_visitor for o in document.objects):
            return False
        if self._plate is not None and same(self._plate[0], wanted):
            plate = self._plate[1]
            self._amend(lambda document: edits.set_plate(document, plate))
            return True
        if self._no_plate is not None and same(self._no_plate, wanted):
            return False
        self._no_plate = wanted
        self._ask_plate(document, wanted)
        return True

    def _ask_plate(self, document: Document, wanted: Wanted) -> None:
        from objectmorpher_core.compose.plate.plate import plate_cover

        editor, covered = self._editor, plate_cover(document)

        def accept(plate: Plate) -> None:
            self._plate = (wanted, plate)

        def say_so() -> None:
            if self._no_plate is not None and same(self._no_plate, wanted):
                fill_in = Action(t("Fill in"), self.fill_background)
                editor.say(t("The background behind the object is not filled in"), fill_in)

        def forget() -> None:
            """Another question took its place: where this one comes up again, it is asked again."""
            if self._no_plate is wanted:
                self._no_plate = None

        def fail(error: JobError) -> None:
            """Handle a failed fill: there is no other way to a background, so offer another try."""
            retry = None if error.is_expected else self.fill_background
            editor.complain_of(replace(error, retry=retry))

        editor.jobs.start(
            t("Filling in the background"), job_functions.inpaint,
            continued(document.photo.picture, covered), covered,
            BackendChoice(editor.settings.backends.inpaint, document.seed, document.hints),
            done=accept, failed=fail, cancelled=say_so, replaced=forget, kind=PLATE,
        )  # fmt: skip

    def fill_background(self) -> None:
        """Asks again for a background that was cancelled or failed."""
        self._no_plate = None

    def _amend(self, change: Callable[[Document], Document]) -> None:
        """A computed addition to the current step, not a step of its own."""
        editor = self._editor
        assert editor.history is not None
        editor.history.amend(change(editor.history.document))
        if editor.preview is not None:
            editor.preview = change(editor.preview)

    def render_exact(
        self, request: ExactPicture, accept: Callable[[Rendered], None], is_again: bool = False
    ) -> None:
        """Asks for an exact picture of the view, which shows a draft; twice if it fails."""

        def fail(_: JobError) -> None:
            if not is_again:
                self.render_exact(request, accept, is_again=True)

        self._editor.jobs.start(
            "Drawing", job_functions.render_exact, request,
            done=accept, failed=fail, kind=f"draw {request.part}", is_quiet=True,
        )  # fmt: skip

    def light(self, k: int, work: Callable[[], Lit], accept: Callable[[Lit], None]) -> None:
        """Computes the exact light and shadow of object `k` in a thread."""
        self._editor.chores.start(
            "Casting the shadow", lambda progress: work(), kind=f"light {k}",
            done=accept, failed=self._editor.complain_of, is_quiet=True,
        )  # fmt: skip

    def save(
        self, path: Path, then: Callable[[], None] | None = None,
        give_up: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        """Writes the session, and goes on with `then` when it is on the disk.

        `give_up` is called instead where it does not get there.
        """
        editor, tab, history = self._editor, self._editor.tab, self._editor.history
        if history is None:
            return
        step = history.step

        def end() -> None:
            tab.writing = None if tab.writing is step else tab.writing

        def accept(_: None) -> None:
            end()
            if tab.history is history:  # which may not be the tab that is shown by now
                history.mark_saved(step)
                tab.path = path
                editor.settings = editor.settings.with_recent(path)
                editor.say(t("Saved {name} in {folder}", name=path.name,
                             folder=folder_of(path)))  # fmt: skip
                if then is not None:
                    then()
            else:
                give_up()

        def fail(error: JobError) -> None:
            end()
            if editor.tab is tab:
                error = error.retried_by(lambda: self.save(path, then, give_up))  # as it is then
            editor.complain_of(error)
            give_up()

        def stop() -> None:
            end()
            give_up()

        editor.jobs.start(
            t("Saving {name}", name=path.name), job_functions.write_session, step.document, path,
            done=accept, failed=fail, cancelled=stop, kind=f"{WRITE} {path}",
        )  # fmt: skip
        tab.writing = step
