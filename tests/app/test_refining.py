"""The Compose tool's network: one step each, dropped where the edit has changed meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from editor_steps import wait_until
from objectmorpher.commands import COMMANDS, run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ToolName
from objectmorpher.worker import job_functions
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.refine.refinement import CoarseEdit
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import Refined
from objectmorpher_core.scripting.runner import RefineOptions as How


class Asked:
    """What the worker was asked for, to be answered by the test."""

    def __init__(self, editor: Editor, monkeypatch: pytest.MonkeyPatch) -> None:
        self.document: Document | None = None
        self.edit: CoarseEdit | None = None
        self.how: How | None = None
        self.done: Callable[[Refined], None] | None = None
        self._editor = editor
        monkeypatch.setattr(editor.jobs, "start", self._start)

    def _start(self, title: str, function: Any, *arguments: Any, done: Any, **_: Any) -> None:
        if function is job_functions.cut_edit:
            (self.document,) = arguments
            done(function(*arguments, progress=silent))
        elif function is not job_functions.take_shadow:  # nobody asks for that: it is looked for
            assert function is job_functions.refine
            (self.edit, self.how), self.done = arguments, done

    def answer(self) -> None:
        """The edit in the complement of its colours."""
        edit, how = self.edit, self.how
        assert edit is not None and how is not None and self.done is not None
        made = 255 - edit.coarse
        self.done(Refined(edit.left, edit.top, made, edit.shown, "klein", how.seed, how.strength))
        self._editor.poll()


@pytest.fixture
def moved(editor: Editor, ball: Document) -> Editor:
    editor.start(edits.set_placement(ball, 0, Placement(move=(20.0, 5.0))))
    editor.view.tool = ToolName.COMPOSE
    return editor


def test_a_refinement_is_one_step_and_another_has_the_next_seed(moved, monkeypatch):
    before, asked = moved.document, Asked(moved, monkeypatch)
    moved.refining.run()
    assert moved.document is before, "until the answer comes"
    asked.answer()
    assert moved.history.undo_label == "Refine" and moved.refining.refined.seed == 0
    first = moved.document
    moved.refining.run_again()
    assert asked.document.refined is None, "the edit itself is refined, not the refinement"
    asked.answer()
    assert moved.refining.refined.seed == 1
    moved.undo()
    assert moved.document is first
    moved.undo()
    assert moved.document is before


def test_an_answer_for_another_edit_is_dropped(moved, monkeypatch):
    asked = Asked(moved, monkeypatch)
    moved.refining.run()
    changed = edits.set_placement(moved.document, 0, Placement(move=(-20.0, 5.0)))
    moved.apply("Move object", changed)
    asked.answer()
    assert moved.document is changed and moved.refining.refined is None
    assert moved.message is not None and "refine it again" in moved.message.text


def test_an_answer_stays_where_nothing_that_is_seen_has_changed(moved, monkeypatch):
    asked = Asked(moved, monkeypatch)
    moved.refining.run()
    moved.objects.rename(0, "Ball")
    asked.answer()
    assert moved.refining.refined is not None and moved.object.name == "Ball"


def test_its_strength_is_live_and_one_step(moved, monkeypatch):
    asked = Asked(moved, monkeypatch)
    moved.refining.run()
    asked.answer()
    full, layers = moved.document, moved.cache.refined.layers
    for strength in (0.8, 0.5):
        moved.refining.preview_strength(strength)
        (layer,) = layers(moved.document, moved.view)
        assert abs(int(layer.rgba[..., 3].max()) - 255 * strength) <= 1
    moved.commit("Amount of refinement")
    assert moved.refining.refined.strength == 0.5
    assert moved.refining.refined.pixels is full.refined.pixels
    moved.undo()
    assert moved.document is full


def test_it_is_taken_away_and_comes_back_by_undo(moved, monkeypatch):
    before, asked = moved.document, Asked(moved, monkeypatch)
    assert COMMANDS["unrefine"].why_not(moved) == "The edit is not refined"
    moved.refining.run()
    asked.answer()
    refined = moved.document
    run(moved, "unrefine")
    assert moved.refining.refined is None and moved.document.backends == before.backends
    assert np.array_equal(composite(moved.document).pixels, composite(before).pixels)
    moved.undo()
    assert moved.document is refined


def test_it_goes_when_the_focus_changes(moved, monkeypatch):
    asked = Asked(moved, monkeypatch)
    moved.refining.run()
    asked.answer()
    assert edits.set_share(moved.document, 0, "defocus", 1.0).refined is None


def test_without_a_model_a_sentence_says_where_to_get_one(moved):
    moved.methods.forget()
    moved.methods.of("refine")
    wait_until(moved, lambda: moved.methods.taken("inpaint") != "")
    if moved.methods.taken("refine"):
        pytest.skip("a refiner's model is here")
    reason = COMMANDS["refine"].why_not(moved)
    assert reason is not None and "Models" in reason
    before = moved.document
    run(moved, "refine")
    assert moved.message.text == reason and moved.document is before
    moved.refining.run()  # and the worker refuses as well
    wait_until(moved, lambda: moved.message is not None and moved.message.is_error)
    assert "no refiner can run here" in moved.message.text.lower()


def test_it_is_for_what_has_moved(editor, ball):
    editor.start(ball)
    assert COMMANDS["refine"].why_not(editor) == "Move the object first"
