"""Walking around the object: what is shown turns, the document stays."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from objectmorpher.canvas.frame import build_frame, drawn_order
from objectmorpher.commands import COMMANDS, next_step, run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import STEEPEST, Shown, ToolName
from objectmorpher.tools.pointer import TURN_SPEED
from objectmorpher.tools.registry import LookTool
from objectmorpher_core.base.rotations import turn_matrix
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from strokes import stroke

PLACED = Placement(move=(20.0, 5.0), depth=0.3, turn=(10.0, 20.0, 30.0), scale=0.8)


@pytest.fixture
def looking(editor: Editor, ball: Document) -> Editor:
    editor.start(edits.set_placement(ball, 0, PLACED))
    editor.choose_tool(ToolName.LOOK)
    return editor


def drag(editor: Editor, dx: float, dy: float, clicks: int = 1) -> None:
    stroke(editor, LookTool(), (300, 200), (300 + dx, 200 + dy), clicks=clicks)


def test_dragging_turns_what_is_shown_and_not_the_document(looking: Editor) -> None:
    before = looking.document
    assert looking.looking.document is before
    drag(looking, 100, 50)
    assert looking.document is before
    assert looking.history is not None and looking.history.undo_label is None
    shown = looking.looking.document
    assert shown is not None and shown is not before
    lifted, camera = shown.objects[0].lifted, shown.photo.camera
    assert lifted is not None
    motion = shown.objects[0].placement.matrix(lifted, camera)
    turn = turn_matrix(-100 * TURN_SPEED, 50 * TURN_SPEED, 0) @ turn_matrix(*PLACED.turn)
    np.testing.assert_allclose(motion[:3, :3], 0.8 * turn, atol=1e-9)
    middle = camera.project(motion[:3, :3] @ lifted.centre + motion[:3, 3])
    np.testing.assert_allclose(middle, [90, 70], atol=1e-6)
    assert looking.looking.document is shown, "the same as long as nothing changes"


def test_it_never_turns_over_the_top(looking: Editor) -> None:
    drag(looking, 0, 4000)
    assert looking.view.orbit is not None
    assert looking.view.orbit.pitch == STEEPEST


@pytest.mark.parametrize("way", ["double click", "button", "tool"])
def test_the_photos_view_comes_back(looking: Editor, way: str) -> None:
    before = looking.document
    drag(looking, 80, 0)
    assert why_not(looking, "reset_look") is None
    if way == "double click":
        drag(looking, 0, 0, clicks=2)
    elif way == "button":
        run(looking, "reset_look")
    else:
        run(looking, "place")
    assert looking.looking.orbit is None
    assert looking.looking.document is before


@pytest.mark.parametrize("shown", [Shown.OBJECT, Shown.DEPTH, Shown.PROVENANCE, Shown.STRAIN])
def test_pictures_are_right_when_switching_there_and_back(looking: Editor, shown: Shown) -> None:
    cache, document = looking.cache, looking.document
    cache.frame_time = np.inf
    assert document is not None
    before = [
        layer.rgba.copy() for layer in build_frame(document, looking.view, cache, shown).layers
    ]
    drag(looking, 120, 0)
    turned = looking.looking.document
    assert turned is not None
    there = build_frame(turned, looking.view, cache, shown).layers
    assert there[-1].rgba.shape != before[-1].shape
    after = build_frame(document, looking.view, cache, shown).layers
    assert len(after) == len(before)
    for a, b in zip(after, before, strict=True):
        np.testing.assert_array_equal(a.rgba, b)
    cache.frame_time = 0.028


def test_only_the_current_object_is_shown(looking: Editor) -> None:
    run(looking, "duplicate")
    drag(looking, 60, 0)
    shown = looking.looking.document
    assert shown is not None
    posed = partial(looking.derived.posed, shown)
    assert drawn_order(shown, Shown.OBJECT, posed) == [1]


def test_the_next_step_after_looking_is_posing(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    run(editor, "look")
    assert next_step(editor) == ("Pose the object", "pose")


def test_zooms_have_commands(looking: Editor) -> None:
    for name, zoom in (("actual", 1.0), ("double", 2.0), ("pixels", 8.0)):
        run(looking, name)
        assert looking.view.zoom == zoom
    assert looking.view.is_at_pixels
    run(looking, "fit")
    assert looking.view.is_fitted


def test_the_list_marks_what_is_shown_while_orbiting(looking: Editor) -> None:
    def marked() -> list[str]:
        on = {name: COMMANDS[name].is_on for name in COMMANDS if name.startswith("show_")}
        return [name for name, is_on in on.items() if is_on is not None and is_on(looking)]

    assert marked() == ["show_composite"]
    drag(looking, 80, 0)
    assert marked() == ["show_object"]
    run(looking, "show_depth")
    assert marked() == ["show_depth"]
    assert looking.looking.orbit is not None, "the other views are there from every side"
    run(looking, "show_composite")
    assert marked() == ["show_composite"]
    assert looking.looking.orbit is None, "the composite is there from the photo's view only"
    drag(looking, 80, 0)
    run(looking, "reset_look")
    assert marked() == ["show_composite"]
