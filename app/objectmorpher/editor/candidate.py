"""A preview of the selection that a click at the resting pointer would make or correct.

Where nothing is selected, that is what a click would select; inside a selection, what a right-click
would take away; outside it, what a click would add.

The worker is asked only while it has nothing else to do, and any request of the user ends it. A
click on what is shown uses the answer that is there. One that was found at a glance is looked at
more closely while the pointer goes on resting: what that costs the click need not wait for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import Mask, Selection
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Click, Photo, Prompt
from objectmorpher_core.document.transparency import seen
from objectmorpher_core.segment import Found

from ..worker import job_functions
from ..worker.job_functions import BackendChoice
from ..worker.jobs import RELUCTANCE
from ..worker.requests import JobError
from .tasks import SELECT, Question, Tasks

if TYPE_CHECKING:
    from .state import EditorState


CANDIDATE = "candidate"  # kind of job
CLOSER = "closer candidate"  # kind of job, of one that is shown
REST = 0.06  # s that the pointer rests before the worker is asked
SAME_PLACE = 2.0  # points: a hand moves so much when it presses
TOO_SLOW = 2.5  # s; after two such answers, which are shown, the photo is not asked about again

Answered = Callable[[Question, Found, Prompt], None]
Improved = Callable[[Question, Selection | None, Found], None]


def _ignore(*answer: object) -> None:
    """Nobody wants it."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """The answer of a click that was not made."""

    photo: Photo
    prompt: Prompt
    found: Found
    before: Mask | None  # (H, W) what is selected, which a click would correct

    @property
    def mask(self) -> Mask:
        """(H, W) what would be selected."""
        return self.found.mask

    @property
    def takes_away(self) -> bool:
        """Whether it is a right-click that would do it."""
        return not self.prompt.clicks[-1].is_foreground

    @cached_property
    def changed(self) -> Mask:
        """(H, W) what the click would select, add or take away: the place itself is in it."""
        if self.before is None:
            return self.mask
        return self.before & ~self.mask if self.takes_away else self.mask & ~self.before


class Candidates:
    """The one under the pointer."""

    def __init__(self, editor: EditorState, tasks: Tasks) -> None:
        self._editor = editor
        self._tasks = tasks
        self.answered: Answered = _ignore  # takes the answer to a question, and what was asked
        self.shown: Candidate | None = None
        self._place: tuple[float, float] | None = None  # image px, where the pointer is
        self._since = 0.0  # s, monotonic, when it came there
        self._asked: Prompt | None = None  # the last one
        self._wanted: Question | None = None  # the user clicked while it was being answered
        self._slow: Photo | None = None
        self._late: Photo | None = None  # one answer was late: the first waits for the networks

    @property
    def is_due(self) -> bool:
        """Whether the worker will be asked within a moment."""
        return self._next_prompt() is not None and self._is_free()

    def poll(self) -> bool:
        """Asks when the pointer rests; once a frame."""
        place, now = self._editor.hover.place, time.monotonic()
        if not self._is_wished():
            self.shown = self._place = self._asked = None
            return False
        assert place is not None
        if place != self._place:
            self._place, self._since = place, now
            if self.shown is not None and not self.shown.changed[int(place[1]), int(place[0])]:
                self.shown = None
        if self.shown is not None and self.shown.before is not self._editor.mask:
            self.shown = self._asked = None
        prompt = self._next_prompt()
        if prompt is not None and now - self._since >= REST and self._is_free():
            self._ask(prompt, now)
        return False

    def take(self, question: Question) -> bool:
        """Whether the question is answered already, or will be by what runs: then nobody asks."""
        editor, shown = self._editor, self.shown
        photo = editor.document.photo if editor.document else None
        is_here = shown is not None and shown.photo is photo
        if shown is not None and is_here and self._is_same(shown.prompt, question.prompt):
            editor.jobs.cancel(CANDIDATE)
            self.shown = self._asked = None
            # A closer look goes on: the step's own then finds that it was taken.
            self.answered(question, shown.found, shown.prompt)
            return True
        asked = self._asked is not None and self._is_same(self._asked, question.prompt)
        if not asked or not editor.jobs.promote(CANDIDATE, SELECT):
            return False
        self._wanted = self._tasks.question = question
        return True

    def _is_free(self) -> bool:
        """Whether the worker does nothing, or nothing but look for an older candidate."""
        jobs = self._editor.jobs
        current = jobs.current
        return jobs.is_idle or (current is not None and current.kind in (CANDIDATE, CLOSER))

    def _is_wished(self) -> bool:
        """Whether the user may want to know what a click here would select."""
        editor = self._editor
        return (
            (self._tasks.is_click_awaited or self._tasks.is_correction_awaited)
            and editor.document is not None
            and editor.hover.place is not None
            and not editor.hand.is_busy
        )

    def _next_prompt(self) -> Prompt | None:
        """What a click would say now, where that was not asked yet."""
        editor, mask = self._editor, self._editor.mask
        if self._place is None or editor.document is None or editor.document.photo is self._slow:
            return None
        if mask is None:
            prompt = Prompt((Click(*self._place),), level=editor.view.selecting.level)
        else:  # a click where the mask is right says nothing new
            is_selected = bool(mask[int(self._place[1]), int(self._place[0])])
            before = self._tasks.prompt
            click = Click(*self._place, is_foreground=not is_selected)
            prompt = replace(before, clicks=(*before.clicks, click))
        return None if prompt == self._asked else prompt

    def _is_same(self, known: Prompt, prompt: Prompt) -> bool:
        """Whether both have the last click at one place, and are alike but for that."""
        if not prompt.clicks:
            return False
        a, b, view = known.clicks[-1], prompt.clicks[-1], self._editor.view
        gap = float(np.hypot(a.x - b.x, a.y - b.y)) * view.zoom
        is_near = a.is_foreground == b.is_foreground and gap <= SAME_PLACE * view.scale
        return is_near and replace(known, clicks=(*known.clicks[:-1], b)) == prompt

    def _ask(self, prompt: Prompt, now: float) -> None:
        editor, document = self._editor, self._editor.opened
        photo, before = document.photo, editor.mask
        self._asked = prompt
        editor.jobs.cancel(CLOSER, RELUCTANCE)

        def accept(answer: Found | str) -> None:
            wanted = self._pop_wanted()
            if time.monotonic() - now > TOO_SLOW:
                self._slow = photo if self._late is photo else self._slow
                self._late = photo
            current = editor.document
            if current is None or current.photo is not photo:
                return
            if isinstance(answer, str):
                self.shown = None
                if wanted is not None:
                    editor.complain(answer)
            elif wanted is not None:
                editor.answers.take(lambda: self.answered(wanted, answer, prompt))
            elif self._is_wished() and editor.mask is before:
                self.shown = Candidate(photo, prompt, answer, before)
                self._look_closer(self.shown)

        def fail(error: JobError) -> None:
            if self._pop_wanted() is not None:
                editor.complain_of(error)

        editor.jobs.start(
            "Selecting", job_functions.candidate, seen(photo),
            edits.beside(document, editor.current, prompt), choice_of(editor),
            done=accept, failed=fail, cancelled=self._drop, replaced=self._forget_wanted,
            kind=CANDIDATE, is_quiet=True, is_spare=True,
        )  # fmt: skip

    def _look_closer(self, shown: Candidate) -> None:
        """The candidate refined, where it can be."""
        if shown.found.is_final:
            return

        def accept(answer: Found) -> None:
            if self.shown is shown:
                self.shown = replace(shown, found=answer)

        editor = self._editor
        asked = edits.beside(editor.opened, editor.current, shown.prompt)
        editor.jobs.start(
            "Looking closer", job_functions.closer_look, seen(shown.photo), asked,
            choice_of(editor), done=accept, failed=lambda error: None, kind=CLOSER,
            is_quiet=True, is_spare=True,
        )  # fmt: skip

    def _drop(self) -> None:
        self._asked = None
        self._pop_wanted()

    def _forget_wanted(self) -> None:
        """Something else was asked instead: the next candidate is not its answer."""
        self._pop_wanted()

    def _pop_wanted(self) -> Question | None:
        """What the user asked meanwhile; it is no question any more, unless a newer one is."""
        wanted, self._wanted = self._wanted, None
        if wanted is not None and wanted is self._tasks.question:
            self._tasks.question = None
        return wanted


# A better answer to a click that was answered at a glance, a moment later.

LOOK = "closer look"  # kind of job


@dataclass(frozen=True, eq=False)
class _Glance:
    """What was answered at a glance, and the step that it made."""

    question: Question
    base: Selection | None  # (H, W) what was selected before
    asked: Prompt  # what was answered; the question's click may be a hand's tremor beside it
    mask: Mask | None  # (H, W) the step's
    cursor: int  # of the history
    found: Found | None = None  # the better answer, while the hand is busy


class CloserLook:
    """The one that is owed, if any."""

    def __init__(self, editor: EditorState, tasks: Tasks) -> None:
        self._editor = editor
        self._tasks = tasks
        self.improved: Improved = _ignore  # takes a better answer, and what was selected before
        self._owed: _Glance | None = None

    def begin(self, question: Question, base: Selection | None, asked: Prompt) -> None:
        """Begin looking for a better label of the step that was just made."""
        history = self._editor.history
        assert history is not None
        self._owed = _Glance(question, base, asked, self._editor.mask, history.cursor)
        self._ask(self._owed)

    def poll(self) -> bool:
        """Ask again or show the answer, once a frame; return whether anything changed."""
        editor, owed = self._editor, self._owed
        if owed is None:
            return False
        if not self._is_wanted(owed):
            self._owed = None
        elif owed.found is not None and not editor.hand.is_busy and editor.preview is None:
            self._owed = None
            self.improved(owed.question, owed.base, owed.found)
            return True
        elif owed.found is None and editor.jobs.is_idle:  # it had to give way
            self._ask(owed)
        return False

    def _is_wanted(self, owed: _Glance) -> bool:
        """Whether the step is still the last word about what is selected."""
        editor, history = self._editor, self._editor.history
        if history is None or history.cursor != owed.cursor or self._tasks.question is not None:
            return False
        return editor.current == owed.question.k and editor.mask is owed.mask

    def _ask(self, owed: _Glance) -> None:
        editor = self._editor
        document = editor.opened
        asked = edits.beside(document, owed.question.k, owed.asked)

        def accept(found: Found) -> None:
            if self._owed is owed:
                self._owed = replace(owed, found=found)

        def fail(error: object) -> None:
            """The first answer stays: nobody asked for a second one."""
            if self._owed is owed:
                self._owed = None

        editor.jobs.start(
            "Looking closer", job_functions.closer_look, seen(document.photo), asked,
            choice_of(editor), done=accept, failed=fail, kind=LOOK, is_quiet=True, is_spare=True,
        )  # fmt: skip


def choice_of(editor: EditorState) -> BackendChoice:
    """Which segmenter is asked."""
    seed = editor.document.seed if editor.document is not None else 0
    return BackendChoice(editor.settings.backends.segment, seed)
