"""The edit refined by a network: asked for, shown as strongly as is wanted, taken back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, show_the_same
from objectmorpher_core.document.settings import Refined

from ...system.texts import t
from ...worker import job_functions
from ...worker.requests import JobError

if TYPE_CHECKING:
    from objectmorpher_core.compose.refine.refinement import CoarseEdit

    from ..state import EditorState
    from .methods import Methods

REFINE = "refine"  # kind of job


class RefiningIntents:
    """The refinement of the whole edit."""

    def __init__(self, editor: EditorState, methods: Methods) -> None:
        self._editor = editor
        self._methods = methods
        self._answer: tuple[Document, Refined] | None = None  # waits for the hand to be idle

    def forget(self) -> None:
        """Another document is opened."""
        self._answer = None

    @property
    def refined(self) -> Refined | None:
        """Return the refinement that is shown now."""
        document = self._editor.document
        return None if document is None else document.refined

    def run(self) -> None:
        """Asks for a refinement; as strong as the last one, where there is one."""
        self._ask(0 if self.refined is None else self.refined.seed)

    def run_again(self) -> None:
        """Asks for another one, with the next seed."""
        self._ask(0 if self.refined is None else self.refined.seed + 1)

    def _ask(self, seed: int) -> None:
        """What is to be seen of the edit is cut out here; the network may be on a server."""
        from objectmorpher_core.scripting.runner import RefineOptions as How

        editor, asked = self._editor, self._editor.committed
        if asked is None:
            return
        strength = 1.0 if asked.refined is None else asked.refined.strength
        how = How(self._methods.chosen("refine"), seed, strength)

        def fail(error: JobError) -> None:
            editor.complain_of(error.retried_by(lambda: self._ask(seed)))

        def accept(refined: Refined) -> None:
            self._answer = asked, refined

        def hand_over(edit: CoarseEdit) -> None:
            editor.jobs.start(
                t("Refining the edit"), job_functions.refine, edit, how,
                done=accept, failed=fail, kind=REFINE,
            )  # fmt: skip

        editor.jobs.start(
            t("Refining the edit"), job_functions.cut_edit, replace(asked, refined=None),
            done=hand_over, failed=fail, kind=REFINE,
        )  # fmt: skip

    def deliver(self) -> bool:
        """Takes in what the worker has made, between strokes; once a frame."""
        editor, document = self._editor, self._editor.committed
        if self._answer is None or editor.hand.is_busy or editor.preview is not None:
            return False
        (asked, refined), self._answer = self._answer, None
        if document is None or not show_the_same(asked, document):
            editor.say(t("The edit has changed meanwhile: refine it again"))
        else:
            editor.apply(t("Refine"), edits.set_refined(document, refined))
        return True

    def preview_strength(self, strength: float) -> None:
        """Previews how much of it is shown, in [0, 1]; `Editor.commit` makes it a step."""
        editor = self._editor
        if editor.committed is None or editor.committed.refined is None or editor.hand.is_busy:
            return
        editor.preview = edits.set_strength(editor.committed, strength)

    def remove(self) -> None:
        """The edit as it was put together."""
        document = self._editor.committed
        if document is not None and document.refined is not None:
            changed = edits.set_refined(document, None)
            self._editor.apply(t("Remove refinement"), changed)
