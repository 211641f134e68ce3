"""The selection changed by hand: strokes, lines, edges, files, and what clicks then do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from editor_steps import CENTRE, HEIGHT, WIDTH, wait_for_jobs, wait_until
from objectmorpher.commands import run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.filing import Dialog
from objectmorpher.editor.refits import REFIT
from objectmorpher.editor.tasks import READY, Combine, Question
from objectmorpher.editor.view import Painted, Selecting, SelectMode, ToolName
from objectmorpher.gui.window.scenes import build_scene
from objectmorpher.render.renderer import same_scene
from objectmorpher.tools.brush_tools import MaskTool
from objectmorpher.tools.navigate import pan
from objectmorpher.tools.pointer import Button, Pointer
from objectmorpher.tools.registry import Tool
from objectmorpher.tools.select_tool import SelectTool
from objectmorpher_core import segment
from objectmorpher_core.base.brush import Brush
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Click, Document, EditObject, Placement, Prompt
from objectmorpher_core.document.settings import Refined
from objectmorpher_core.segment import mask_edit
from objectmorpher_core.session.file import decode_session, encode_session
from strokes import move, press, release, stroke

FAR = (20.0, 20.0)  # image px, on the wall
Places = list[tuple[float, float]]


@pytest.fixture
def editor(editor: Editor) -> Iterator[Editor]:
    editor.view.selecting, editor.view.brush = Selecting(), Brush(6.0, 1.0)
    yield editor
    editor.view.selecting, editor.view.brush = Selecting(), Brush()


def draw(editor: Editor, tool: Tool, places: Places, **held: Any) -> None:
    """A stroke through places of the photo, image px."""
    stroke(editor, tool, *editor.view.canvas_from_image(np.array(places)), **held)


def paint(editor: Editor, *places: tuple[float, float], **held: bool) -> None:
    editor.view.tool = ToolName.MASK
    draw(editor, MaskTool(), list(places), **held)


def select_ball(editor: Editor) -> np.ndarray:
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    assert editor.mask is not None, editor.message
    return editor.mask


def test_a_stroke_is_one_step_and_undo_takes_it_back(editor: Editor) -> None:
    ball = select_ball(editor)
    document = editor.document
    paint(editor, FAR, (40.0, 20.0), (60.0, 20.0))
    assert editor.mask is not None and editor.history is not None
    added = editor.mask & ~ball
    assert added[20, 20] and added[20, 60]
    assert added.sum() == pytest.approx(40 * 12 + np.pi * 36, rel=0.06)
    assert (editor.mask | ~ball).all()
    assert editor.history.undo_label == "Paint selection"
    run(editor, "undo")
    assert editor.document is document
    assert editor.view.tool is ToolName.MASK, "one goes on painting"


def test_right_and_alt_erase_and_the_toggle_turns_it_round(editor: Editor) -> None:
    select_ball(editor)
    x, y = int(CENTRE[0]), int(CENTRE[1])
    for erased in ({"alt": True}, {"button": Button.RIGHT}):
        paint(editor, CENTRE, **erased)
        assert editor.mask is not None and not editor.mask[y, x]
        run(editor, "undo")
    editor.view.selecting.is_erasing = True
    paint(editor, CENTRE)
    assert not editor.mask[y, x]
    paint(editor, CENTRE, alt=True)
    assert editor.mask[y, x]


def test_the_stroke_is_seen_while_it_is_painted_and_esc_takes_it_back(editor: Editor) -> None:
    document = editor.document
    editor.view.tool = ToolName.MASK
    at = editor.view.canvas_from_image(np.array(FAR))
    press(editor, MaskTool(), at)
    assert editor.masking.shown is not None
    assert editor.masking.shown[20, 20] == 255
    scene = build_scene(editor, "gl")
    assert same_scene(scene, build_scene(editor, "gl")), "what stays is not drawn again"
    move(editor, at + 80)
    assert not same_scene(scene, build_scene(editor, "gl")), "the mask is painted in place"
    assert editor.masking.painting is not None
    assert len(editor.masking.painting.touched) == 2
    editor.escape()
    assert editor.masking.painting is None
    assert editor.masking.shown is None
    assert editor.document is document


def test_shift_draws_a_straight_line_from_the_last_stroke(editor: Editor) -> None:
    paint(editor, FAR)
    paint(editor, (120.0, 20.0), shift=True)
    assert editor.mask is not None
    assert editor.mask[20, 20:120].all()
    paint(editor, (120.0, 100.0))
    assert not editor.mask[60, 120]


def test_a_soft_brush_leaves_a_soft_edge_and_a_hard_one_does_not(editor: Editor) -> None:
    paint(editor, FAR, (40.0, 20.0))
    assert editor.object is not None and editor.object.coverage is None
    editor.view.brush = replace(editor.view.brush, hardness=0.2)
    paint(editor, FAR, (80.0, 20.0))
    assert editor.object.coverage is not None
    np.testing.assert_array_equal(editor.object.coverage >= 128, editor.object.mask)
    run(editor, "harden")
    assert editor.object.coverage is None


def _moved_ball(editor: Editor, ball: Document, *move: float) -> EditObject:
    editor.start(ball)
    point = ball.objects[0].lifted.control_points[0]
    editor.apply("Pin", edits.add_handle(editor.document, 0, point, is_pin=True))
    editor.placing.move_to(Placement(move=move, turn=(10, 0, 0)))
    editor.commit("Move object")
    return editor.object


def test_the_mask_of_a_moved_object_is_refined_where_it_is_seen(
    editor: Editor, ball: Document
) -> None:
    item = _moved_ball(editor, ball, 50.0, -6.0)
    before = editor.committed
    # The ball's left edge, where it is now: a stroke there takes it away where it was.
    paint(editor, (CENTRE[0] + 20, CENTRE[1] - 6), alt=True)
    thing = editor.object
    assert thing.lifted is item.lifted and thing.placement == item.placement  # until it follows
    gone = np.argwhere(item.mask & ~thing.mask)[:, ::-1].mean(0)
    assert abs(gone[0] - (CENTRE[0] - 30)) < 8 and abs(gone[1] - CENTRE[1]) < 8
    wait_until(editor, lambda: editor.object.shaped is None)
    thing = editor.object
    assert thing.lifted is not item.lifted and len(thing.handles) == 1
    assert thing.placement.turn == item.placement.turn
    motions = [o.placement.matrix(o.lifted, before.photo.camera) for o in (item, thing)]
    np.testing.assert_allclose(*motions, atol=1e-9)
    assert editor.document.plate is not None
    run(editor, "undo")
    assert editor.committed is before
    run(editor, "redo")
    assert editor.object is thing


def test_the_edge_of_a_moved_object_is_repaired_where_it_is_seen(
    editor: Editor, ball: Document
) -> None:
    """A stroke is one step with its shape; a refinement stays where nothing changed."""
    item = _moved_ball(editor, ball, 50.0, -6.0)
    rim = editor.derived.carried(editor.committed, 0, np.array([[CENTRE[0] - 34, CENTRE[1]]]))[0]
    alpha = np.full((HEIGHT, WIDTH), 255, np.uint8)
    refined = Refined(0, 0, 255 - editor.committed.photo.pixels, alpha, "klein")
    editor.apply("Refine", edits.set_refined(editor.committed, refined))
    before = editor.committed
    editor.view.selecting.painted, editor.view.tool = Painted.EDGE, ToolName.MASK
    draw(editor, MaskTool(), [(rim[0], rim[1] - 8), (rim[0], rim[1] + 8)])
    assert editor.edging.stroke is None
    wait_until(editor, lambda: editor.object.mixed is not None and editor.object.shaped is None)
    thing = editor.object
    assert editor.history.undo_label == "Edge brush"
    found = np.argwhere(thing.mixed)[:, ::-1].mean(0)
    assert np.hypot(*(found - (CENTRE[0] - 34, CENTRE[1]))) < 6
    assert len(thing.handles) == 1 and thing.placement.turn == item.placement.turn
    kept = editor.committed.refined
    assert kept.alpha[-5:, :20].all() and not kept.alpha[int(rim[1]), int(rim[0])]
    document = decode_session(encode_session(editor.committed))
    np.testing.assert_array_equal(document.objects[0].mixed, thing.mixed)
    editor.view.brush = Brush(12.0, 1.0)
    draw(editor, MaskTool(), [(rim[0], rim[1] - 10), (rim[0], rim[1] + 10)], alt=True)
    wait_until(editor, lambda: editor.object.mixed is None and editor.object.shaped is None)
    run(editor, "undo")
    assert editor.object is thing
    run(editor, "undo")
    assert editor.committed is before
    press(editor, MaskTool(), editor.view.canvas_from_image(rim))
    editor.escape()
    wait_for_jobs(editor)
    assert editor.committed is before


@pytest.mark.slow
def test_the_shape_follows_an_edge_that_is_hardened_again_after_undo(
    editor: Editor, ball: Document
) -> None:
    """The mask stays the same array; what is soft of it does not."""
    _moved_ball(editor, ball, 50.0, -6.0)
    editor.view.selecting.reach = 3.0
    run(editor, "feather")
    wait_until(editor, lambda: editor.object.coverage is not None and editor.object.shaped is None)
    soft = editor.object
    run(editor, "harden")
    wait_until(editor, lambda: editor.object.shaped is None)
    hard = editor.object
    assert hard.mask is soft.mask and hard.coverage is None
    run(editor, "undo")
    assert editor.object is soft
    run(editor, "harden")
    wait_until(editor, lambda: editor.object.shaped is None)
    np.testing.assert_array_equal(editor.object.matte.alpha, hard.matte.alpha)
    assert editor.object.matte.alpha.size < soft.matte.alpha.size  # nothing is soft beyond the edge


def test_the_shape_follows_a_step_that_was_undone_while_it_was_made_ready(
    editor: Editor, ball: Document
) -> None:
    _moved_ball(editor, ball, 50.0, -6.0)
    run(editor, "grow")
    wait_until(editor, lambda: editor.chores.is_busy(f"{READY} 0"))
    assert editor.object.shaped is not None
    run(editor, "undo")
    wait_for_jobs(editor)
    run(editor, "redo")
    wait_until(editor, lambda: editor.object.shaped is None)
    assert editor.history.undo_label == "Grow selection"


def test_what_is_undone_is_fitted_no_longer_and_once_more_when_it_is_redone(
    editor: Editor, ball: Document
) -> None:
    _moved_ball(editor, ball, 50.0, -6.0)
    run(editor, "grow")
    wait_until(editor, lambda: editor.jobs.is_busy(REFIT))
    run(editor, "undo")
    editor.poll()
    assert not editor.jobs.is_busy(REFIT), "it is asked to stop"
    run(editor, "redo")
    wait_until(editor, lambda: editor.object.shaped is None)


@pytest.mark.slow
def test_the_backgrounds_colour_goes_out_of_the_edge_and_comes_back(
    editor: Editor, ball: Document
) -> None:
    _moved_ball(editor, ball, 50.0, -6.0)
    editor.view.selecting.reach = 3.0
    for name, label in (("grow", "Grow selection"), ("feather", "Feather selection")):
        run(editor, name)  # drawn, so that it has a halo of the wall
        wait_until(editor, lambda label=label: editor.history.undo_label == label)
    wait_until(editor, lambda: editor.object.shaped is None)
    item = editor.object
    shape = editor.derived.shape(ball.photo, item)
    editor.edging.preview_decontaminate(0.5)
    half = editor.document.objects[0].matte.foreground
    editor.edging.preview_decontaminate(1.0)
    whole = editor.document.objects[0].matte.foreground
    np.testing.assert_allclose(whole - half, half - item.matte.foreground, atol=1e-6)
    editor.commit("Decontaminate edge")
    assert np.abs(whole - half).max() > 0.01
    thing = editor.object
    clean = editor.derived.shape(ball.photo, thing)
    assert clean.puppet is shape.puppet and clean.texture is not shape.texture
    document = decode_session(encode_session(editor.committed))
    np.testing.assert_array_equal(document.objects[0].matte.foreground, whole)
    # The outline is refined: the fresh cut-out is as clean.
    paint(editor, (CENTRE[0] + 20, CENTRE[1] - 6), alt=True)
    wait_until(editor, lambda: editor.object.shaped is None)
    after = editor.object
    assert after.contaminated is not None and after.decontaminate == 1.0
    run(editor, "decontaminate")
    assert editor.object.matte.foreground is after.contaminated
    for _ in range(3):
        run(editor, "undo")
    assert editor.object is item


def test_what_would_throw_work_away_is_only_offered(editor: Editor, ball: Document) -> None:
    item = _moved_ball(editor, ball, 30.0, 0.0)
    for act in (lambda: run(editor, "invert"), editor.selection.clear):
        act()
        assert editor.object is item
        assert item.name in editor.message.text
    editor.message.action.run()
    assert editor.mask is None
    run(editor, "undo")
    assert editor.object is item


def test_a_click_lands_on_what_is_seen(editor: Editor, ball: Document) -> None:
    item = _moved_ball(editor, ball, 60.0, 0.0)
    seen = editor.view.canvas_from_image(np.array(CENTRE) + (60, 0))
    landed = editor.landing.in_photo(seen)
    assert np.hypot(*(landed - CENTRE)) < 8  # it is turned, too
    np.testing.assert_allclose(
        editor.derived.carried(editor.document, 0, landed[None])[0],
        editor.view.image_from_canvas(seen), atol=1.0,
    )  # fmt: skip
    editor.view.is_before = True
    np.testing.assert_allclose(editor.landing.in_photo(seen), np.array(CENTRE) + (60, 0))
    editor.view.is_before = False
    editor.objects.start_another()
    stroke(editor, SelectTool(), seen)
    assert editor.object is item and editor.selection.pending is None


def test_the_edited_picture_stays_whatever_tool_and_object(editor: Editor, ball: Document) -> None:
    """Random tools, objects and keys: the canvas shows the edit, or a badge says what it shows."""
    random = np.random.default_rng(3)
    _moved_ball(editor, ball, 40.0, 5.0)
    run(editor, "duplicate")
    editor.placing.move_to(Placement(move=(-40.0, 0.0)))
    editor.commit("Move object")
    editor.view.tool, editor.view.is_before = ToolName.PLACE, False
    wanted = _picture(editor)
    assert len(wanted[2]) == 2
    tools = [tool for tool in ToolName if tool is not ToolName.LOOK]
    shown = set()
    for _ in range(300):
        match random.integers(4):
            case 0:
                editor.objects.choose(int(random.integers(2)))
            case 1:
                editor.objects.start_another()
            case 2:
                editor.choose_tool(tools[random.integers(len(tools))])
            case 3:
                editor.view.is_before = bool(random.integers(2))
        shown.add((editor.view.tool, editor.is_lifted))
        is_photo = editor.looking.badge == "The photo as it was"
        assert (_picture(editor) == wanted) != is_photo
    editor.view.is_before = False
    assert {(ToolName.SELECT, False), (ToolName.MASK, True), (ToolName.POSE, True)} <= shown


def test_beside_an_object_that_was_moved_what_is_selected_is_veiled_too(
    editor: Editor, ball: Document
) -> None:
    _moved_ball(editor, ball, 40.0, 5.0)
    editor.objects.start_another()
    paint(editor, FAR)
    for tool in (ToolName.MASK, ToolName.SELECT):
        editor.view.tool = tool
        scenes = build_scene(editor, "tiles"), build_scene(editor, "gl")
        veil, again = (scene.layers[-1] for scene in scenes if scene is not None)
        assert veil.is_tint and veil is again, "nothing to draw anew"
        rgba, box = veil.rgba, veil.box
        places = editor.view.canvas_from_image(np.array([FAR, CENTRE, (-5.0, 20.0)]))
        scale = rgba.shape[1] / (box[2] - box[0])
        at, beside, outside = (rgba[int(y * scale), int(x * scale)] for x, y in places)
        assert not at.any() and not outside.any()
        assert beside[3] > 50 and not beside[:3].any()


def _picture(editor: Editor) -> tuple:
    """What the canvas shows, by identity."""
    scene = build_scene(editor, "tiles")
    rgba = tuple(id(layer.rgba) for layer in scene.layers)
    return id(scene.photo), id(scene.plate), rgba, id(scene.blend), scene.veil, scene.paper


@pytest.mark.slow
def test_the_lift_keeps_a_drawn_soft_edge(editor: Editor) -> None:
    select_ball(editor)
    editor.view.selecting.reach = 6.0
    run(editor, "feather")
    wait_for_jobs(editor)
    assert editor.object is not None
    coverage = editor.object.coverage
    assert coverage is not None
    run(editor, "lift")
    wait_for_jobs(editor)
    matte = editor.object.matte
    assert matte is not None
    x0, y0, x1, y1 = matte.box
    np.testing.assert_array_equal(np.rint(matte.alpha * 255), coverage[y0:y1, x0:x1])


def test_presses_of_an_edge_button_add_up(editor: Editor) -> None:
    ball = select_ball(editor)
    editor.view.selecting.reach = 3.0
    for _ in range(3):
        run(editor, "grow")
    wait_for_jobs(editor)
    grown = ball
    for _ in range(3):
        grown = mask_edit.grow(grown, 3.0)
    np.testing.assert_array_equal(editor.mask, grown)
    for _ in range(3):
        run(editor, "undo")
    assert editor.mask is ball


def test_what_is_found_while_the_hand_is_busy_waits_for_it(editor: Editor, ball: Document) -> None:
    """During a pan, or the next stroke, whose turn it is afterwards."""
    editor.start(ball)
    assert editor.history is not None
    editor.view.tool, editor.view.selecting.painted = ToolName.MASK, Painted.EDGE
    left, right = (editor.view.canvas_from_image(np.array([x, CENTRE[1]])) for x in (56, 124))
    stroke(editor, MaskTool(), left, left + (0, 30))
    press(editor, MaskTool(), right)
    wait_for_jobs(editor)
    assert editor.committed is ball
    move(editor, right + (0, 30))
    release(editor, right + (0, 30))
    wait_until(editor, lambda: editor.history.count == 3)
    assert editor.history.steps[1:] == ("Edge brush", "Edge brush")
    wait_for_jobs(editor)
    editor.start(ball)
    run(editor, "grow")
    editor.hand.press(pan(editor, Pointer(9, 9, is_down=True)), Button.MIDDLE)
    wait_for_jobs(editor)
    assert editor.committed is ball
    release(editor, (9, 9))
    editor.poll()
    assert editor.history.undo_label == "Grow selection"


def test_what_was_painted_stays_when_a_click_follows(editor: Editor) -> None:
    select_ball(editor)
    paint(editor, FAR)
    paint(editor, CENTRE, alt=True)
    editor.selection.add_click(165.0, 120.0, False)
    wait_for_jobs(editor)
    assert editor.mask is not None
    x, y = int(CENTRE[0]), int(CENTRE[1])
    assert editor.mask[20, 20], "added by hand"
    assert not editor.mask[y, x], "taken away by hand"
    assert editor.mask[y + 30, x], "the ball"
    assert len(editor.selection.prompt.clicks) == 2
    editor.selection.add_click(*FAR, False)
    wait_for_jobs(editor)
    assert not editor.mask[20, 20], "the latest word counts"
    assert not editor.mask[y, x]


def test_a_click_on_a_selection_made_by_hand_adds_or_takes_away_an_object(editor: Editor) -> None:
    paint(editor, FAR)
    first = editor.mask
    assert first is not None
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    assert editor.mask is not None
    assert editor.mask[20, 20] and editor.mask[int(CENTRE[1]), int(CENTRE[0])]
    editor.selection.add_click(*CENTRE, False)
    wait_for_jobs(editor)
    assert editor.mask[20, 20] and not editor.mask[int(CENTRE[1]), int(CENTRE[0])]


def test_a_line_around_something_is_new_added_or_taken_away(editor: Editor) -> None:
    editor.view.selecting.mode = SelectMode.LASSO
    square: Places = [(20, 20), (60, 20), (60, 60), (20, 60)]
    draw(editor, SelectTool(), square)
    assert editor.mask is not None
    assert editor.mask.sum() == pytest.approx(1600, rel=0.06)
    draw(editor, SelectTool(), [(x + 60, y) for x, y in square], shift=True)
    assert editor.mask.sum() == pytest.approx(3200, rel=0.06)
    draw(editor, SelectTool(), [(x + 20, y) for x, y in square], alt=True)
    assert editor.mask.sum() == pytest.approx(2400, rel=0.06)
    draw(editor, SelectTool(), square)
    assert editor.mask[40, 40] and not editor.mask[40, 110]
    assert editor.selection.path is None


def test_a_box_is_new_added_or_taken_away(editor: Editor) -> None:
    paint(editor, FAR)
    box = (CENTRE[0] - 42, CENTRE[1] - 52, CENTRE[0] + 42, CENTRE[1] + 52)
    editor.selection.set_box(box, Combine.ADDED)
    wait_for_jobs(editor)
    assert editor.mask is not None
    assert editor.mask[20, 20] and editor.mask[int(CENTRE[1]), int(CENTRE[0])]
    editor.selection.set_box(box)
    wait_for_jobs(editor)
    assert not editor.mask[20, 20] and editor.mask[int(CENTRE[1]), int(CENTRE[0])]


@pytest.mark.parametrize("mode", [SelectMode.BOX, SelectMode.LASSO])
def test_clicks_begin_and_correct_whatever_is_dragged(editor: Editor, mode: SelectMode) -> None:
    editor.view.selecting.mode = mode
    ball = editor.view.canvas_from_image(np.array(CENTRE))
    assert mode is SelectMode.LASSO or "click" in SelectTool().hint(editor)
    stroke(editor, SelectTool(), ball)
    wait_for_jobs(editor)
    assert editor.mask is not None and editor.mask[round(CENTRE[1]), round(CENTRE[0])]
    assert mode is SelectMode.LASSO or "Click adds" in SelectTool().hint(editor)
    wall = editor.view.canvas_from_image(np.array(FAR))
    stroke(editor, SelectTool(), wall, alt=True)
    wait_for_jobs(editor)
    added, removed = editor.selection.prompt.clicks
    assert added.is_foreground and not removed.is_foreground


def test_a_mask_goes_out_to_a_picture_and_comes_back(editor: Editor, tmp_path: Path) -> None:
    select_ball(editor)
    editor.view.selecting.reach = 5.0
    run(editor, "feather")
    wait_for_jobs(editor)
    assert editor.object is not None
    coverage, path = editor.object.coverage, tmp_path / "mask.png"
    assert coverage is not None
    editor.filing.choose(Dialog.MASK_SAVE, path)
    wait_until(editor, path.exists)
    wait_for_jobs(editor)
    written = Image.open(path)
    assert written.mode == "L"
    np.testing.assert_array_equal(np.asarray(written), coverage)
    editor.selection.clear()
    editor.filing.choose(Dialog.MASK_OPEN, path)
    wait_for_jobs(editor)
    np.testing.assert_array_equal(editor.object.coverage, coverage)
    assert editor.object.prompt.is_empty
    assert editor.document is not None
    back = decode_session(encode_session(editor.document))
    np.testing.assert_array_equal(back.objects[0].coverage, coverage)


@pytest.mark.parametrize("name", ["small.png", "missing.png", "text.png"])
def test_a_picture_that_is_no_mask_is_one_sentence(
    editor: Editor, tmp_path: Path, name: str
) -> None:
    Image.new("L", (WIDTH, HEIGHT - 1), 255).save(tmp_path / "small.png")
    (tmp_path / "text.png").write_text("no picture", encoding="utf-8")
    document = editor.document
    editor.filing.choose(Dialog.MASK_OPEN, tmp_path / name)
    wait_for_jobs(editor)
    assert editor.document is document
    assert editor.message is not None and editor.message.is_error
    assert "\n" not in editor.message.text


def test_inverting_and_filling(editor: Editor) -> None:
    ball = select_ball(editor)
    run(editor, "invert")
    np.testing.assert_array_equal(editor.mask, ~ball)
    run(editor, "invert")
    np.testing.assert_array_equal(editor.mask, ball)
    paint(editor, CENTRE, alt=True)
    run(editor, "fill_holes")
    wait_for_jobs(editor)
    np.testing.assert_array_equal(editor.mask, ball)


def test_islands_are_removed_and_come_back_by_undo(editor: Editor) -> None:
    ball = select_ball(editor)
    editor.view.brush = Brush(3.0, 0.5)
    paint(editor, FAR)
    painted, coverage = editor.mask, editor.object and editor.object.coverage
    assert painted is not None and coverage is not None and painted[20, 20]
    run(editor, "remove_islands")
    wait_for_jobs(editor)
    np.testing.assert_array_equal(editor.mask, ball)
    assert editor.object is not None and editor.object.coverage is None, "its rim went, too"
    assert editor.history is not None and editor.history.undo_label == "Remove islands"
    run(editor, "undo")
    assert editor.mask is painted
    editor.selection.clear()
    assert why_not(editor, "remove_islands") is not None


def test_a_click_again_asks_for_more_or_less_around_it(editor: Editor) -> None:
    select_ball(editor)
    levels = []
    for _ in range(3):
        editor.selection.add_click(CENTRE[0] + 0.5, CENTRE[1], True)
        wait_for_jobs(editor)
        levels.append(editor.selection.prompt.level)
        assert len(editor.selection.prompt.clicks) == 1
    assert levels == ["part", "group", "object"]
    editor.selection.set_level("part")
    wait_for_jobs(editor)
    assert editor.selection.prompt.level == "part"
    assert editor.history is not None and editor.history.undo_label == "Select the part"


@pytest.mark.slow
def test_masks_of_two_objects_are_painted_and_undone_each_on_its_own(
    editor: Editor, ball: Document
) -> None:
    first = ball
    editor.start(ball)
    editor.objects.start_another()
    paint(editor, FAR)
    assert editor.document is not None and editor.current == 1
    assert len(editor.document.objects) == 2
    assert editor.document.objects[0] is first.objects[0]
    paint(editor, (40.0, 20.0))
    second = editor.mask
    editor.objects.choose(0)
    paint(editor, CENTRE, alt=True)
    assert editor.document.objects[1].mask is second
    editor.objects.choose(1)
    run(editor, "undo")
    assert editor.current == 0, "what is undone is what one looks at"
    assert editor.document.objects[0] is first.objects[0]
    run(editor, "undo")
    assert editor.current == 1
    run(editor, "undo")
    assert len(editor.document.objects) == 1
    assert editor.mask is None


def test_the_status_line_tells_how_sure_a_selection_is(editor: Editor) -> None:
    if (reason := segment.load("dino").missing()) is not None:
        pytest.skip(reason)
    tool = SelectTool()
    assert "sure" not in tool.hint(editor)
    select_ball(editor)
    told = editor.selection.confidence
    assert told is not None and told > segment.UNSURE
    assert tool.hint(editor).startswith(f"Selected, {100 * told:.0f} % sure")
    editor.masking.grow()
    wait_for_jobs(editor)
    assert editor.selection.confidence is None, "it was changed by hand"
    assert "sure" not in tool.hint(editor)
    run(editor, "undo")
    assert editor.selection.confidence == told
    editor.selection.add_click(*FAR, True)
    wait_for_jobs(editor)
    assert editor.selection.confidence != told
    run(editor, "undo")
    run(editor, "undo")
    assert editor.selection.confidence is None


def test_who_is_not_sure_says_what_helps(editor: Editor) -> None:
    ball = select_ball(editor)
    run(editor, "undo")
    editor.message = None
    question = Question(Prompt((Click(*CENTRE),)), "Add to selection", editor.current)
    editor.selection.take(question, segment.Found(ball, "dino", 0.61))
    hint = SelectTool().hint(editor)
    assert hint.startswith("Only 61 % sure") and "right-click" in hint
    assert editor.message is None, "nothing to be dismissed"
