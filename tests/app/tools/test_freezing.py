"""Freezing says: leave this as it is now. On the lifted ball, posed by real strokes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from objectmorpher.commands import run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import PoseMode, PoseView, ToolName
from objectmorpher.tools.pointer import Button, Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.document.model import Document
from objectmorpher_core.session.file import decode_session, encode_session

STAYS = 1e-6  # object units
TOOL = PoseTool()
TOP, UP, LOW, DOWN = (90, 45), (104, 34), (90, 105), (80, 112)  # image px


@pytest.fixture
def posed(editor: Editor, ball: Document) -> Iterator[Editor]:
    """The ball with its top dragged away, and frozen there."""
    editor.start(ball)
    editor.view.tool, editor.view.pose = ToolName.POSE, PoseView()
    editor.view.brush = Brush(12.0)
    stroke(editor, TOP, UP)
    editor.view.pose.mode = PoseMode.FREEZE
    stroke(editor, (96, 40), (112, 40))
    editor.view.pose.mode = PoseMode.DRAG
    yield editor
    editor.view.pose, editor.view.brush = PoseView(), Brush()


def stroke(editor: Editor, *places: tuple[float, float]) -> None:
    """Through image px."""
    canvas = [editor.view.canvas_from_image(np.array(place)) for place in places]
    pointer = Pointer(*canvas[0], button=Button.LEFT, is_down=True)
    TOOL.hover(editor, pointer)
    editor.hand.press(TOOL.press(editor, pointer), Button.LEFT)
    for place in canvas[1:]:
        editor.hand.move(Pointer(*place, is_down=True))
    editor.hand.move(Pointer(*canvas[-1], is_down=False))


def points(editor: Editor) -> F64:
    """(M, 3) where the control points are."""
    assert editor.object is not None and editor.object.lifted is not None
    rest = editor.object.lifted.control_points.astype(np.float64)
    return rest if editor.object.pose is None else editor.object.pose.points


def rest_of(editor: Editor) -> F64:
    assert editor.object is not None and editor.object.lifted is not None
    return editor.object.lifted.control_points.astype(np.float64)


def test_frozen_points_stay_where_they_were_posed(posed: Editor) -> None:
    held, before = posed.rigging.rig.held, points(posed)
    assert held is not None
    assert np.abs(before - rest_of(posed))[held].max() > 0.05, "they had been moved"
    stroke(posed, LOW, DOWN)
    assert np.abs(points(posed) - before)[held].max() < STAYS
    assert np.abs(points(posed) - before).max() > 0.02, "the others follow the new handle"
    assert posed.history is not None and posed.history.undo_label == "Drag point"
    posed.undo()
    assert points(posed) is before


def test_freezing_itself_moves_nothing_of_what_is_frozen_and_is_one_step(posed: Editor) -> None:
    held, after = posed.rigging.rig.held, points(posed)
    posed.undo()
    assert posed.rigging.rig.held is None
    assert np.abs(points(posed) - after)[held].max() < STAYS
    posed.redo()
    assert points(posed) is after


def test_it_stays_when_the_handle_that_moved_it_is_gone(posed: Editor) -> None:
    held, before = posed.rigging.rig.held, points(posed)
    posed.posing.remove(0)
    assert posed.object is not None and posed.object.handles == ()
    assert np.abs(points(posed) - before)[held].max() < STAYS
    assert why_not(posed, "reset_pose") is None


def test_resetting_the_pose_takes_frozen_points_to_rest_and_keeps_them_frozen(
    posed: Editor,
) -> None:
    held, before = posed.rigging.rig.held, posed.document
    run(posed, "reset_pose")
    assert posed.object is not None and posed.object.pose is None
    assert posed.rigging.rig.held is not None
    np.testing.assert_array_equal(posed.rigging.rig.held, held)
    stroke(posed, LOW, DOWN)
    assert np.abs(points(posed) - rest_of(posed))[held].max() < STAYS
    posed.undo()
    posed.undo()
    assert posed.document is before


def test_a_frozen_part_refuses_to_be_dragged_and_says_why(posed: Editor) -> None:
    before = posed.document
    for start in (UP, (112, 42)):  # on its handle, and beside it
        posed.message = None
        stroke(posed, start, (90, 60))
        assert posed.document is before
        assert posed.message is not None and "frozen" in posed.message.text
    posed.posing.select(0)
    posed.posing.nudge(1.0, 0.0)
    assert posed.document is before


def test_thawed_points_follow_again(posed: Editor) -> None:
    held = posed.rigging.rig.held
    posed.rigging.remove(posed.rigging.regions()[0])
    assert posed.rigging.rig.shifts is None
    before = points(posed)
    stroke(posed, UP, (90, 40))
    assert np.abs(points(posed) - before)[held].max() > 0.02


def test_a_session_remembers_where_points_are_frozen(posed: Editor) -> None:
    assert posed.document is not None
    held, before = posed.rigging.rig.held, points(posed)
    posed.start(decode_session(encode_session(posed.document)))
    posed.view.tool = ToolName.POSE
    np.testing.assert_array_equal(points(posed), before)
    stroke(posed, LOW, DOWN)
    assert np.abs(points(posed) - before)[held].max() < STAYS
