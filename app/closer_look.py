"""A better answer to a click that was answered at a glance, a moment later.

What is small in a photo is recognised anew at its own size, which takes longer than a click may.
The worker does that while nothing else is asked of it. The answer takes the first one's place in
the step that it made; where the user has gone on, it is not wanted any more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from objectmorpher_core import edits
from objectmorpher_core.arrays import Mask, Selection
from objectmorpher_core.document import Prompt
from objectmorpher_core.segment import Found

from . import job_functions
from .job_functions import Choice
from .tasks import Question

if TYPE_CHECKING:
    from .editor import Editor

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

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self._owed: _Glance | None = None

    def begin(self, question: Question, base: Selection | None, asked: Prompt) -> None:
        """The step that was just made may be told better."""
        history = self._editor.history
        assert history is not None
        self._owed = _Glance(question, base, asked, self._editor.mask, history.cursor)
        self._ask(self._owed)

    def poll(self) -> bool:
        """Once a frame: asks again, or shows the answer. Whether anything changed."""
        editor, owed = self._editor, self._owed
        if owed is None:
            return False
        if not self._is_wanted(owed):
            self._owed = None
        elif owed.found is not None and not editor.hand.is_busy and editor.preview is None:
            self._owed = None
            editor.selection.improve(owed.question, owed.base, owed.found)
            return True
        elif owed.found is None and editor.jobs.is_idle:  # it had to give way
            self._ask(owed)
        return False

    def _is_wanted(self, owed: _Glance) -> bool:
        """Whether the step is still the last word about what is selected."""
        editor, history = self._editor, self._editor.history
        if history is None or history.cursor != owed.cursor or editor.tasks.question is not None:
            return False
        return editor.current == owed.question.k and editor.mask is owed.mask

    def _ask(self, owed: _Glance) -> None:
        editor = self._editor
        document = editor.document
        assert document is not None
        asked = edits.beside(document, owed.question.k, owed.asked)

        def accept(found: Found) -> None:
            if self._owed is owed:
                self._owed = replace(owed, found=found)

        def fail(error: object) -> None:
            """The first answer stays: nobody asked for a second one."""
            if self._owed is owed:
                self._owed = None

        editor.jobs.start(
            "Looking closer", job_functions.closer_look, document.photo.pixels, asked,
            choice_of(editor), done=accept, failed=fail, kind=LOOK, is_quiet=True, is_spare=True,
        )  # fmt: skip


def choice_of(editor: Editor) -> Choice:
    """Which segmenter is asked."""
    seed = editor.document.seed if editor.document is not None else 0
    return Choice(editor.settings.backends.segment, seed)
