"""Take from here: a drag from what should be there to where it is wanted."""

from __future__ import annotations

import numpy as np
import pytest

from editor_steps import wait_for_jobs, wait_until
from objectmorpher.commands import COMMANDS, run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import Composed, ToolName
from objectmorpher.tools.brush_tools import ComposeTool
from objectmorpher.tools.pointer import Button
from objectmorpher_core.compose.plate.plate import plate_picture
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.settings import Hint
from objectmorpher_core.session.file import decode_session, encode_session
from strokes import move, press, stroke


@pytest.fixture
def taking(editor: Editor, ball: Document) -> Editor:
    """The ball's background, shown alone; a drag says from where it is taken."""
    editor.start(ball)
    editor.view.tool = ToolName.COMPOSE
    run(editor, "take_from")
    return editor


@pytest.fixture(autouse=True)
def clean(shared_editor: Editor):
    yield
    shared_editor.view.compose.is_bare = False
    shared_editor.view.compose.drag = Composed.REPAIR


def middle(document: Document) -> tuple[float, float]:
    """Image px in the middle of what is filled in."""
    plate = document.plate
    assert plate is not None
    rows, columns = np.nonzero(plate.hole)
    return float(columns.mean()) + plate.left, float(rows.mean()) + plate.top


def drag(editor: Editor, *places: tuple[float, float], button: Button = Button.LEFT) -> None:
    """A stroke of the Compose tool, image px."""
    at = [editor.view.canvas_from_image(np.array(p)) for p in places]
    stroke(editor, ComposeTool(), at[0], *at, button=button)


def test_the_command_shows_the_background_and_comes_back(taking: Editor) -> None:
    assert taking.view.compose.is_bare and taking.view.compose.drag is Composed.TAKE
    run(taking, "take_from")
    assert taking.view.compose.drag is Composed.REPAIR
    reason = COMMANDS["forget_sources"].why_not(taking)
    assert reason == "No fill source has been set"


def test_a_drag_is_one_step_with_its_background(taking: Editor, ball: Document) -> None:
    drag(taking, (16, 20), middle(ball))
    (hint,) = taking.hinting.shown  # at once, the background a little later
    assert taking.document is ball
    wait_until(taking, lambda: taking.document is not ball)
    document = taking.document
    assert document is not None and document.hints == (hint,)
    np.testing.assert_allclose((*hint.source, *hint.to), (16, 20, *middle(ball)), atol=0.01)
    assert hint.radius == taking.view.brush.radius
    assert taking.history is not None and taking.history.undo_label == "Fill from a spot"
    assert not np.array_equal(plate_picture(document), plate_picture(ball))
    outside = np.ones(document.photo.pixels.shape[:2], bool)
    x0, y0, x1, y1 = document.plate.box
    outside[y0:y1, x0:x1] = ~document.plate.hole
    assert np.array_equal(plate_picture(document)[outside], document.photo.pixels[outside])
    assert decode_session(encode_session(document)).hints == document.hints
    taking.undo()
    assert taking.document is ball and not taking.hinting.shown
    wait_for_jobs(taking)


@pytest.mark.slow
def test_drags_in_a_row_add_up_and_are_forgotten_one_by_one(taking: Editor, ball: Document) -> None:
    x, y = middle(ball)
    drag(taking, (12, 12), (x, y))
    drag(taking, (12, 100), (x, y + 5))
    assert len(taking.hinting.shown) == 2
    wait_for_jobs(taking)
    wait_until(taking, lambda: len(taking.document.hints) == 2)
    drag(taking, (12, 12), button=Button.RIGHT)
    wait_until(taking, lambda: len(taking.document.hints) == 1)
    assert taking.document.hints[0].source == pytest.approx((12, 100), abs=0.01)
    run(taking, "forget_sources")
    wait_until(taking, lambda: not taking.document.hints)


def test_a_click_and_a_drag_to_the_photo_say_nothing(taking: Editor, ball: Document) -> None:
    drag(taking, middle(ball))
    assert not taking.hinting.shown
    taking.view.brush = type(taking.view.brush)(radius=2.0)
    drag(taking, middle(ball), (3, 3))
    assert not taking.hinting.shown and taking.document is ball
    assert taking.message is not None and "filled in" in taking.message.text


def test_escape_takes_the_drag_back(taking: Editor, ball: Document) -> None:
    start, end = (taking.view.canvas_from_image(np.array(p)) for p in ((16, 20), middle(ball)))
    press(taking, ComposeTool(), start)
    move(taking, end)
    assert isinstance(taking.hinting.dragged, Hint)
    taking.escape()
    assert taking.hinting.dragged is None and taking.document is ball
    assert not taking.jobs.is_busy("plate")


def test_a_background_filled_anew_keeps_the_hints(taking: Editor, ball: Document) -> None:
    drag(taking, (16, 20), middle(ball))
    wait_until(taking, lambda: bool(taking.document.hints))
    hints = taking.document.hints
    run(taking, "fill_again")
    seed = ball.plate.seed
    wait_until(taking, lambda: taking.document.plate.seed == seed + 1)
    assert taking.document.hints == hints
    wait_for_jobs(taking)
