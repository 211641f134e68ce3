"""Objects as things in a list: names, copies, removing, which covers which."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import (
    CENTRE,
    HEIGHT,
    WIDTH,
    close_all,
    duplicate,
    not_lifted,
    wait_for_jobs,
    wait_until,
)
from objectmorpher.canvas.frame import build_frame, drawn_order
from objectmorpher.commands import COMMANDS, label_of, meaning_of, next_step, run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.tasks import PLATE
from objectmorpher.editor.view import Shown, ToolName
from objectmorpher.gui.panels.select import share_text
from objectmorpher.gui.window.scenes import build_scene
from objectmorpher.tools.pointer import Pointer
from objectmorpher.tools.select_tool import SelectTool
from objectmorpher_core.base.arrays import crop
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import decode_session, encode_session
from strokes import stroke
from tests.tree import over


@pytest.fixture
def copied(editor: Editor, ball: Document) -> Editor:
    """The ball, and a copy of it that was moved to the right."""
    duplicate(editor, ball, 30.0, 0.0)
    return editor


def test_a_copy_is_one_step_and_becomes_current(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    editor.view.tool = ToolName.PLACE
    run(editor, "duplicate")
    assert editor.current == 1
    assert editor.is_lifted
    assert editor.document is not None and editor.document.plate is ball.plate
    assert editor.history is not None and editor.history.undo_label == "Duplicate object"
    editor.poll()
    assert not editor.jobs.is_busy(PLATE), "no background has to be filled in"
    editor.undo()
    assert editor.document is ball
    assert editor.current == 0
    assert editor.view.tool is ToolName.PLACE


def test_a_copy_stays_where_it_is_while_the_original_goes_through_its_key_poses(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    editor.keying.add()
    editor.placing.move_to(Placement(move=(20.0, 0.0)))
    editor.commit("Move object")
    editor.keying.add()
    run(editor, "duplicate")
    editor.placing.move_to(Placement(move=(-40.0, 0.0)))
    editor.commit("Move object")
    for place in (0.0, 20.0):
        editor.keying.step(1)
        assert [item.placement.move[0] for item in editor.committed.objects] == [place, -40.0]


def test_the_export_of_a_moved_copy_keeps_the_object(
    copied: Editor, ball: Document, tmp_path: Path
) -> None:
    copied.exporting.export_to(tmp_path / "two.png")
    wait_for_jobs(copied)
    pixels, photo = np.asarray(Image.open(tmp_path / "two.png")), ball.photo.pixels
    left = (slice(0, 140), slice(0, 78))  # the copy does not reach it
    assert np.array_equal(pixels[left], photo[left])
    assert pixels[72, 140, 0] > photo[72, 140, 0] + 60, "the copy, before the wall"


def test_the_view_of_a_moved_copy_keeps_the_object(copied: Editor) -> None:
    document, view = copied.document, copied.view
    assert document is not None
    assert drawn_order(document, Shown.COMPOSITE, partial(copied.derived.posed, document)) == [0, 1]
    assert copied.derived.unfilled(edits.set_plate(document, None)) is None
    plate = copied.derived.plate(document)
    assert plate is not None and not plate.hole.any()
    blend = build_frame(document, view, copied.cache).blend
    assert blend is not None
    at = view.canvas_from_image(np.array([62.0, 72.0])) / 4
    assert blend[int(at[1]), int(at[0])] == 0, "the object's left side is the photo"


def test_copies_are_known_as_copies_in_a_session_too(copied: Editor) -> None:
    assert copied.document is not None
    assert [o.name for o in copied.document.objects] == ["Object 1", "Object 1 copy"]
    assert edits.duplicate(copied.document, 1).objects[2].name == "Object 1 copy 2"
    again = decode_session(encode_session(copied.document))
    assert again.objects[0].mask is again.objects[1].mask


def test_order_can_be_changed_and_says_why_not(copied: Editor) -> None:
    assert copied.objects.order() == [0, 1]
    assert copied.objects.listed() == [1, 0]
    assert why_not(copied, "forward") == "It is in front of all others"
    run(copied, "backward")
    assert copied.objects.order() == [1, 0]
    assert copied.document is not None
    posed = partial(copied.derived.posed, copied.document)
    assert drawn_order(copied.document, Shown.COMPOSITE, posed) == [1, 0]
    assert why_not(copied, "to_back") == "It is behind all others"
    run(copied, "to_front")
    assert copied.objects.order() == [0, 1]
    run(copied, "undo")
    run(copied, "undo")
    assert copied.document.objects[1].layer == 0
    assert copied.objects.order() == [0, 1]


def test_with_one_object_there_is_no_order(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    assert why_not(editor, "forward") == "There is no other object"


def test_a_copy_is_announced_until_it_is_moved(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    editor.view.tool = ToolName.POSE
    run(editor, "duplicate")
    said = editor.message
    assert said is not None and "lies exactly over the original" in said.text
    editor.choose_tool(ToolName.PLACE)  # to drag it away
    assert editor.message is said
    editor.apply("Move object", edits.set_placement(ball, 0, Placement(move=(9.0, 0.0))))
    assert editor.message is None


def test_removing_the_copy_leaves_the_object_and_its_background(copied: Editor) -> None:
    run(copied, "remove_object")
    assert copied.document is not None
    assert [o.name for o in copied.document.objects] == ["Object 1"]
    assert copied.document.plate is not None
    assert copied.current == 0
    run(copied, "undo")
    assert len(copied.document.objects) == 2


def test_hiding_takes_it_out_of_the_picture_by_a_command_too(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    run(editor, "hide")
    assert editor.object is not None and not editor.object.is_visible
    assert COMMANDS["hide"].is_on is not None and COMMANDS["hide"].is_on(editor)
    run(editor, "hide")
    assert editor.object is not None and editor.object.is_visible


def test_what_is_taken_out_is_out_of_sight_and_the_picture_is_ready(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    editor.view.tool = ToolName.SELECT
    assert next_step(editor) == ("Pose the object", "pose") and not editor.landing.is_current_gone
    run(editor, "take_out")
    assert editor.message is not None
    assert editor.message.text == "Object 1 is taken out of the photo"
    assert next_step(editor) == ("Export photo…", "export")
    assert editor.landing.is_current_gone
    editor.view.is_before = True
    assert not editor.landing.is_current_gone, "the photo shows it"
    editor.view.is_before = False
    assert editor.message.action is not None
    editor.message.action.run()
    assert next_step(editor) == ("Pose the object", "pose") and not editor.landing.is_current_gone


def test_taking_out_shows_the_background_and_putting_back_the_photo(
    copied: Editor, ball: Document
) -> None:
    assert label_of(copied, "remove_object") == "Discard object", "a copy is in no photo"
    assert not copied.objects.is_to_be_taken_out
    assert meaning_of(copied, "remove_object") == ""
    run(copied, "remove_object")
    assert copied.history is not None and copied.history.undo_label == "Discard object"
    copied.start(edits.set_placement(ball, 0, Placement(move=(9.0, 0.0))))
    before = copied.document
    assert label_of(copied, "remove_object") == "Put back into the photo"
    told = [meaning_of(copied, name) for name in ("hide", "take_out", "remove_object")]
    assert all(told) and len(set(told)) == 3, "each is told apart from the others"
    assert copied.objects.is_to_be_taken_out, "by the bin"
    run(copied, "take_out")
    assert copied.object is not None and not copied.object.is_visible
    assert copied.message is not None and copied.message.action is not None
    assert why_not(copied, "take_out") == f"{copied.object.name} is hidden"
    assert copied.history is not None and copied.history.undo_label == "Take out of the photo"
    copied.message.action.run()
    assert copied.object.is_visible and copied.message is None
    run(copied, "undo")
    run(copied, "undo")
    assert copied.document is before
    copied.start(not_lifted(ball))
    assert why_not(copied, "take_out") is not None, "nothing is behind it yet"


def test_removing_the_last_object_gives_the_photo_back(editor: Editor, ball: Document) -> None:
    editor.start(edits.set_placement(ball, 0, Placement(move=(9.0, 0.0))))
    run(editor, "remove_object")
    assert editor.document is not None and editor.document.objects == ()
    assert editor.document.plate is None
    assert editor.view.tool is ToolName.SELECT
    assert why_not(editor, "remove_object") == "Click an object in the photo first"
    run(editor, "undo")
    assert editor.is_lifted


def test_a_name_is_one_step_and_an_empty_one_none(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    run(editor, "rename")
    assert editor.objects.renaming == 0
    editor.objects.rename(0, " Red ball ")
    assert editor.objects.renaming is None
    assert editor.object is not None and editor.object.name == "Red ball"
    assert editor.document is not None and editor.document.plate is ball.plate
    before = editor.document
    editor.objects.rename(0, "  ")
    editor.objects.rename(0, "Red ball")
    assert editor.document is before
    run(editor, "undo")
    assert editor.document is ball


@pytest.fixture
def three(copied: Editor) -> Editor:
    """Three balls side by side; in front is the last one, which is current."""
    run(copied, "duplicate")
    copied.placing.move_to(Placement(move=(-30.0, 0.0)))
    copied.commit("Move object")
    assert copied.objects.listed() == [2, 1, 0]
    return copied


@over("gap", [-5, 0, 1, 2, 3, 9])
@over("carried", [0, 1, 2])
def test_a_dragged_row_lands_above_the_row_where_the_line_is(
    three: Editor, carried: int, gap: int
) -> None:
    before, rows = three.document, three.objects.listed()
    assert three.objects.carry(carried)
    landing = three.objects.landing(gap)
    three.objects.drop(gap)
    at = min(max(gap, 0), 3)
    wanted = [k for k in rows[:at] if k != carried] + [carried]
    wanted += [k for k in rows[at:] if k != carried]
    assert three.objects.listed() == wanted
    assert three.current == carried
    assert (landing is None) == (three.document is before) == (wanted == rows)
    assert three.objects.carried is None
    assert three.history is not None
    if landing is not None:
        assert three.history.undo_label == "Change the order"
        three.undo()
        assert three.document is before


def test_escape_lets_a_dragged_row_go_where_it_was(three: Editor) -> None:
    before, current = three.document, three.current
    three.objects.carry(0)
    three.escape()
    three.objects.drop(0)
    assert three.document is before
    assert three.current == current


def test_what_has_no_place_among_others_cannot_be_dragged(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    assert not editor.objects.carry(0)
    assert editor.objects.landing(0) is None
    editor.objects.drop(0)
    assert editor.document is ball


def test_a_selection_that_holds_another_object_says_so(editor: Editor, ball: Document) -> None:
    """Else one lifts the same thing twice, and only sees it when one of both is moved."""
    editor.start(ball)
    mask = ball.objects[0].mask
    assert mask is not None
    y, x = np.nonzero(mask)
    low, high = np.array([x.min(), y.min()]) - 3.0, np.array([x.max(), y.max()]) + 3.0
    around = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    for share, is_said in ((1.0, True), (0.3, False)):
        editor.objects.start_another()
        editor.selection.set_outline(low + share * (around - low))
        assert editor.mask is not None and not editor.is_lifted
        said = editor.message is not None and "Object 1 is in" in editor.message.text
        assert said == is_said
        editor.undo()


def test_a_small_selection_is_not_said_to_be_nothing() -> None:
    assert [share_text(v) for v in (0.0, 1e-6, 4.9e-4, 5e-4, 0.282)] == [
        "0.0 %", "< 0.1 %", "< 0.1 %", "0.1 %", "28.2 %",
    ]  # fmt: skip


def test_travelling_follows_the_object_that_changes(copied: Editor) -> None:
    copied.objects.toggle_visible(0)
    assert copied.current == 1 and copied.history is not None
    copied.travel(copied.history.cursor - 1)
    assert copied.document is not None and copied.document.objects[0].is_visible
    assert copied.current == 0


@pytest.mark.parametrize("tool", [ToolName.SELECT, ToolName.PLACE])
def test_removing_is_undone_and_done_again_with_the_same_object(
    three: Editor, tool: ToolName
) -> None:
    """Not with the one that has its number by then, nor with none."""
    for k, left in ((0, "B"), (1, "C"), (2, "B")):
        three.start(three.opened)
        for each, name in enumerate("ABC"):
            three.objects.rename(each, name)
        three.objects.choose(k)
        three.view.tool, gone = tool, three.chosen
        run(three, "remove_object")
        assert three.chosen.name == left
        run(three, "undo")
        assert three.chosen is gone
        run(three, "redo")
        assert three.chosen.name == left
        run(three, "undo")


def test_what_is_selected_stays_selected_where_another_handle_comes_and_goes(
    editor: Editor, ball: Document
) -> None:
    lifted, document = ball.objects[0].lifted, ball
    assert lifted is not None
    for point in (0, 100, 200):
        document = edits.add_handle(document, 0, lifted.control_points[point])
    editor.start(document)
    editor.posing.select(2, 1)
    chosen = [editor.chosen.handles[h].control_point for h in (2, 1)]
    editor.posing.remove(0)
    for command in ("undo", "redo"):
        run(editor, command)
        now = [editor.chosen.handles[h].control_point for h in editor.posing.selected]
        assert now == chosen


def test_a_mask_that_is_read_does_not_go_to_another_object(three: Editor, tmp_path: Path) -> None:
    """One before it is removed meanwhile: its number is another one's then."""
    path, left = tmp_path / "mask.png", three.opened.objects[1:]
    assert three.mask is not None
    Image.fromarray((three.mask | np.roll(three.mask, 1, 1)).astype(np.uint8) * 255).save(path)
    three.objects.choose(1)
    three.masking.open_file(path)
    three.objects.choose(0)
    run(three, "remove_object")
    wait_for_jobs(three)
    assert three.opened.objects == left


def test_a_name_is_not_typed_on_in_another_tab(copied: Editor) -> None:
    run(copied, "rename")
    copied.tabs.add()
    assert copied.objects.renaming is None
    close_all(copied)


def test_the_background_stays_until_that_of_one_object_more_is_made(
    editor: Editor, ball: Document
) -> None:
    """What is only selected, or cleared, changes nothing; what is removed comes back at once."""
    editor.start(ball)
    editor.placing.move_to(Placement(move=(40.0, 5.0)))
    editor.commit("Move object")
    before, plate = build_scene(editor, "tiles"), editor.document.plate
    assert before is not None and before.plate is not None
    editor.objects.start_another()
    corner = np.array([[2, 2], [32, 2], [32, 32], [2, 32]], float)
    for change in (lambda: editor.selection.set_outline(corner), editor.selection.clear):
        change()
        wait_for_jobs(editor)
        assert editor.document is not None and editor.document.plate is plate
        scene = build_scene(editor, "tiles")
        np.testing.assert_array_equal(scene.plate.pixels, before.plate.pixels)

    editor.selection.set_outline(corner)
    run(editor, "lift")
    wait_until(editor, lambda: editor.is_lifted)
    scene = build_scene(editor, "tiles")
    assert scene is not None and scene.plate is not None and scene.mask is None
    np.testing.assert_array_equal(scene.plate.pixels, before.plate.pixels)
    wait_for_jobs(editor)
    filled = editor.document.plate
    assert filled is not None and filled is not plate
    assert filled.hole[16 - filled.top, 16 - filled.left]
    editor.placing.move_to(Placement(move=(-5.0, 90.0)))
    editor.commit("Move object")
    build_scene(editor, "tiles")
    editor.objects.remove()
    assert editor.document.plate is None, "it is being made"
    shown = build_scene(editor, "tiles").plate
    assert shown is not None
    hole = crop(shown.hole, shown.box, (0, 0, WIDTH, HEIGHT))
    assert not hole[:33, :33].any() and hole[int(CENTRE[1]), int(CENTRE[0]) - 20]
    wait_for_jobs(editor)


def test_what_has_left_its_place_cannot_be_pointed_at_there(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    editor.placing.move_to(Placement(move=(60.0, 0.0)))
    editor.commit("Move object")
    editor.objects.start_another()
    editor.view.tool, place = ToolName.SELECT, (CENTRE[0] - 25, CENTRE[1])
    at = editor.view.canvas_from_image(np.array(place))
    SelectTool().hover(editor, Pointer(*at))
    assert editor.hover.place is None
    stroke(editor, SelectTool(), at)
    wait_for_jobs(editor)
    assert editor.mask is None and editor.message is not None
    assert editor.message.text == "Object 1 was here and has moved"
    SelectTool().hover(editor, Pointer(*editor.view.canvas_from_image(np.array([20.0, 20.0]))))
    assert editor.hover.place is not None
    editor.undo()
    SelectTool().hover(editor, Pointer(*at))
    assert editor.landing.left_at(np.array(at)) is None, "it is there again"


def with_a_piece(ball: Document, is_like: bool) -> Document:
    """Its background has filled in a corner, too, which has the ball's colours or the wall's."""
    assert ball.plate is not None
    hole, pixels = ball.plate.hole.copy(), ball.plate.pixels.copy()
    hole[2:14, 2:14], pixels[2:14, 2:14] = True, 255
    seen = ball.photo.picture.pixels.copy()
    if is_like:
        top, left = ball.plate.top, ball.plate.left
        seen[top + 2 : top + 14, left + 2 : left + 14] = seen[66:78, 84:96]
    photo = replace(ball.photo, picture=replace(ball.photo.picture, pixels=seen))
    plate = replace(ball.plate, hole=hole, pixels=pixels)
    return replace(ball, photo=photo, plate=plate)


def test_only_what_has_an_objects_colours_is_offered_and_only_once(
    editor: Editor, ball: Document
) -> None:
    for is_like in (False, True):
        piece = with_a_piece(ball, is_like)
        assert piece.plate is not None
        editor.start(replace(piece, plate=None))
        editor.apply("Fill", piece)
        editor.poll()
        assert (len(editor.leaving_out.outlines) == 1) is is_like
        assert (why_not(editor, "add_left_out") is None) is is_like
    editor.view.tool, editor.view.compose.is_bare = ToolName.COMPOSE, True
    assert editor.leaving_out.outlines == (), "there it is not seen"
    editor.view.compose.is_bare = False
    assert len(editor.leaving_out.outlines) == 1
    editor.message = None  # dismissed
    assert piece.plate is not None
    pixels = piece.plate.pixels.copy()
    pixels[60:70, 60:70] = 90  # a repair
    editor.apply("Repair", replace(piece, plate=replace(piece.plate, pixels=pixels)))
    editor.poll()
    assert editor.leaving_out.outlines == () and why_not(editor, "add_left_out") is None


def test_what_is_offered_is_outlined_where_its_object_would_show_it(
    editor: Editor, ball: Document
) -> None:
    ball = with_a_piece(ball, is_like=True)
    assert ball.plate is not None
    editor.start(replace(ball, plate=None))
    editor.apply("Fill", ball)
    editor.poll()
    outlines = editor.leaving_out.outlines
    assert len(outlines) == 1, editor.message
    editor.placing.move_to(Placement(move=(30.0, 8.0)))
    moved = editor.leaving_out.outlines
    assert (np.abs(moved[0] - outlines[0] - (30.0, 8.0)) < 4).all()
