"""Painting regions on the lifted ball, by real strokes of the Pose tool."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from editor_steps import CENTRE
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.rigging import gaps_to_way
from objectmorpher.editor.view import PoseMode, PoseView, ToolName
from objectmorpher.tools.pointer import Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.settings import Rigidity, rigidity_of
from strokes import press, stroke

RADIUS = 8.0  # px, of the brush
TOOL = PoseTool()


@pytest.fixture
def painter(editor: Editor, ball: Document) -> Iterator[Editor]:
    """An editor with the lifted ball, and one handle that was dragged."""
    editor.start(ball)
    editor.view.tool, editor.view.pose = ToolName.POSE, PoseView()
    editor.view.brush = Brush(RADIUS)
    draw(editor, (90, 45), (96, 40))
    yield editor
    editor.view.pose, editor.view.brush = PoseView(), Brush()


def draw(editor: Editor, *places: tuple[float, float], **held: bool) -> None:
    """A stroke through image px."""
    canvas = editor.view.canvas_from_image(np.array(places))
    TOOL.hover(editor, Pointer(*canvas[0], **held))
    stroke(editor, TOOL, canvas[0], *canvas, **held)


def label(editor: Editor) -> str | None:
    assert editor.history is not None
    return editor.history.undo_label


def test_freezing_marks_what_is_under_the_brush_and_seen(painter: Editor) -> None:
    document = painter.document
    assert document is not None and painter.object is not None
    picture = painter.derived.control_points(document, 0)
    depths = painter.derived.control_places(document, 0)[:, 2]
    way = np.array([(75.0, 85.0), (105.0, 85.0)])
    under = gaps_to_way(picture, way) <= RADIUS
    before = painter.object.pose
    assert before is not None
    painter.view.pose.mode = PoseMode.FREEZE
    draw(painter, *(tuple(xy) for xy in way.tolist()))
    held = painter.rigging.rig.held
    assert held is not None and len(held)
    assert under[held].all()
    behind = np.setdiff1d(np.flatnonzero(under), held)
    assert len(behind), "the ball has a back"
    assert depths[held].max() < depths[behind].min()
    assert label(painter) == "Freeze"
    assert len(painter.object.handles) == 1
    pose = painter.object.pose
    assert pose is not None and painter.object.lifted is not None
    np.testing.assert_allclose(pose.points[held], before.points[held], atol=1e-6)
    rest = painter.object.lifted.control_points
    assert np.abs(pose.points - rest).max() > 0.01, "the handle still pulls"
    assert painter.rigging.painted.size == painter.rigging.drawn.size == 0


def test_alt_erases_and_an_aborted_stroke_paints_nothing(painter: Editor) -> None:
    painter.view.pose.mode = PoseMode.FREEZE
    draw(painter, (80, 85), (100, 85))
    before = painter.document
    press(painter, TOOL, painter.view.canvas_from_image(np.array([90, 90])))
    painter.escape()
    assert painter.document is before
    painter.view.brush = Brush(3 * RADIUS)
    draw(painter, (70, 85), (110, 85), alt=True)
    assert painter.rigging.rig.held is None
    assert label(painter) == "Erase"


def test_stiffening_takes_the_panels_factor(painter: Editor) -> None:
    painter.view.pose.mode, painter.view.pose.stiffness = PoseMode.STIFFEN, 7.0
    draw(painter, (80, 80), (100, 80))
    painter.view.pose.stiffness = 0.5
    draw(painter, (80, 100), (100, 100))
    values = [r.value for r in painter.rigging.regions()]
    assert values == [0.5, 7.0]
    painter.rigging.remove(painter.rigging.regions()[0])
    assert [r.value for r in painter.rigging.regions()] == [7.0]


def test_a_stroke_that_begins_on_a_group_makes_it_larger(painter: Editor) -> None:
    painter.view.pose.mode = PoseMode.BODY
    draw(painter, (78, 80), (90, 80))
    (first,) = painter.rigging.rig.bodies
    draw(painter, (90, 80), (102, 80))
    (second,) = painter.rigging.rig.bodies
    assert set(first.tolist()) < set(second.tolist())
    draw(painter, (90, 105), (96, 105))
    assert len(painter.rigging.rig.bodies) == 2
    assert [r.kind for r in painter.rigging.regions()] == [PoseMode.BODY, PoseMode.BODY]


def test_a_cut_across_the_ball_makes_two_parts_and_can_be_erased(painter: Editor) -> None:
    painter.view.pose.mode = PoseMode.CUT
    draw(painter, (30, 80), (90, 82), (150, 80))
    assert painter.document is not None and painter.object is not None
    assert label(painter) == "Cut"
    graph = painter.derived.shape(painter.document.photo, painter.object).puppet.deformer.graph
    assert graph.component_count == 2
    assert len(painter.object.handles) == 1
    painter.view.pose.mode = PoseMode.GLUE
    draw(painter, (90, 72), (90, 92))
    graph = painter.derived.shape(painter.document.photo, painter.object).puppet.deformer.graph
    assert [r.kind for r in painter.rigging.regions()] == [PoseMode.CUT, PoseMode.GLUE]
    painter.view.pose.mode = PoseMode.CUT
    draw(painter, (85, 80), (95, 82), alt=True)
    assert [r.kind for r in painter.rigging.regions()] == [PoseMode.GLUE]


def test_strokes_that_mean_nothing_say_so_and_are_no_step(painter: Editor) -> None:
    before = painter.document
    for mode, places in (
        (PoseMode.CUT, ((5, 5), (20, 5))),
        (PoseMode.GLUE, ((5, 5), (20, 5))),
        (PoseMode.GLUE, ((85, 75), (95, 75))),
        (PoseMode.FREEZE, ((5, 5), (20, 5))),
    ):
        painter.message, painter.view.pose.mode = None, mode
        draw(painter, *places)
        assert painter.document is before
        assert (painter.message is None) is (mode is PoseMode.FREEZE)


def test_a_small_brush_takes_the_nearest_point(painter: Editor) -> None:
    painter.view.brush = replace(painter.view.brush, radius=0.6)
    painter.view.pose.mode = PoseMode.FREEZE
    draw(painter, CENTRE)
    assert painter.rigging.rig.held is not None
    assert len(painter.rigging.rig.held) == 1


def test_a_material_is_one_step_and_keeps_the_handles(painter: Editor) -> None:
    assert painter.object is not None
    handles, before = painter.object.handles, painter.object.pose
    painter.rigging.set_rigidity(Rigidity.RIGID)
    assert painter.object.handles == handles
    assert rigidity_of(painter.object.deform) is Rigidity.RIGID
    assert painter.object.pose is not None and before is not None
    assert np.abs(painter.object.pose.points - before.points).max() > 1e-3
    assert label(painter) == "Rigidity"
    painter.undo()
    assert painter.object.pose is before
