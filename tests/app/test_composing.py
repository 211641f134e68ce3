"""The Compose tool's intentions: backgrounds, repairs, shadow, light, edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from editor_steps import wait_for_jobs, wait_until
from objectmorpher.canvas.frame import build_frame
from objectmorpher.canvas.layer import FrameObject
from objectmorpher.canvas.layers import FRAME
from objectmorpher.commands import COMMANDS, run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.old_shadows import SHADOW
from objectmorpher.editor.view import ToolName
from objectmorpher.tools.brush_tools import ComposeTool
from objectmorpher_core.compose.plate.plate import plate_cover, plate_picture
from objectmorpher_core.compose.shadow.shadow import Shade
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, LiftSettings, Placement, Prompt
from objectmorpher_core.document.placement import set_seen_from
from objectmorpher_core.document.settings import (
    USUAL_SHARES,
    Finish,
    Shadow,
)
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import lift_mask, make_plate, open_photo
from objectmorpher_core.session.file import decode_session, encode_session
from strokes import press, stroke
from tests.shadowed import inside, photo_of, thrown
from tests.shapes import png


@pytest.fixture
def bare(editor: Editor, ball: Document) -> Editor:
    """The ball's background, shown alone."""
    editor.start(ball)
    editor.view.tool = ToolName.COMPOSE
    editor.view.compose.is_bare = True
    return editor


@pytest.fixture(autouse=True)
def clean(shared_editor: Editor):
    yield
    shared_editor.view.compose.is_bare = False


def paint(editor: Editor, *places: tuple[float, float], alt: bool = False) -> None:
    """A stroke of the Compose tool, image px."""
    at = [editor.view.canvas_from_image(np.array(p)) for p in places]
    stroke(editor, ComposeTool(), at[0], *at, alt=alt)


def wait_for_repairs(editor: Editor) -> None:
    wait_until(editor, lambda: not editor.composing.is_repairing)


def test_a_stroke_is_one_step_and_undone_as_one(bare: Editor, ball: Document) -> None:
    before = plate_picture(ball)
    paint(bare, (20, 20), (60, 24))
    assert bare.composing.painted_layer() is not None  # until the answer comes
    wait_for_repairs(bare)
    assert bare.history is not None and bare.document is not None
    assert bare.history.undo_label == "Repair background"
    assert bare.composing.painted_layer() is None
    assert (plate_picture(bare.document) != before).any()
    bare.undo()
    assert bare.document is ball


def test_undo_takes_back_the_stroke_that_is_not_filled_in_yet(bare: Editor, ball: Document) -> None:
    paint(bare, (20, 20), (60, 24))
    paint(bare, (20, 40), (60, 44))
    run(bare, "undo")
    assert bare.composing.is_repairing, "the first one goes on"
    assert bare.undo_label == "Repair background", "the menu names what is taken back"
    run(bare, "undo")
    assert bare.undo_label is None
    assert not bare.composing.is_repairing and bare.composing.painted_layer() is None
    wait_for_jobs(bare)
    assert bare.document is ball
    paint(bare, (20, 20), (60, 24))
    wait_for_repairs(bare)
    assert bare.history is not None and bare.history.undo_label == "Repair background"


@pytest.mark.slow
def test_strokes_in_a_row_are_all_filled_in(bare: Editor, ball: Document) -> None:
    for y in (15, 40, 120):
        paint(bare, (12, y), (30, y))
    wait_for_repairs(bare)
    assert bare.document is not None and bare.document.plate is not None
    plate, (left, top) = bare.document.plate, (0, 0)
    left, top = plate.left, plate.top
    assert plate.painted is not None
    for y in (15, 40, 120):
        assert plate.painted[y - top, 20 - left]
    for _ in range(3):
        bare.undo()
    assert bare.document is ball


@pytest.mark.slow
def test_alt_brings_the_photo_back_at_once(bare: Editor, ball: Document) -> None:
    paint(bare, (20, 20), (40, 20))
    wait_for_repairs(bare)
    paint(bare, (20, 20), (40, 20), alt=True)
    assert bare.history is not None and bare.document is not None
    assert bare.history.undo_label == "Restore background"
    photo = bare.document.photo.pixels
    assert np.array_equal(plate_picture(bare.document)[20, 20:40], photo[20, 20:40])


def test_escape_takes_a_stroke_back(bare: Editor, ball: Document) -> None:
    press(bare, ComposeTool(), bare.view.canvas_from_image(np.array([20, 20])))
    assert bare.composing.painted_layer() is not None
    bare.escape()
    assert bare.composing.painted_layer() is None
    assert bare.document is ball and not bare.jobs.is_busy("repair")


def test_an_answer_for_another_background_is_dropped(bare: Editor, ball: Document) -> None:
    paint(bare, (20, 20), (60, 24))
    other = edits.set_plate(ball, None)
    assert bare.history is not None
    bare.apply("Other", other)
    wait_for_repairs(bare)
    assert bare.history.undo_label == "Other"


def test_painting_needs_the_background(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    editor.view.tool = ToolName.COMPOSE
    paint(editor, (20, 20), (60, 24))
    assert editor.document is ball
    assert editor.message is not None and "alone" in editor.message.text


@pytest.mark.slow
def test_filling_again_is_a_step_of_its_own(bare: Editor, ball: Document) -> None:
    assert ball.plate is not None
    run(bare, "fill_again")
    wait_until(bare, lambda: bare.document is not ball)
    assert bare.document is not None and bare.document.plate is not None
    assert bare.document.plate.seed == ball.plate.seed + 1
    bare.undo()
    assert bare.document is ball
    wait_for_jobs(bare)


@pytest.mark.slow
def test_variants_can_be_looked_at_and_chosen(bare: Editor, ball: Document) -> None:
    run(bare, "variants")
    wait_until(bare, lambda: bool(bare.composing.variants))
    variants = bare.composing.variants
    assert len({v.plate.seed for v in variants}) == len(variants) == 3
    before = bare.committed
    bare.composing.compare_variant(2)
    assert bare.document is not None and bare.document.plate is variants[2].plate
    assert bare.committed is before, "it is only looked at"
    bare.composing.compare_variant(None)
    assert bare.document is before
    bare.composing.compare_variant(0)
    bare.choose_tool(ToolName.PLACE)  # another tool, and nothing is looked at any more
    bare.poll()
    assert bare.document is before
    bare.choose_tool(ToolName.COMPOSE)
    bare.composing.compare_variant(0)
    run(bare, "duplicate")  # of the edit, not of what is looked at
    assert bare.committed is not None and bare.committed.plate is ball.plate
    bare.composing.compare_variant(0)
    bare.undo()
    assert bare.document is ball
    bare.composing.compare_variant(0)
    assert bare.opened.objects == ball.objects, "what was undone is not shown"
    bare.choose_tool(ToolName.COMPOSE)
    bare.composing.choose_variant(variants[1])
    assert bare.document is not None and bare.document.plate is variants[1].plate
    bare.undo()
    assert bare.document is ball


def test_a_way_of_filling_without_chance_offers_no_variants(bare: Editor) -> None:
    bare.methods.choose("inpaint", "telea")
    reason = COMMANDS["variants"].why_not(bare)
    bare.methods.choose("inpaint", "auto")
    assert reason == "This filler gives the same picture every time"
    assert COMMANDS["variants"].why_not(bare) is None


def test_shadow_and_light_are_for_what_has_moved(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    assert COMMANDS["shadow"].why_not(editor) == "Move the object first"
    editor.start(edits.set_placement(ball, 0, Placement(move=(20.0, 5.0))))
    run(editor, "shadow")
    assert editor.object is not None and editor.object.shadow.strength > 0
    editor.composing.choose_refiner("harmonise")
    assert editor.object.harmony > 0
    editor.composing.preview_feather(2.0)
    editor.composing.preview_feather(2.5)
    editor.commit("Blend of edge")
    assert editor.document is not None and editor.document.feather == 2.5
    for _ in range(3):
        editor.undo()
    assert editor.object.shadow == Shadow() and editor.object.harmony == 0


def shade_of(editor: Editor, document: Document) -> Shade | None:
    """The shadow of the document's object as a frame has it."""
    (own,) = build_frame(document, editor.view, editor.cache, renderer="gl").objects
    assert isinstance(own, FrameObject)
    return own.lit.shade


def test_a_dragged_shadow_is_coarse_until_the_pointer_rests(editor: Editor, ball: Document) -> None:
    cache = editor.cache
    document = edits.set_placement(ball, 0, Placement(move=(20.0, 5.0)))
    document = edits.set_shadow(document, 0, Shadow(strength=0.6))
    sketched = shade_of(editor, document)
    assert cache.lights.is_waiting and cache.is_waiting
    wait_until(editor, lambda: shade_of(editor, document) is not sketched)
    assert not cache.lights.is_waiting
    exact = shade_of(editor, document)
    assert exact is not None and sketched is not None
    assert exact.pitch < sketched.pitch
    for a, b in zip(exact.bounds, sketched.bounds, strict=True):
        assert abs(a - b) < 20


def test_a_shadow_follows_what_is_said_of_the_ground(editor: Editor, ball: Document) -> None:
    document = edits.set_placement(ball, 0, Placement(move=(-20.0, 0.0)))
    document = edits.set_shadow(document, 0, Shadow(strength=0.8))
    steep = set_seen_from(document, 0, 80.0)
    afresh = shade_of(editor, steep)
    flat = shade_of(editor, set_seen_from(document, 0, 15.0))
    again = shade_of(editor, steep)
    assert afresh is not None and flat is not None and again is not None
    assert again.bounds == afresh.bounds != flat.bounds


def test_a_shadow_follows_the_opacity_of_its_object(editor: Editor, ball: Document) -> None:
    document = edits.set_placement(ball, 0, Placement(move=(-20.0, 0.0)))
    document = edits.set_shadow(document, 0, Shadow(strength=0.8))
    whole = shade_of(editor, document)
    half = shade_of(editor, edits.set_finish(document, 0, Finish(0.5)))
    assert whole is not None and half is not None
    assert 0 < half.alpha.max() < 0.7 * whole.alpha.max()
    assert shade_of(editor, edits.set_finish(document, 0, Finish(0.0))) is None


def test_what_lies_under_clear_ground_is_no_shadow_and_no_background(
    editor: Editor, ball: Document
) -> None:
    pixels, alpha = ball.photo.pixels.copy(), np.full(ball.photo.size[::-1], 255, np.uint8)
    pixels[:8], alpha[:8] = (255, 0, 255), 0
    photo = replace(ball.photo, picture=Picture(pixels, alpha))
    editor.start(replace(ball, photo=photo))
    assert editor.document is not None
    looked_at = editor.old_shadows._cutout(editor.document, 0).pixels
    np.testing.assert_array_equal(looked_at[8:], pixels[8:])
    assert (looked_at[:8] != (255, 0, 255)).any(-1).all()


def standing(shadow: np.ndarray | None) -> Document:
    return lifted_of(photo_of(shadow))


def lifted_of(pixels: np.ndarray) -> Document:
    """A thing on the ground, lifted, with a background, moved aside."""
    document = open_photo(png(pixels), "thing.png")
    document = edits.set_mask(edits.add_object(document), 0, inside(), Prompt())
    made = lift_mask(pixels, document.photo.camera, inside(), "relief", LiftSettings(800, trust=0))
    document = edits.set_lifted(document, 0, *made)
    document = edits.set_plate(document, make_plate(pixels, plate_cover(document), "telea"))
    return edits.set_placement(document, 0, Placement(move=(-60.0, 0.0)))


@pytest.mark.slow
def test_the_shadow_in_the_photo_is_taken_along(editor: Editor) -> None:
    shade = thrown(35.0, 0.8)
    document = standing(shade)
    editor.start(document)
    run(editor, "take_shadow")
    assert COMMANDS["take_shadow"].why_not(editor) == "Its shadow is being looked for"
    wait_for_jobs(editor)
    own = (shade > 0.3) & ~plate_cover(document)
    offer = editor.old_shadows.offer  # outlined, and nothing has changed
    assert offer is not None and editor.document is document
    assert (offer.outlined & own).sum() > 0.6 * own.sum()
    assert editor.message is not None and editor.message.action is not None
    editor.message.action.run()  # one click refuses
    assert editor.document is document and editor.old_shadows.offer is None
    editor.old_shadows._offer = offer
    editor.preview = edits.set_feather(document, 3.0)
    assert editor.old_shadows.offer is None, "what it was found in is not what one sees"
    editor.preview = None
    editor.old_shadows.accept()
    assert editor.object is not None and editor.history is not None
    assert editor.history.undo_label == "Shadow as in the photo"
    assert editor.object.shadow.strength > 0.4
    assert editor.document is not None
    brighter = plate_picture(editor.document)[own].mean() - plate_picture(document)[own].mean()
    assert brighter > 20
    editor.undo()  # shadow and background at once
    assert editor.document is document


@pytest.mark.slow
def test_a_shadow_that_would_stay_behind_is_offered_once_what_threw_it_is_moved(
    editor: Editor,
) -> None:
    document = standing(thrown(35.0, 0.8))
    moved = document.objects[0].placement
    editor.start(edits.set_placement(document, 0, Placement()))
    editor.view.tool = ToolName.PLACE
    editor.apply("Move", edits.set_placement(editor.document, 0, moved))
    wait_until(editor, lambda: editor.old_shadows.offer is not None)
    assert editor.view.tool is ToolName.PLACE, "the artist is at work"
    assert editor.message is not None and editor.message.action is not None
    farther = replace(moved, move=(-80.0, 5.0))
    editor.apply("Move", edits.set_placement(editor.document, 0, farther))
    assert editor.old_shadows.offer is not None, "the object is only moved on"
    before, action = editor.document, editor.message.action
    editor.message = None  # as the status bar does
    action.run()
    assert editor.object is not None and editor.object.shadow.strength > 0.4
    assert editor.object.placement == farther and editor.old_shadows.offer is None
    editor.undo()
    assert editor.document is before
    wait_for_jobs(editor)
    assert editor.old_shadows.offer is None, "it is asked once"
    for _ in range(2):  # back to where it was: the next move is another one
        editor.undo()
        wait_for_jobs(editor)
        editor.poll()
    editor.apply("Move", edits.set_placement(editor.opened, 0, moved))
    wait_until(editor, lambda: editor.old_shadows.offer is not None)


def test_it_is_said_only_as_long_as_a_shadow_is_outlined(editor: Editor) -> None:
    document = standing(thrown(35.0, 0.8))
    moved = document.objects[0].placement
    editor.start(edits.set_placement(edits.duplicate(document, 0), 1, Placement()))
    editor.view.tool = ToolName.PLACE
    editor.apply("Move", edits.set_placement(editor.opened, 1, moved))
    wait_until(editor, lambda: editor.old_shadows.offer is not None)
    said = editor.message
    editor.poll()
    assert said is not None and editor.message is said
    editor.objects.choose(0)
    editor.poll()
    assert editor.old_shadows.offer is None and editor.message is None


def test_no_copy_is_offered_the_shadow_in_which_another_one_stands(editor: Editor) -> None:
    document = standing(thrown(35.0, 0.8))
    moved = document.objects[0].placement
    editor.start(edits.set_placement(document, 0, Placement()))
    editor.objects.duplicate()
    editor.view.tool = ToolName.PLACE
    editor.apply("Move", edits.set_placement(editor.opened, 1, moved))
    for _ in range(3):
        editor.poll()
        assert not editor.jobs.is_busy(SHADOW)
    wait_for_jobs(editor)
    assert editor.old_shadows.offer is None and editor.message is None
    editor.apply("Hide object", edits.set_visible(editor.opened, 0, False))
    wait_until(editor, lambda: editor.old_shadows.offer is not None)


@pytest.mark.slow
def test_a_shadow_is_looked_for_on_the_ground_that_is_said(editor: Editor) -> None:
    document = set_seen_from(standing(None), 0, 45.0)
    editor.start(document)
    ground = editor.old_shadows._cutout(document, 0).ground
    assert ground == pytest.approx(45.0, abs=0.5)
    assert editor.composing.usual_ground == ground


@pytest.mark.slow
def test_nothing_is_said_where_no_shadow_stays_behind(editor: Editor) -> None:
    document = standing(None)
    moved = document.objects[0].placement
    editor.start(edits.set_placement(document, 0, Placement()))
    editor.apply("Move", edits.set_placement(editor.document, 0, moved))
    wait_until(editor, lambda: editor.jobs.is_busy(SHADOW))
    wait_for_jobs(editor)
    assert editor.message is None and editor.old_shadows.offer is None


@pytest.mark.slow
def test_where_no_shadow_is_sure_it_is_said_and_nothing_changes(editor: Editor) -> None:
    document = standing(None)
    editor.start(document)
    run(editor, "take_shadow")
    wait_for_jobs(editor)
    assert editor.document is document
    assert editor.message is not None
    assert editor.message.text.startswith("No clear shadow")


def test_a_shadow_falls_on_what_rests_as_it_is_exported(editor: Editor, ball: Document) -> None:
    document = edits.set_placement(
        edits.duplicate(ball, 0), 1, Placement(move=(-45.0, 40.0), scale=0.4)
    )
    document = edits.set_shadow(document, 1, Shadow(1.0, -30.0, 2.0, 0.1))
    found = []
    for is_hurried in (True, False):
        cache = type(editor.cache)()
        cache.frame_time = FRAME if is_hurried else np.inf
        frame = build_frame(document, editor.view, cache, renderer="gl")
        (own,) = (o for o in frame.objects if isinstance(o, FrameObject) and o.k == 0)
        assert own.lit.is_shaded and own.lit.relit is not None
        assert frame.blend is not None and frame.blend.max() == 1
        found.append(float(own.lit.relit.factor.min()))
    assert max(found) < -0.3 and abs(found[0] - found[1]) < 0.2
    far = edits.set_placement(document, 1, Placement(move=(900.0, 40.0), scale=0.4))
    frame = build_frame(far, editor.view, type(editor.cache)(), renderer="gl")
    assert not any(isinstance(o, FrameObject) and o.lit.is_shaded for o in frame.objects)


def test_walls_and_steps_are_asked_of_a_depth_model(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    run(editor, "depth")
    wait_for_jobs(editor)
    assert editor.document is ball and editor.message is not None
    assert "depth model" in editor.message.text
    editor.apply("Known", edits.set_depth(ball, np.ones((4, 5), np.float32)))
    run(editor, "depth")
    assert editor.document is not None and editor.document.depth is None
    editor.undo()
    assert editor.document.depth is not None


def test_what_has_not_moved_keeps_its_shadow(editor: Editor, ball: Document) -> None:
    editor.start(ball)
    assert COMMANDS["take_shadow"].why_not(editor) == "Move the object first"


def test_harmonise_offers_both_lights_and_grain_and_one_step_takes_all(
    editor: Editor, ball: Document
) -> None:
    editor.start(edits.set_placement(ball, 0, Placement(turn=(25.0, 0.0, 0.0))))
    editor.composing.choose_refiner("harmonise")
    assert editor.object is not None
    assert all(getattr(editor.object, name) == usual for name, usual in USUAL_SHARES.items())
    editor.composing.preview_share("harmony", 0.0)
    editor.commit("Adjust light")
    editor.composing.preview_share("relight", 0.0)
    editor.commit("Adjust light")
    editor.composing.preview_share("grain", 0.0)
    editor.commit("Adjust light")
    editor.composing.preview_share("defocus", 0.0)
    assert editor.object.relight == 0 and editor.object.grain == 0 and editor.object.defocus == 0
    assert editor.composing.refiner == "harmonise"  # until the pointer is let go
    editor.commit("Adjust light")
    assert editor.composing.refiner == "none"


def test_the_canvas_shows_the_light_that_stays(editor: Editor, ball: Document) -> None:
    turned = edits.set_placement(ball, 0, Placement(turn=(35.0, 0.0, 0.0)))
    editor.start(turned)
    editor.cache.frame_time = np.inf  # one frame, exact
    plain = build_frame(turned, editor.view, editor.cache).layers[0]
    lit = edits.set_share(turned, 0, "relight", 1.0)
    relit = build_frame(lit, editor.view, editor.cache).layers[0]
    again = build_frame(lit, editor.view, editor.cache).layers[0]
    editor.cache.frame_time = FRAME
    assert again is relit  # made once
    assert np.array_equal(plain.pixels[..., 3], relit.pixels[..., 3])
    assert np.abs(plain.pixels.astype(int) - relit.pixels).max() > 4


def test_another_finish_shows_on_the_canvas_where_nothing_moved_and_is_undone(
    editor: Editor, ball: Document
) -> None:
    editor.start(ball)
    finish = Finish(opacity=0.5, exposure=-1.0)
    editor.composing.preview_finish(finish)
    editor.commit("Look of object")
    changed = editor.document
    assert changed is not None and changed.objects[0].finish == finish
    assert decode_session(encode_session(changed)).objects[0].finish == finish
    editor.cache.frame_time = np.inf  # one frame, exact
    plain = build_frame(edits.set_placement(ball, 0, Placement(move=(0.4, 0))), editor.view,
        editor.cache).layers[0]  # fmt: skip
    frame = build_frame(changed, editor.view, editor.cache)
    editor.cache.frame_time = FRAME
    shown = frame.layers[0]
    assert shown.pixels[..., 3].max() in (127, 128) and plain.pixels[..., 3].max() == 255
    brightness = shown.pixels[..., :3].sum() / plain.pixels[..., :3].sum()
    assert abs(brightness - 0.5 * finish.gain[1]) < 0.02
    assert frame.blend is not None and frame.blend.max() == 1
    run(editor, "undo")
    assert editor.document is ball
    editor.composing.preview_finish(Finish(exposure=9.0))  # nonsense is said, and nothing changes
    assert editor.document is ball and editor.message is not None
