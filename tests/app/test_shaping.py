"""What is said about a shape, before and after the lift; objects out of files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from editor_steps import CENTRE, close_all, open_file, wait_for_jobs
from objectmorpher.commands import COMMANDS, run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.composing import GRAIN
from objectmorpher.editor.view import Painted, Selecting, ToolName
from objectmorpher.tools.brush_tools import MaskTool
from objectmorpher.tools.place_tool import PlaceTool
from objectmorpher_core import splat_files
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.document import edits
from objectmorpher_core.document.key_edits import is_at_key
from objectmorpher_core.document.model import Document, LiftedObject, Placement, Prompt
from objectmorpher_core.segment.mask_edit import is_selected
from objectmorpher_core.session.file import decode_session, encode_session
from strokes import move, press, stroke
from tests import shapes


@pytest.fixture
def editor(editor: Editor) -> Iterator[Editor]:
    editor.view.selecting, editor.view.brush = Selecting(), Brush(10.0, 1.0)
    yield editor
    editor.view.selecting, editor.view.brush = Selecting(), Brush()


def lifted_of(editor: Editor) -> LiftedObject:
    assert editor.object is not None and editor.object.lifted is not None, editor.message
    return editor.object.lifted


def depth_range(editor: Editor) -> float:
    """World units, of the body."""
    lifted = lifted_of(editor)
    return float(np.ptp(lifted.world_points(lifted.body.means)[:, 2])) / lifted.scale


def paint(editor: Editor, kind: Painted, *places: tuple[float, float], **held: bool) -> None:
    editor.view.tool, editor.view.selecting.painted = ToolName.MASK, kind
    stroke(editor, MaskTool(), *editor.view.canvas_from_image(np.array(places)), **held)
    wait_for_jobs(editor)


def test_the_thickness_is_live_and_one_step(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    document, before = editor.document, depth_range(editor)
    for share in (1.2, 1.5, 0.5):
        editor.shaping.preview_thickness(share)
        assert editor.jobs.is_idle, "nothing is asked of the worker"
    assert editor.committed is document
    assert depth_range(editor) < 0.75 * before
    editor.commit("Thickness")
    assert editor.shaping.settings.thickness == 0.5
    run(editor, "undo")
    assert editor.document is document
    assert editor.shaping.settings.thickness == 1.0


@pytest.mark.slow
def test_a_posed_object_stays_posed_when_it_becomes_thicker(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    assert editor.document is not None
    here = editor.posing.surface_at(editor.view.canvas_from_image(np.array(CENTRE)))
    assert here is not None
    target = here.rest + np.array([0.2, 0.0, 0.0])
    changed = edits.add_handle(editor.document, editor.current, here.rest, target)
    scale = lifted_of(editor).scale
    editor.apply("Move handle", editor.derived.solved(changed, editor.current, None))
    editor.shaping.preview_thickness(0.6)
    editor.commit("Thickness")
    thing = editor.object
    assert thing is not None and thing.pose is not None and thing.lifted is not None
    (handle,) = thing.handles
    world = thing.lifted.world_points(handle.point)
    assert np.abs(editor.document.photo.camera.project(world) - CENTRE).max() < 2.0
    dragged = (handle.target - handle.point) * thing.lifted.scale
    assert dragged[0] == pytest.approx(0.2 * scale, rel=1e-6), "as far as before"
    reached = (
        thing.pose.points[handle.control_point] - thing.lifted.control_points[handle.control_point]
    )
    assert reached[0] * thing.lifted.scale == pytest.approx(0.2 * scale, rel=0.2)


def test_key_poses_and_what_no_handle_holds_are_there_in_another_shape(
    editor: Editor, ball: Document
) -> None:
    """Key poses are solved as the pose of now is, so that it is in the same one as before."""
    editor.start(ball)
    here = editor.posing.surface_at(editor.view.canvas_from_image(np.array(CENTRE)))
    assert here is not None and editor.document is not None
    editor.apply("Add handle", edits.add_handle(editor.document, 0, here.rest))
    for far in (0.2, -0.1):
        target = here.rest + np.array([far, 0.0, 0.0])
        changed = edits.move_handle(editor.committed, 0, 0, target)
        editor.apply("Move handle", editor.derived.solved(changed, 0, None))
        editor.keying.add()
    editor.posing.select_all()
    editor.posing.remove()
    editor.keying.add()
    for number in range(3):
        editor.keying.show(number)
        far = _displaced(editor)
        editor.shaping.preview_thickness(1.1)
        editor.shaping.end_thickness()
        assert editor.keying.count == 3 and editor.keying.shown == number
        assert _displaced(editor) == pytest.approx(far, rel=0.15)
        shown = editor.committed
        editor.keying.step(1)
        editor.keying.show(number)
        assert is_at_key(editor.committed, number)
        assert np.array_equal(editor.object.pose.points, shown.objects[0].pose.points)
        editor.shaping.preview_thickness(1.0)
        editor.shaping.end_thickness()
        assert _displaced(editor) == pytest.approx(far, rel=1e-3)


def _displaced(editor: Editor) -> float:
    """World units: the mean way of the control points from where they rest, with its sign."""
    thing = editor.object
    assert thing is not None and thing.lifted is not None and thing.pose is not None
    return float(
        (thing.pose.points - thing.lifted.control_points)[:, 0].mean() * thing.lifted.scale
    )


@pytest.mark.slow
def test_another_side_is_a_step_and_the_worker_makes_it(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    first = lifted_of(editor)
    editor.shaping.say("Other side", back="mirrored")
    wait_for_jobs(editor)
    assert lifted_of(editor) is not first
    assert editor.history is not None and editor.history.undo_label == "Other side"
    assert lifted_of(editor).splatting == "edged surface"
    editor.shaping.say("Other side", back="continued")
    wait_for_jobs(editor)
    assert lifted_of(editor).splatting == "edged solid"


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_a_kind_is_a_step_the_worker_makes_it_and_a_session_keeps_it(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    before = depth_range(editor)
    assert editor.shaping.recognised_as == "round", "it is a ball"
    editor.shaping.say("Kind of shape", kind="flat")
    wait_for_jobs(editor)
    assert editor.history is not None and editor.history.undo_label == "Kind of shape"
    assert editor.shaping.recognised_as == "flat"
    assert depth_range(editor) < 0.25 * before
    assert editor.document is not None
    (thing,) = decode_session(encode_session(editor.document)).objects
    assert thing.shape.kind == "flat"
    assert thing.lifted is not None and thing.lifted.kind == "flat"


@pytest.mark.slow
def test_what_is_painted_nearer_comes_nearer(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    x, y = CENTRE
    paint(editor, Painted.DEPTH, (x, y), (x + 4, y))
    nearness = editor.shaping.settings.nearness
    assert nearness is not None and nearness.max() > 0.05
    near = lifted_of(editor)
    paint(editor, Painted.DEPTH, (x, y), (x + 4, y), alt=True)
    assert editor.shaping.settings.nearness is None, "as much back as forth"

    def depth(lifted: LiftedObject) -> float:
        gaps = ((lifted.texture.u0 - CENTRE) ** 2).sum(1)
        seen = (lifted.texture.visibility > 0.5) & (lifted.texture.solidity > 0.5)
        k = int(np.where(seen, gaps, np.inf).argmin())
        return float(lifted.world_points(lifted.gaussians.means)[k, 2])

    assert depth(near) < depth(lifted_of(editor)) - 0.02


def test_words_in_a_row_are_all_heeded_in_one_step(editor: Editor, ball: Document) -> None:
    """Also what is said without the worker while it lifts the object anew."""
    editor.start(ball)
    editor.shaping.say("Kind of shape", kind="round")
    editor.shaping.say("Other side", back="mirrored")
    said = editor.shaping.settings
    assert (said.kind, said.back) == ("round", "mirrored") and editor.document is ball
    editor.shaping.preview_thickness(1.5)
    editor.commit("Thickness")
    thick = depth_range(editor)
    wait_for_jobs(editor)
    assert editor.history is not None and editor.history.count == 3
    assert editor.history.undo_label == "Kind of shape, Other side"
    shape = editor.chosen.shape
    assert (shape.kind, shape.back, shape.thickness) == ("round", "mirrored", 1.5)
    assert depth_range(editor) == pytest.approx(thick, rel=0.3)
    editor.shaping.say("Other side", back="continued")
    editor.undo()  # the answer is then of a shape that is not there any more
    wait_for_jobs(editor)
    shape = editor.chosen.shape
    assert (shape.kind, shape.back, shape.thickness) == ("auto", "continued", 1.5)


@pytest.fixture
def beside(editor: Editor, ball: Document) -> Editor:
    """The ball, and a piece of the wall that is being lifted while the ball is dragged."""
    mask = np.zeros(ball.objects[0].mask.shape, bool)
    mask[100:130, 140:170] = True
    editor.start(edits.set_mask(edits.add_object(ball), 1, mask, Prompt()))
    editor.objects.choose(1)
    editor.tasks.lift()
    editor.objects.choose(0)
    return editor


def test_a_lift_of_another_object_waits_for_the_hand_and_leaves_it_its_tool(
    beside: Editor,
) -> None:
    before = beside.committed
    beside.choose_tool(ToolName.PLACE)
    x, y = beside.view.canvas_from_image(np.array(CENTRE))
    press(beside, PlaceTool(), (x, y))
    move(beside, (x + 40, y))
    wait_for_jobs(beside)
    assert beside.committed is before and beside.opened.objects[0].is_moved
    beside.escape()
    assert beside.document is before
    beside.poll()
    assert beside.opened.objects[1].lifted is not None
    assert not beside.opened.objects[0].is_moved
    assert beside.view.tool is ToolName.PLACE and beside.current == 0


@pytest.mark.slow
def test_objects_are_lifted_one_after_the_other(beside: Editor) -> None:
    beside.shaping.say("Other side", back="mirrored")
    wait_for_jobs(beside)
    first, second = beside.opened.objects
    assert first.shape.back == "mirrored" and second.lifted is not None


@pytest.mark.parametrize("kind", [Painted.DEPTH, Painted.HIDDEN])
def test_a_moved_object_is_painted_where_it_is_seen(
    editor: Editor, ball: Document, kind: Painted
) -> None:
    editor.start(ball)
    editor.placing.move_to(Placement(move=(40.0, -6.0), turn=(10.0, 0.0, 0.0)))
    editor.commit("Move object")
    editor.view.tool, editor.view.selecting.painted = ToolName.MASK, kind
    place = np.array([CENTRE[0] - 8, CENTRE[1] + 6])
    shown = editor.derived.carried(editor.opened, 0, place[None])[0]
    assert np.hypot(*(shown - place)) > 30
    press(editor, MaskTool(), editor.view.canvas_from_image(shown))
    field = editor.shaping._nearness if kind is Painted.DEPTH else editor.shaping._hidden
    painted = np.argwhere(field(editor.opened.photo.size))[:, ::-1].mean(0)
    assert np.hypot(*(painted + 0.5 - place)) < 3
    layer = editor.shaping.painted_layer()
    assert layer is not None
    tint = np.argwhere(layer.pixels[..., 3])[:, ::-1].mean(0)
    corner = editor.view.image_from_canvas((0.0, 0.0))
    assert np.hypot(*((tint + 0.5) * GRAIN / editor.view.zoom + corner - shown)) < 3
    editor.hand.abort(editor)


@pytest.mark.slow
def test_words_before_the_lift_count_at_the_lift(editor: Editor) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    assert editor.mask is not None
    rows, columns = np.nonzero(editor.mask)
    beside = (float(columns.max()) + 4, float(np.median(rows)))
    paint(editor, Painted.HIDDEN, beside, (beside[0] + 3, beside[1]))
    assert not editor.is_lifted
    assert editor.shaping.settings.hidden is not None
    run(editor, "lift")
    wait_for_jobs(editor)
    assert lifted_of(editor).texture.u0[:, 0].max() > beside[0]
    text = encode_session(editor.document)  # type: ignore[arg-type]
    again = decode_session(text).objects[0].shape
    assert again.hidden is not None
    assert (again.hidden == editor.shaping.settings.hidden).all()


@pytest.mark.slow
def test_escape_takes_a_painted_stroke_back(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    document = editor.document
    editor.view.selecting.painted = Painted.HIDDEN
    assert editor.shaping.start_stroke(is_inverse=False)
    editor.shaping.paint(np.array(editor.view.canvas_from_image(np.array(CENTRE))))
    assert editor.shaping.painted_layer() is not None
    editor.shaping.drop_stroke()
    assert editor.document is document
    assert editor.shaping.painted_layer() is None


def test_nothing_is_painted_about_a_shape_without_a_selection(editor: Editor) -> None:
    editor.view.selecting.painted = Painted.DEPTH
    assert not editor.shaping.start_stroke(is_inverse=False)
    assert editor.message is not None and "Select an object" in editor.message.text


@pytest.fixture
def figure(tmp_path: Path) -> Path:
    """An object's file: the ball of a test scene."""
    path = tmp_path / "figure.ply"
    path.write_bytes(splat_files.encode(shapes.scene("ellipse", 1500).lifted.body, path))
    return path


@pytest.mark.slow
def test_an_object_out_of_a_file_takes_the_place_of_what_is_selected(
    editor: Editor, figure: Path
) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    editor.filing.drop([figure])
    wait_for_jobs(editor)
    assert lifted_of(editor).middle is None, editor.message
    assert editor.message is not None and "outline" in editor.message.text
    fitting = editor.shaping.fitting
    assert fitting is not None and fitting.chosen.iou > 0.8
    assert why_not(editor, "fit_again") is None
    editor.shaping.preview_thickness(0.5)
    assert editor.preview is None, "a file's shape has no thickness"


@pytest.mark.slow
def test_placed_by_hand_it_is_fitted_from_there(editor: Editor, figure: Path) -> None:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    editor.shaping.open_file(figure)
    wait_for_jobs(editor)
    fitting = editor.shaping.fitting
    assert fitting is not None
    editor.placing.move_to(Placement(move=(3.0, 2.0), scale=1.05))
    editor.commit("Move object")
    run(editor, "fit_again")
    wait_for_jobs(editor)
    again = editor.shaping.fitting
    assert again is not None and again is not fitting
    assert again.chosen.score >= fitting.chosen.score - 0.02
    assert editor.object is not None and editor.object.placement.is_identity


@pytest.mark.parametrize("name", ["missing.glb", "damaged.ply"])
def test_a_bad_file_is_a_sentence_and_nothing_is_lost(
    editor: Editor, ball: Document, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    if name.startswith("damaged"):
        path.write_bytes(b"ply\nnothing")
    editor.start(ball)
    document = editor.document
    editor.shaping.open_file(path)
    wait_for_jobs(editor)
    assert editor.message is not None and editor.message.is_error
    assert name in editor.message.text.lower()
    assert editor.document is document


def test_another_photo_is_what_is_selected_where_it_is_open_in_a_tab(
    editor: Editor, ball: Document, tmp_path: Path
) -> None:
    editor.start(ball)
    other = tmp_path / "side.png"
    other.write_bytes(ball.photo.source)
    assert editor.tabs.selected(other) is None
    assert why_not(editor, "add_photo") is None
    open_file(editor, other)
    assert editor.tabs.selected(other) is None, "nothing is selected there"
    assert why_not(editor, "add_photo") is not None, "nothing is lifted there"
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    chosen = editor.tabs.selected(other)
    assert chosen is not None and chosen.name == "side.png"
    assert np.array_equal(chosen.pixels, ball.photo.pixels)
    assert is_selected(chosen.mask)[int(CENTRE[1]), int(CENTRE[0])]
    close_all(editor)


def test_every_word_has_a_command_or_a_field() -> None:
    assert {"import_shape", "add_photo", "fit_again", "clear_painted"} <= set(COMMANDS)
