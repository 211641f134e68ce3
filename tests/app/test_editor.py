"""The whole job without a window: open, select, lift, pose, place, export, save, reload, undo."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import CENTRE, lift_ball, open_file, wait_for_jobs, wait_until
from objectmorpher.commands import COMMANDS, next_step, run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.filing import Dialog
from objectmorpher.editor.view import ToolName
from objectmorpher.tools.brush_tools import MaskTool
from objectmorpher.tools.pointer import Button, Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher.tools.select_tool import SelectTool
from objectmorpher.worker.requests import LIFT
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import decode_session
from strokes import move, press, release, stroke

PIXEL = 1.0  # canvas px: a handle ends within one of its target


def canvas_xy(editor: Editor, x: float, y: float) -> np.ndarray:
    return editor.view.canvas_from_image(np.array([x, y]))


def drag(editor: Editor, start: np.ndarray, end: np.ndarray) -> None:
    """A stroke of the Pose tool in five moves."""
    shares = (0, 0.2, 0.5, 0.8, 1.0, 1.0)
    stroke(editor, PoseTool(), *(start + share * (end - start) for share in shares))


def test_the_whole_job(editor: Editor, tmp_path: Path, photo_bytes: bytes) -> None:
    assert editor.history is not None
    opened = editor.document
    assert next_step(editor) == ("Click an object in the photo", None)
    lifted = lift_ball(editor)
    assert next_step(editor)[1] is None  # "Drag a point on the object"

    start, end = canvas_xy(editor, 90, 50), canvas_xy(editor, 110, 40)
    drag(editor, start, end)
    assert editor.history.undo_label == "Drag point"
    assert editor.object is not None
    assert len(editor.object.handles) == 1
    assert editor.document is not None
    handle = editor.object.handles[0]
    puppet = editor.derived.shape(editor.document.photo, editor.object).puppet
    xy = puppet.picture_of(handle.point, editor.object.pose, editor.object.placement)
    np.testing.assert_allclose(editor.view.canvas_from_image(xy), end, atol=PIXEL)
    assert next_step(editor) == ("Export photo…", "export")

    editor.placing.move_to(Placement(move=(12.0, -4.0), turn=(10.0, 0.0, 0.0)))
    editor.commit("Move object")
    posed = editor.document

    picture = tmp_path / "out.png"
    editor.filing.choose(Dialog.EXPORT, picture)
    session = tmp_path / "ball.omorph"
    editor.filing.choose(Dialog.SAVE, session)
    wait_for_jobs(editor)
    assert editor.is_saved, editor.message
    before, after = editor.document.photo.pixels, np.asarray(Image.open(picture))
    assert after.shape == before.shape
    assert (after != before).any(axis=2).mean() > 0.05
    np.testing.assert_array_equal(after[:, :20], before[:, :20])

    for _ in range(10):
        editor.undo()
    assert editor.history.document is opened
    for _ in range(10):
        editor.redo()
    assert editor.history.document is posed
    editor.undo()
    editor.undo()
    assert editor.history.document is lifted

    run(editor, "close")
    editor.filing.answer_discard()
    editor.filing.open(session)
    wait_for_jobs(editor)
    assert editor.path == session
    assert editor.is_saved
    assert editor.object is not None
    np.testing.assert_array_equal(editor.object.handles[0].point, handle.point)
    assert editor.object.placement == Placement(move=(12.0, -4.0), turn=(10.0, 0.0, 0.0))
    assert decode_session(session.read_bytes()).photo.source == photo_bytes


def test_a_second_click_refines_and_undo_takes_it_back(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    assert editor.selection.pending is not None  # shown at once
    wait_for_jobs(editor)
    first = editor.mask
    editor.selection.add_click(10, 10, False)
    wait_for_jobs(editor)
    assert len(editor.selection.prompt.clicks) == 2
    run(editor, "undo")
    assert editor.mask is first
    run(editor, "undo")
    assert editor.mask is None
    assert len(editor.selection.prompt.clicks) == 0


def test_undo_while_selecting_takes_the_click_back(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    run(editor, "undo")
    wait_for_jobs(editor)
    assert editor.selection.pending is None
    assert editor.mask is None


def test_a_lift_that_is_promised_comes_after_further_clicks_too(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    editor.tasks.lift_when_selected()
    editor.selection.add_click(10, 10, False)
    wait_until(editor, lambda: editor.jobs.is_busy(LIFT))
    assert len(editor.selection.prompt.clicks) == 2
    editor.jobs.cancel(LIFT)
    wait_for_jobs(editor)


def test_clicks_before_the_first_answer_are_one(editor: Editor) -> None:
    for _ in range(3):
        editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    prompt = editor.selection.prompt
    assert (len(prompt.clicks), prompt.level) == (1, editor.view.selecting.level)


@pytest.mark.parametrize("is_late", [False, True])
@pytest.mark.parametrize("is_subject", [False, True])
def test_what_is_painted_before_an_answer_comes_is_kept_beside_it(
    editor: Editor, is_late: bool, is_subject: bool, request: pytest.FixtureRequest
) -> None:
    """`is_late`: the answer comes during the stroke."""
    if is_subject:
        request.getfixturevalue("networks")  # nothing else knows a subject

    def ask() -> None:
        if is_subject:
            editor.selection.select_subject()
        else:
            editor.selection.add_click(*CENTRE, True)

    ask()
    wait_for_jobs(editor)
    found = editor.mask
    run(editor, "undo")
    ask()
    editor.view.tool, editor.view.brush = ToolName.MASK, Brush(6.0, 1.0)
    near, far = editor.view.canvas_from_image(np.array([(20.0, 20.0), (60.0, 20.0)]))
    press(editor, MaskTool(), near)
    move(editor, far)
    if is_late:
        wait_for_jobs(editor)
    release(editor, far)
    painted = editor.mask
    assert painted is not None and painted[20, 40]
    wait_for_jobs(editor)
    assert found is not None and editor.mask is not None
    np.testing.assert_array_equal(editor.mask, found | painted)
    assert editor.selection.pending is None and not editor.selection.prompt.is_empty
    run(editor, "undo")
    assert editor.mask is painted
    run(editor, "undo")
    assert editor.mask is None


def test_while_an_object_is_lifted_no_one_is_told_to_lift_it(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    assert why_not(editor, "pose") == "Lift an object first"
    run(editor, "lift")
    for name in ("pose", "forward", "bare", "lift"):
        assert why_not(editor, name) == "The object is being lifted", name
    editor.choose_tool(ToolName.PLACE)
    assert editor.message is not None and editor.message.text == "The object is being lifted"
    editor.jobs.cancel()
    wait_for_jobs(editor)
    assert why_not(editor, "pose") == "Lift an object first"


def test_what_is_being_lifted_is_not_selected_otherwise_by_what_was_meant_as_a_pin(
    editor: Editor,
) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    before = editor.mask
    run(editor, "lift")
    pinned = editor.view.canvas_from_image(np.array(CENTRE) + (6.0, 4.0))
    stroke(editor, SelectTool(), pinned, pinned, button=Button.RIGHT)
    assert editor.message is not None and "being lifted" in editor.message.text
    wait_for_jobs(editor)
    assert editor.mask is before and editor.is_lifted and editor.view.tool is ToolName.POSE


def test_what_is_painted_while_it_is_lifted_is_lifted_with_it(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    run(editor, "lift")
    editor.view.tool, editor.view.brush = ToolName.MASK, Brush(6.0, 1.0)
    ends = editor.view.canvas_from_image(np.array([(20.0, 20.0), (60.0, 20.0)]))
    stroke(editor, MaskTool(), *ends)
    wait_for_jobs(editor)
    assert editor.is_lifted and editor.mask is not None and editor.mask[20, 40]
    assert editor.chosen.matte is not None and editor.chosen.matte.box[1] < 20


def test_an_answer_to_an_old_question_is_dropped(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    editor.tasks.lift()
    editor.selection.clear()
    wait_for_jobs(editor)
    assert editor.mask is None
    assert not editor.is_lifted


def test_an_aborted_stroke_changes_nothing(editor: Editor, ball: Document) -> None:
    before = ball
    editor.start(ball)
    start = canvas_xy(editor, 90, 60)
    press(editor, PoseTool(), start)
    move(editor, start + 60)
    assert editor.document is not before
    editor.escape()
    assert editor.document is before
    assert not editor.hand.is_busy


def test_pins_hold_and_handles_can_be_removed(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    pin, start = canvas_xy(editor, 90, 100), canvas_xy(editor, 90, 50)
    for at, alt in ((pin, True), (start, False)):
        press(editor, PoseTool(), at, alt=alt)
        release(editor, at)
    assert editor.object is not None
    assert [h.is_pin for h in editor.object.handles] == [True, False]
    held = editor.posing.positions()[0]
    editor.posing.select(1)
    editor.posing.nudge(10, 0)
    np.testing.assert_allclose(editor.posing.positions()[0], held, atol=1e-6)
    assert editor.history is not None
    assert editor.history.undo_label == "Nudge point"
    pose = editor.object.pose
    editor.posing.remove(1)
    editor.posing.remove(0)
    assert editor.object.pose is pose  # nothing moves because something lets go
    assert editor.object.handles == ()
    editor.posing.reset()
    assert editor.object.pose is None


def test_errors_are_one_sentence_and_change_nothing(editor: Editor, tmp_path: Path) -> None:
    document = editor.document
    broken = tmp_path / "broken.jpg"
    broken.write_bytes(b"\xff\xd8\xff not a photo")
    for path in (broken, tmp_path / "missing.png", tmp_path):
        open_file(editor, path)
        assert editor.message is not None
        assert editor.message.is_error
        assert "\n" not in editor.message.text
        assert editor.document is document
    editor.exporting.export_to(tmp_path / "out.gif")
    assert editor.message.is_error
    assert "gif" in editor.message.text


def test_the_opened_photo_is_never_overwritten(editor: Editor, photo_bytes: bytes) -> None:
    assert editor.source is not None
    editor.exporting.export_to(editor.source)
    wait_for_jobs(editor)
    assert editor.message is not None
    assert editor.message.is_error
    assert editor.source.read_bytes() == photo_bytes


def test_an_export_that_cannot_be_written_says_so(editor: Editor, tmp_path: Path) -> None:
    editor.exporting.export_to(tmp_path / "no folder" / "out.png")
    wait_for_jobs(editor)
    assert editor.message is not None
    assert editor.message.is_error
    assert not (tmp_path / "no folder").exists()


def test_unsaved_changes_are_asked_about(editor: Editor, photo_path: Path) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    document = editor.document
    run(editor, "close")
    assert editor.filing.question is not None
    editor.filing.answer_cancel()
    assert editor.document is document
    run(editor, "close")
    editor.filing.answer_save()
    assert editor.filing.wanted is Dialog.SAVE
    session = photo_path.with_suffix(".omorph")
    editor.filing.choose(Dialog.SAVE, session)
    wait_for_jobs(editor)
    assert session.exists()
    assert editor.document is None  # saved, and then closed


def test_what_cannot_be_done_says_why(editor: Editor) -> None:
    assert COMMANDS["lift"].why_not(editor) == "Click an object in the photo first"
    assert COMMANDS["pose"].why_not(editor) == "Lift an object first"
    run(editor, "pose")
    assert editor.view.tool is ToolName.SELECT
    assert editor.message is not None
    assert editor.message.text == "Lift an object first"


def test_the_editor_needs_no_window_and_no_heavy_modules() -> None:
    code = (
        "import sys, objectmorpher.editor.editor, objectmorpher.commands; "
        "import objectmorpher.tools.place_tool, objectmorpher.tools.pose_tool; "
        "heavy = {'moderngl', 'imgui_bundle', 'glfw', 'torch', 'numba', 'scipy'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    root = Path(__file__).parents[2]
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root
    )
    assert result.stdout.strip() == "[]"


def test_a_held_drag_comes_to_rest_and_is_then_left_alone(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    start = canvas_xy(editor, 90, 50)
    handle = editor.posing.start_handle(start, is_pin=False)
    assert handle is not None
    spot = editor.posing.spot(handle)
    editor.posing.drag(handle, spot.moved(np.array([30.0, -20.0]), 0.0))
    assert editor.posing.is_restless
    for _ in range(500):
        editor.posing.relax()
    assert not editor.posing.is_restless
    at_rest = editor.preview
    editor.posing.relax()
    assert editor.preview is at_rest
    editor.commit("")


def test_a_click_beside_a_handle_on_its_control_point_is_no_step(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    start = canvas_xy(editor, 90, 50)
    drag(editor, start, canvas_xy(editor, 110, 40))
    document, thing = editor.document, editor.object
    assert thing is not None and thing.lifted is not None
    target = editor.view.canvas_from_image(editor.posing.positions()[0])
    for angle in np.arange(0, 2 * np.pi, 0.1):  # just out of the handle's reach
        at = target + 13.0 * np.array([np.cos(angle), np.sin(angle)])
        seen = editor.posing.surface_at(at)
        if PoseTool().handle_at(editor, Pointer(*at)) is None and seen is not None:
            node = edits.nearest_control_point(thing.lifted, seen.rest)
            if node == thing.handles[0].control_point:
                break
    else:
        pytest.fail("no such place was found")
    drag(editor, at, at)
    assert editor.document is document
