"""Painting on the object with the Compose tool: steps, colours, clones, what the canvas shows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from editor_steps import CENTRE, duplicate, wait_until
from objectmorpher.canvas.frame import build_frame
from objectmorpher.canvas.layer import FrameObject
from objectmorpher.commands import COMMANDS, run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import PaintWith, Shown, ToolName
from objectmorpher.tools.brush_tools import ComposeTool
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from strokes import press, stroke

INK = (0.1, 0.9, 0.2)
AT = (88.0, 66.0)  # image px, on the ball
NEAR = 30  # levels


@pytest.fixture
def painting(editor: Editor, ball: Document) -> Iterator[Editor]:
    """The ball, turned, and a brush on it."""
    editor.start(edits.set_placement(ball, 0, Placement(turn=(30.0, 0.0, 0.0))))
    editor.view.brush = Brush(6.0, 1.0)
    run(editor, "paint")
    editor.view.compose.ink = INK
    yield editor
    editor.view.compose = type(editor.view.compose)()
    editor.view.brush = Brush()


def paint(editor: Editor, *places: tuple[float, float], **held: Any) -> None:
    at = [editor.view.canvas_from_image(np.array(place)) for place in places]
    stroke(editor, ComposeTool(), at[0], *at, **held)
    wait_until(editor, lambda: not editor.painting.is_busy)


def colour_at(document: Document, place: tuple[float, float]) -> np.ndarray:
    return composite(document).pixels[int(place[1]), int(place[0])].astype(int)


def is_ink(colour: np.ndarray) -> bool:
    return bool(np.abs(colour - 255 * np.array(INK)).max() < NEAR)


def test_a_stroke_is_one_step_that_the_canvas_shows(painting: Editor):
    editor, before = painting, painting.document
    assert before is not None and editor.history is not None
    deformer = editor.derived.deformer(before, 0)
    paint(editor, AT, (100.0, 70.0))
    document = editor.document
    assert document is not None and editor.history.undo_label == "Paint on the object"
    assert is_ink(colour_at(document, AT))
    assert editor.derived.deformer(document, 0) is deformer, (
        "nothing that a drag needs is made anew"
    )
    frame = build_frame(document, editor.view, editor.cache, Shown.COMPOSITE, "tiles")
    own = next(o for o in frame.objects if isinstance(o, FrameObject))
    assert own.layer is not None
    x, y = editor.view.canvas_from_image(np.array(AT)) - own.layer.box[:2]
    scale = own.layer.pixels.shape[1] / (own.layer.box[2] - own.layer.box[0])
    assert is_ink(own.layer.pixels[int(y * scale), int(x * scale), :3].astype(int))
    editor.undo()
    assert editor.document is before


def test_paint_on_what_has_not_moved_is_shown_there_alone(painting: Editor, ball: Document):
    editor = painting
    editor.start(ball)
    run(editor, "paint")
    if not editor.view.compose.is_painting:
        run(editor, "paint")
    paint(editor, AT)
    document = editor.document
    assert document is not None
    assert is_ink(colour_at(document, AT))
    frame = build_frame(document, editor.view, editor.cache, Shown.COMPOSITE, "tiles")
    assert frame.blend is not None
    cell = editor.view.width / frame.blend.shape[1]
    x, y = (editor.view.canvas_from_image(np.array(AT)) / cell).astype(int)
    assert frame.blend[y, x] == 1 and (frame.blend > 0).mean() < 0.1


def test_erasing_and_removing_take_it_back(painting: Editor):
    editor, before = painting, painting.document
    assert before is not None
    paint(editor, AT)
    editor.view.brush = Brush(14.0, 1.0)
    paint(editor, AT, alt=True)
    assert editor.document is not None and editor.object is not None
    assert not editor.object.is_painted and editor.history is not None
    assert editor.history.undo_label == "Erase paint"
    assert np.array_equal(composite(editor.document).pixels, composite(before).pixels)
    assert COMMANDS["unpaint"].why_not(editor) is not None
    paint(editor, AT)
    run(editor, "unpaint")
    assert editor.object is not None and not editor.object.is_painted


def test_ctrl_click_takes_a_colour_and_where_to_clone_from(painting: Editor):
    editor, document = painting, painting.document
    assert document is not None
    at = editor.view.canvas_from_image(np.array(AT))
    stroke(editor, ComposeTool(), at, ctrl=True)
    taken = 255 * np.array(editor.view.compose.ink)
    assert np.abs(taken - colour_at(document, AT)).max() < 12
    editor.view.compose.paint_with = PaintWith.CLONE
    paint(editor, (100.0, 80.0))
    assert editor.message is not None and "clone" in editor.message.text
    assert editor.document is document
    wall = (20.0, 20.0)
    stroke(editor, ComposeTool(), editor.view.canvas_from_image(np.array(wall)), ctrl=True)
    paint(editor, (92.0, 80.0))
    assert editor.document is not None
    cloned = colour_at(editor.document, (92.0, 80.0))
    assert np.abs(cloned - document.photo.pixels[20, 20]).max() < 2 * NEAR
    assert np.abs(cloned - colour_at(document, (92.0, 80.0))).max() > 2 * NEAR


@pytest.mark.parametrize("is_behind", [False, True])
def test_what_is_seen_is_taken_from_another_object_too(
    editor: Editor, ball: Document, is_behind: bool
):
    """As the picture shows it: also where the object that is painted on hides a part of it."""
    duplicate(editor, ball, 50.0, 0.0)
    editor.objects.choose(0)
    editor.placing.move_to(Placement(move=(20.0, 30.0)))
    editor.commit("Move object")
    if is_behind:
        run(editor, "to_front")
    editor.view.compose.is_painting = True
    document, at = editor.opened, np.array((CENTRE[0] + 50, CENTRE[1]))
    both = np.array((CENTRE[0] + 30, CENTRE[1] + 15))  # where both balls are
    for place in (at, both):
        editor.painting.pick(editor.view.canvas_from_image(place))
        taken = 255 * np.array(editor.view.compose.ink)
        assert np.abs(taken - colour_at(document, (place[0], place[1]))).max() < 12
    editor.view.compose.paint_with, editor.view.brush = PaintWith.CLONE, Brush(4.0, 1.0)
    editor.view.tool = ToolName.COMPOSE
    stroke(editor, ComposeTool(), editor.view.canvas_from_image(at), ctrl=True)
    spot = (CENTRE[0] + 5, CENTRE[1] + 50)
    paint(editor, spot)
    cloned = colour_at(editor.opened, spot)
    assert np.abs(cloned - colour_at(document, (at[0], at[1]))).max() < NEAR


def test_what_is_locked_takes_none_and_beside_the_object_there_is_nothing(painting: Editor):
    editor, document = painting, painting.document
    paint(editor, (10.0, 10.0))
    assert editor.document is document and editor.message is not None
    editor.lock(0)
    locked = editor.document
    paint(editor, AT)
    assert editor.document is locked and editor.message is not None
    assert "locked" in editor.message.text


def test_a_stroke_is_dropped_by_escape(painting: Editor):
    editor, document = painting, painting.document
    press(editor, ComposeTool(), editor.view.canvas_from_image(np.array(AT)))
    assert editor.painting.painted_layer() is not None
    editor.escape()
    assert editor.painting.painted_layer() is None and editor.document is document
    assert editor.view.tool is ToolName.COMPOSE


def test_undo_takes_back_the_stroke_that_is_not_on_the_object_yet(painting: Editor):
    editor, document = painting, painting.document
    assert editor.history is not None
    editor.apply("Turn", edits.set_placement(editor.opened, 0, Placement(turn=(40.0, 0.0, 0.0))))
    at = editor.view.canvas_from_image(np.array(AT))
    stroke(editor, ComposeTool(), at, at)
    assert editor.painting.is_busy and editor.undo_label == "Paint on the object"
    run(editor, "undo")
    assert not editor.painting.is_busy and editor.painting.painted_layer() is None
    assert editor.history.undo_label == "Turn", "nothing before it"
    wait_until(editor, lambda: editor.chores.is_idle)
    assert editor.object is not None and not editor.object.is_painted
    paint(editor, AT)
    assert editor.object.is_painted, "the next one sticks"
    run(editor, "undo")
    run(editor, "undo")
    assert editor.document is document
