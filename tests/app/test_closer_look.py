"""What was answered at a glance is told better within its step, unless the user has gone on."""

from __future__ import annotations

import numpy as np

from editor_steps import CENTRE, HEIGHT, WIDTH, wait_for_jobs
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.tasks import Combine, Question
from objectmorpher_core.document.model import Click, Prompt
from objectmorpher_core.segment import Found

ASKED = Prompt((Click(*CENTRE),))


def glimpse(editor: Editor, combine: Combine = Combine.REFINED) -> np.ndarray:
    """The answer of a click at a glance is taken: a square on the ball."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[60:84, 80:100] = True
    question = Question(ASKED, "Select", editor.current, combine)
    editor.selection.take(question, Found(mask, "grabcut", 0.5, is_final=False))
    assert editor.mask is not None and editor.history is not None
    return mask


def test_a_closer_look_takes_the_place_of_the_glance(editor: Editor) -> None:
    wait_for_jobs(editor)
    assert editor.history is not None
    mask = glimpse(editor)
    np.testing.assert_array_equal(editor.mask, mask)
    steps = editor.history.steps
    wait_for_jobs(editor)
    assert editor.history.steps == steps
    assert editor.mask is not None
    assert (editor.mask & mask).sum() > 0.95 * mask.sum(), "the ball, which is larger"
    assert editor.mask.sum() > 3 * mask.sum()
    assert editor.object is not None and editor.object.prompt == ASKED
    run(editor, "undo")
    assert editor.mask is None


def test_who_has_gone_on_is_not_disturbed(editor: Editor) -> None:
    wait_for_jobs(editor)
    glimpse(editor)
    line = np.array([(10.0, 10.0), (30.0, 10.0), (30.0, 30.0), (10.0, 30.0)])
    editor.selection.set_outline(line)
    drawn = editor.mask
    wait_for_jobs(editor)
    assert editor.mask is drawn
    run(editor, "undo")
    wait_for_jobs(editor)
    assert editor.mask is not None
    assert editor.mask.sum() == 24 * 20, "the step before is as it was left"


def test_what_was_added_at_a_glance_is_added_anew(editor: Editor) -> None:
    wait_for_jobs(editor)
    line = np.array([(5.0, 5.0), (20.0, 5.0), (20.0, 20.0), (5.0, 20.0)])
    editor.selection.set_outline(line)
    assert editor.mask is not None
    drawn = editor.mask
    mask = glimpse(editor, Combine.ADDED)
    wait_for_jobs(editor)
    assert editor.mask is not None
    assert editor.mask[drawn].all()
    assert editor.mask.sum() > drawn.sum() + 3 * mask.sum()
