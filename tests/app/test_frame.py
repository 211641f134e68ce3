"""A frame is built in one pass: each object is posed, lit and drawn once, in that order."""

from __future__ import annotations

import sys
from collections import Counter
from types import FrameType

import numpy as np
import pytest

from editor_steps import wait_until
from objectmorpher.canvas.derived import Derived
from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.canvas.layer import FrameObject
from objectmorpher.canvas.layers import Layers
from objectmorpher.canvas.lights import Lights
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.posing import EXPECT
from objectmorpher.editor.view import Shown, ToolName, ViewState
from objectmorpher.tools.pointer import Button, Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher_core.deform.arap import ArapSolver
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import Shadow

PARTS = {
    Derived.posed.__code__: "posed", Lights.of.__code__: "lit", Layers._render.__code__: "drawn",
}  # fmt: skip


@pytest.fixture
def pair(ball: Document) -> Document:
    """The ball and a copy of it that were both moved, in a new light and with shadows."""
    document = edits.duplicate(ball, 0)
    for k, across in enumerate((-12.0, 30.0)):
        document = edits.set_placement(document, k, Placement(move=(across, 6.0)))
        document = edits.set_shadow(document, k, Shadow(strength=0.6))
        document = edits.set_share(edits.set_share(document, k, "harmony", 1.0), k, "relight", 0.5)
    return document


def calls(document: Document, cache: Cache, shown: Shown) -> tuple[Counter[str], list[str]]:
    """How often each part was computed for one frame, and in which order."""
    order: list[str] = []

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and frame.f_code in PARTS:
            order.append(PARTS[frame.f_code])

    view = ViewState()
    view.resize((360, 280), 1.0, document.photo.size)
    sys.setprofile(note)
    try:
        build_frame(document, view, cache, shown)
    finally:
        sys.setprofile(None)
    return Counter(order), order


@pytest.mark.parametrize("shown", [Shown.COMPOSITE, Shown.OBJECT, Shown.PROVENANCE])
def test_each_part_of_an_object_is_computed_once(pair: Document, shown: Shown) -> None:
    cache = Cache()
    for document in (pair, edits.set_placement(pair, 0, Placement(move=(-14.0, 6.0)))):
        counted, order = calls(document, cache, shown)
        drawn = counted.pop("drawn")
        assert counted == {"posed": 2, "lit": 2}
        assert drawn == (2 if document is pair else 1), "what did not move keeps its picture"
        firsts = [order.index(part) for part in ("posed", "lit", "drawn")]
        assert firsts == sorted(firsts)


def test_shadows_and_pictures_are_those_of_the_objects_of_the_frame(pair: Document) -> None:
    cache, view = Cache(), ViewState()
    cache.frame_time = np.inf
    view.resize((360, 280), 1.0, pair.photo.size)
    frame = build_frame(pair, view, cache)
    objects = [own for own in frame.objects if isinstance(own, FrameObject)]
    assert [own.k for own in objects] == [0, 1]
    assert all(own.layer is not None for own in objects)
    assert frame.layers == tuple(own.layer for own in objects)
    assert len(frame.shades) == sum(own.lit.shade is not None for own in objects) > 0


def test_the_first_frame_of_a_drag_finds_the_solver_ready(editor: Editor, ball: Document) -> None:
    """It is made ready in a thread when the point is taken hold of."""
    editor.start(ball)
    editor.view.tool = ToolName.POSE
    at = editor.view.canvas_from_image(np.array([90.0, 60.0]))
    start = Pointer(float(at[0]), float(at[1]), Button.LEFT, is_down=True)
    editor.hand.press(PoseTool().press(editor, start), Button.LEFT)
    wait_until(editor, lambda: not editor.chores.is_busy(EXPECT))
    asked: list[str] = []

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and frame.f_code is ArapSolver.constrain.__code__:
            asked.append("constrain")

    sys.setprofile(note)
    try:
        editor.hand.move(Pointer(start.x + 30, start.y, Button.LEFT, is_down=True))
    finally:
        sys.setprofile(None)
    assert editor.preview is not None and editor.preview.objects[0].pose is not None
    assert not asked
    editor.hand.abort(editor)
