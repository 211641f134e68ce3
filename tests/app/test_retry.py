"""What failed may be tried again from the status line, where that can help; with real jobs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import job_functions
from editor_steps import open_file, wait_for_jobs
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.tasks import PLATE
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement, Prompt


def retry(editor: Editor) -> None:
    """Presses the button beside the message."""
    assert editor.message is not None and editor.message.is_error
    action = editor.message.action
    assert action is not None and action.label == "Retry"
    editor.message = None
    action.run()
    wait_for_jobs(editor)


@pytest.fixture
def moved(editor: Editor, ball: Document, tmp_path: Path) -> Editor:
    """A document with a change that is not saved, and no room on the disk for the first try."""
    editor.start(ball)
    editor.apply("Move object", edits.set_placement(ball, 0, Placement(move=(9.0, 0.0))))
    (tmp_path / "FULL").touch()
    return editor


def test_a_full_disk_can_be_cleared_and_the_session_saved_as_it_is_then(
    moved: Editor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "objectmorpher.worker.job_functions.write_session", job_functions.save_when_there_is_room
    )
    moved.filing.save_as(tmp_path / "ball.omorph")
    wait_for_jobs(moved)
    assert moved.message is not None and "No space left" in moved.message.text
    assert not moved.is_saved
    message, document = moved.message, moved.document
    assert document is not None
    moved.apply("Rename object", edits.rename(document, 0, "Ball"))
    moved.message = message
    retry(moved)
    assert moved.is_saved, "also what was changed after the first try"
    assert moved.path == tmp_path / "ball.omorph"


def test_an_export_can_be_tried_again(
    moved: Editor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "objectmorpher.editor.intents.exporting.write_export",
        job_functions.export_when_there_is_room,
    )
    moved.exporting.export_to(tmp_path / "out.png")
    wait_for_jobs(moved)
    retry(moved)
    assert moved.message is not None and moved.message.text.startswith("Exported out.png to ")


def test_a_background_that_failed_can_be_tried_again(
    editor: Editor, ball: Document, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as broken:
        broken.setattr("objectmorpher.worker.job_functions.inpaint", job_functions.inpaint_badly)
        editor.start(edits.set_plate(ball, None))
        wait_for_jobs(editor)
    assert editor.message is not None and "did not converge" in editor.message.text
    retry(editor)
    assert editor.document is not None and editor.document.plate is not None


@pytest.mark.slow
def test_a_background_that_was_cancelled_can_be_asked_for(editor: Editor, ball: Document) -> None:
    editor.start(edits.set_plate(ball, None))
    editor.poll()
    editor.jobs.cancel()
    wait_for_jobs(editor)
    assert editor.message is not None and editor.message.action is not None
    assert not editor.message.is_error
    editor.message.action.run()
    wait_for_jobs(editor)
    assert editor.document is not None and editor.document.plate is not None


def test_a_background_is_there_again_after_it_was_taken_off_a_moved_object(
    editor: Editor, ball: Document
) -> None:
    """Where it came with the session, it is filled in; where it was filled in here, it is kept."""
    editor.start(ball)
    fills = []
    for move in (5.0, 9.0):
        document = editor.document
        assert document is not None
        moved = edits.set_placement(document, 0, Placement(move=(move, 0.0)))
        editor.apply("Move object", moved)
        wait_for_jobs(editor)
        editor.apply("Without background", edits.set_plate(moved, None))
        wait_for_jobs(editor)
        assert editor.document is not None
        fills.append(editor.document.plate)
    assert fills[0] is not None and fills[0] is not ball.plate
    assert fills[1] is fills[0]


@pytest.mark.slow
def test_a_background_that_gave_way_to_another_is_filled_in_when_it_is_wanted_again(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    mask = np.zeros_like(ball.objects[0].mask)
    mask[:20, :20] = True
    two = edits.set_mask(edits.add_object(ball), 1, mask, Prompt())
    two = edits.keep_in_front(two, 1, ball.objects[0].matte)
    assert two.plate is None
    editor.apply("Keep in front", two)
    editor.poll()
    assert editor.jobs.is_busy(PLATE)
    editor.undo()
    editor.composing.fill_from((), "Fill from a spot", lambda: None)  # as a drag of a source does
    wait_for_jobs(editor)
    editor.apply("Keep in front", two)
    wait_for_jobs(editor)
    assert editor.document is not None and editor.document.plate is not None


def test_bad_input_is_not_tried_again(editor: Editor, tmp_path: Path) -> None:
    for name, data in (("cut.png", b"\x89PNG\r\n\x1a\n"), ("text.jpg", b"no photo")):
        (tmp_path / name).write_bytes(data)
        open_file(editor, tmp_path / name)
        assert editor.message is not None and editor.message.is_error
        assert editor.message.action is None
    open_file(editor, tmp_path / "gone.png")
    assert editor.message.is_error and editor.message.action is None
