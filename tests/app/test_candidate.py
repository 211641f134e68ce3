"""What a click would select is found while the pointer rests, and never in anybody's way."""

from __future__ import annotations

import time

import numpy as np
import pytest

from editor_steps import CENTRE, wait_for_jobs, wait_until
from objectmorpher.commands import run, take_next_step
from objectmorpher.editor import candidate
from objectmorpher.editor.candidate import CANDIDATE
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.tasks import SELECT
from objectmorpher.editor.view import Selecting, ToolName
from objectmorpher.tools.pointer import Pointer
from objectmorpher.tools.select_tool import SelectTool


def rest_on(editor: Editor, x: float, y: float) -> None:
    """The pointer hovers over image px."""
    editor.view.tool, editor.view.selecting = ToolName.SELECT, Selecting()
    at = editor.view.canvas_from_image(np.array([x, y]))
    SelectTool().hover(editor, Pointer(*at))


def test_a_click_takes_the_candidate_that_is_shown(editor: Editor) -> None:
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    wait_until(editor, lambda: editor.candidates.shown is not None)
    shown = editor.candidates.shown
    assert shown is not None
    assert editor.mask is None
    editor.selection.add_click(CENTRE[0] + 0.2, CENTRE[1], True)
    assert editor.mask is not None, "at once"
    np.testing.assert_array_equal(editor.mask, shown.mask)
    assert not editor.jobs.is_busy(SELECT)
    editor.poll()
    assert editor.candidates.shown is None
    run(editor, "undo")
    assert editor.mask is None


def test_a_click_while_the_candidate_is_found_waits_for_that_answer(editor: Editor) -> None:
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    wait_until(editor, lambda: editor.jobs.is_busy(CANDIDATE))
    editor.selection.add_click(*CENTRE, True)
    assert editor.selection.pending is not None
    assert editor.jobs.is_busy(SELECT)
    assert not editor.jobs.is_busy(CANDIDATE)
    wait_for_jobs(editor)
    assert editor.mask is not None
    assert editor.selection.pending is None


def test_the_users_own_request_ends_the_search_for_a_candidate(editor: Editor) -> None:
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    wait_until(editor, lambda: editor.jobs.is_busy(CANDIDATE))
    editor.selection.set_box((40.0, 15.0, 140.0, 125.0))
    assert not editor.jobs.is_busy(CANDIDATE)
    wait_for_jobs(editor)
    assert editor.mask is not None


def test_a_click_that_another_question_replaced_is_not_made_later(editor: Editor) -> None:
    """It waited for a candidate's answer; the next candidate's is not its own."""
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    wait_until(editor, lambda: editor.jobs.is_busy(CANDIDATE))
    editor.selection.add_click(*CENTRE, True)
    run(editor, "subject")
    assert editor.selection.pending is not None and editor.selection.pending.is_subject
    wait_for_jobs(editor)
    run(editor, "undo")
    rest_on(editor, 20.0, 20.0)
    wait_for_jobs(editor)
    time.sleep(2 * candidate.REST)
    editor.poll()
    wait_for_jobs(editor)
    assert editor.mask is None and editor.message is not None
    assert not editor.message.is_error


def test_nothing_is_asked_while_the_worker_works(editor: Editor) -> None:
    wait_for_jobs(editor)
    editor.selection.add_click(*CENTRE, True)
    rest_on(editor, 20.0, 20.0)
    while editor.selection.pending is not None:
        assert not editor.jobs.is_busy(CANDIDATE)
        editor.poll()
        time.sleep(0.005)
    assert editor.mask is not None


@pytest.mark.parametrize("takes_away", [True, False])
def test_what_a_correction_would_change_is_shown_and_is_what_it_changes(
    editor: Editor, takes_away: bool
) -> None:
    wait_for_jobs(editor)
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    before = editor.mask
    assert before is not None and before[int(CENTRE[1]), int(CENTRE[0])]
    places = np.argwhere(before == takes_away)
    far = np.hypot(*(places + 0.5 - np.array(CENTRE[::-1])).T)
    y, x = places[int(np.argsort(far)[len(far) // 2])] + 0.5
    rest_on(editor, x, y)
    wait_until(editor, lambda: editor.candidates.shown is not None)
    shown = editor.candidates.shown
    assert shown is not None and shown.takes_away == takes_away
    assert shown.changed[int(y), int(x)]
    assert not (shown.changed & (before != takes_away)).any()
    assert editor.mask is before, "nothing is changed by looking"
    editor.selection.add_click(x, y, not takes_away)
    assert editor.mask is not before, "at once"
    np.testing.assert_array_equal(editor.mask, shown.mask)


def test_late_answers_are_shown_and_the_second_is_the_last(
    editor: Editor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(candidate, "TOO_SLOW", 0.0)
    wait_for_jobs(editor)
    for place in (CENTRE, (6.0, 4.0)):
        rest_on(editor, *place)
        editor.poll()
        wait_until(editor, lambda: editor.candidates.shown is not None)
    rest_on(editor, *CENTRE)
    editor.poll()
    assert editor.candidates.shown is None
    time.sleep(2 * candidate.REST)
    editor.poll()
    assert not editor.candidates.is_due and not editor.jobs.is_busy(CANDIDATE)


def test_a_pointer_that_leaves_leaves_no_candidate(editor: Editor) -> None:
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    wait_until(editor, lambda: editor.candidates.shown is not None)
    rest_on(editor, 4.0, 4.0)
    editor.poll()
    assert editor.candidates.shown is None
    rest_on(editor, -50.0, -50.0)
    editor.poll()
    assert not editor.candidates.is_due


def test_enter_is_a_click_also_where_no_candidate_comes(editor: Editor) -> None:
    """Of a slow machine, or while none is there yet; a second Enter lifts what comes."""
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    editor.candidates.shown = None
    take_next_step(editor)
    assert editor.message is None and not editor.is_lifted
    take_next_step(editor)
    assert editor.message is not None, "that it will be lifted"
    wait_for_jobs(editor)
    assert editor.object is not None and editor.object.mask is not None
    assert editor.is_lifted
    prompt = editor.object.prompt
    assert [(c.x, c.y) for c in prompt.clicks] == [CENTRE]
    assert prompt.level == editor.view.selecting.level


def test_enter_beside_the_photo_asks_for_nothing(editor: Editor) -> None:
    wait_for_jobs(editor)
    rest_on(editor, -50.0, -50.0)
    take_next_step(editor)
    wait_for_jobs(editor)
    assert editor.document is not None and not editor.document.objects


def test_enter_takes_the_candidate_then_lifts_it(editor: Editor) -> None:
    wait_for_jobs(editor)
    rest_on(editor, *CENTRE)
    wait_until(editor, lambda: editor.candidates.shown is not None)
    take_next_step(editor)
    assert editor.mask is not None
    take_next_step(editor)
    wait_for_jobs(editor)
    assert editor.is_lifted
    assert editor.view.tool is ToolName.POSE
    before = editor.document
    take_next_step(editor)
    assert editor.document is before, "the next step is the user's: to drag a point"
