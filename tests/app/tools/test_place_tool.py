"""Taking the whole object by its parts, with a real object and real pointers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import made_photo, wait_for_jobs
from objectmorpher.commands import run, why_not
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ToolName
from objectmorpher.gui.panels.place import DONE, place_by, placed_values
from objectmorpher.tools.gizmo import TURNS, ghost, gizmo
from objectmorpher.tools.place_tool import SLOW, PlaceTool
from objectmorpher.tools.pointer import Pointer, PointerShape
from objectmorpher_core.base.rotations import turn_matrix, vector_from_matrix, wrapped
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.placement import centre_of
from strokes import move, press, release

PIXEL = 1.0  # canvas px
EXACT = 1e-6
DEGREES = 1e-3
START = Placement(move=(6.0, -4.0), depth=0.2, turn=(20.0, -30.0, 40.0), scale=1.1)


UP = (0.1, -0.6, -float(np.sqrt(1 - 0.37)))  # of a thing that is seen from above


@pytest.fixture
def placed(editor: Editor, ball: Document, request: pytest.FixtureRequest) -> Editor:
    """The lifted ball, moved and turned, and the Place tool; of another upright where asked."""
    thing = ball.objects[0]
    assert thing.lifted is not None
    lifted = replace(thing.lifted, up=getattr(request, "param", None))
    document = ball.with_object(0, replace(thing, lifted=lifted))
    editor.start(edits.set_placement(document, 0, START))
    editor.view.tool = ToolName.PLACE
    return editor


uprights = pytest.mark.parametrize("placed", [None, UP], indirect=True, ids=["camera", "own"])


def stroke(editor: Editor, *places: np.ndarray, wheel: float = 0.0, **held: bool) -> Placement:
    """Press at the first place, go to the others, let go; the wheel turns at the last one."""
    tool = PlaceTool()
    tool.hover(editor, Pointer(*places[0]))
    press(editor, tool, places[0])
    move(editor, *places[1:], **held)
    if wheel:
        move(editor, places[-1], wheel=wheel, **held)
    release(editor, places[-1])
    assert editor.object is not None
    return editor.object.placement


def seen_from(editor: Editor, world: np.ndarray) -> np.ndarray:
    assert editor.document is not None
    return editor.view.canvas_from_image(editor.document.photo.camera.project(world))


def spot_on(editor: Editor) -> np.ndarray:
    """Canvas px on the object, away from rings, arrow and corners."""
    shown = gizmo(editor)
    assert shown is not None
    for angle in np.linspace(0, 2 * np.pi, 60):
        for share in (0.3, 0.45, 0.6):
            way = np.array([np.cos(angle), np.sin(angle)])
            at = shown.centre + share * 100 * way
            if PlaceTool().part_at(editor, Pointer(*at)) == "move":
                return at
    raise AssertionError("nothing of the object is free")


@uprights
@pytest.mark.parametrize("part", TURNS)
@pytest.mark.parametrize("degrees", [35.0, -80.0, 170.0, -250.0])
def test_a_ring_turns_about_its_axis_by_the_angle_along_it(
    placed: Editor, part: str, degrees: float
) -> None:
    shown, before = gizmo(placed), placed.placing.angles
    assert shown is not None
    ring, tool = shown.rings[part], PlaceTool()
    begins = np.linspace(0, 2 * np.pi, 90)
    begin = next(
        float(a)
        for a, at, front in zip(begins, ring.seen(begins), ring.is_front(begins), strict=True)
        if front
        and tool.part_at(placed, Pointer(*at)) == part
        and ring.speed(float(a)) > SLOW * ring.reach
    )
    way = begin + np.radians(np.linspace(0, degrees, 40))
    placement = stroke(placed, *ring.seen(way))
    wanted = list(before)
    wanted[TURNS.index(part)] += degrees
    # Beyond a right angle the same turn has other numbers, with half a turn in each.
    gimbal = placed.placing.gimbal
    found = gimbal.matrix(*placed.placing.angles)
    np.testing.assert_allclose(found, gimbal.matrix(*wanted), atol=np.radians(DEGREES))
    assert placement.scale == START.scale
    # Its foot, or its middle, stays: see tests/core/test_ground.py.
    assert placement == placed.placing.turned(START, placement.turn)
    if part == "roll":
        assert (placement.move, placement.depth) == (START.move, START.depth)


@uprights
@pytest.mark.parametrize("part", TURNS)
def test_a_point_of_the_object_on_a_ring_goes_along_the_ring(placed: Editor, part: str) -> None:
    """The rings are those of a gimbal: what a number changes, its ring shows."""
    assert placed.document is not None and placed.object is not None
    shown, lifted = gizmo(placed), placed.object.lifted
    assert shown is not None and lifted is not None
    ring, camera = shown.rings[part], placed.document.photo.camera
    angles = list(placed.placing.angles)
    angles[TURNS.index(part)] += 25.0
    turn = placed.placing.gimbal.turn((angles[0], angles[1], angles[2]))
    later = Placement(START.move, START.depth, turn, START.scale)
    before, after = START.matrix(lifted, camera), later.matrix(lifted, camera)
    begin, end = ring.points(np.radians([10.0, 35.0]))
    moved = after @ np.linalg.inv(before) @ [*begin, 1.0]
    np.testing.assert_allclose(moved[:3], end, atol=1e-9)


def test_shift_snaps_rings_to_steps_of_15_degrees(placed: Editor) -> None:
    shown = gizmo(placed)
    assert shown is not None
    way = shown.rings["roll"].seen(np.radians([200.0, 205.0, 212.0]))
    assert stroke(placed, *way, shift=True).turn == pytest.approx((20, -30, 45), abs=EXACT)


@pytest.mark.parametrize("wheel", [0.0, 4.0, -6.0])
def test_what_was_grabbed_stays_under_the_pointer(placed: Editor, wheel: float) -> None:
    start = spot_on(placed)
    held = placed.posing.surface_at(start)
    assert held is not None and placed.document is not None and placed.object is not None
    rest = placed.derived.unplaced(placed.document, 0, held.world)
    end = start + (70, -45)
    placement = stroke(placed, start, start + (30, -10), end, wheel=wheel)
    assert (placement.depth > START.depth) == (wheel < 0) or wheel == 0
    now = placed.derived.project(placed.document, 0, rest)
    gap = placed.view.canvas_from_image(now) - end
    assert np.linalg.norm(gap) < PIXEL
    assert placement.turn == START.turn


def test_shift_keeps_one_axis(placed: Editor) -> None:
    start = spot_on(placed)
    shown = gizmo(placed)
    assert shown is not None
    before = shown.centre
    stroke(placed, start, start + (60, 9), shift=True)
    after = gizmo(placed)
    assert after is not None
    assert abs(after.centre[1] - before[1]) < 0.5
    assert after.centre[0] - before[0] > 40


def test_dragging_a_corner_outwards_scales_up(placed: Editor) -> None:
    shown = gizmo(placed)
    assert shown is not None
    corner = shown.corners[0]
    stays = seen_from(placed, placed.placing.pivot())
    end = stays + 1.5 * (corner - stays)
    assert stroke(placed, corner, end).scale == pytest.approx(1.5 * START.scale)
    np.testing.assert_allclose(seen_from(placed, placed.placing.pivot()), stays, atol=PIXEL)
    assert placed.history is not None and placed.history.undo_label == "Scale object"


def test_the_arrow_follows_the_pointer_into_depth(placed: Editor) -> None:
    """A point off the centre, dragged in depth, is seen at f r / z from it."""
    shown = gizmo(placed)
    assert shown is not None and placed.document is not None and placed.object is not None
    lifted, camera = placed.object.lifted, placed.document.photo.camera
    assert lifted is not None
    arrow = shown.arrow
    middle = (arrow.near + arrow.far) / 2
    before = centre_of(START, lifted, camera)
    placement = stroke(placed, arrow.at(middle), arrow.at(0.8 * middle))
    after = centre_of(placement, lifted, camera)
    assert after[2] == pytest.approx(before[2] / 0.8, rel=EXACT)
    np.testing.assert_allclose(camera.project(after), camera.project(before), atol=EXACT)
    assert placement.move == pytest.approx(START.move, abs=EXACT)


def test_dragging_beside_the_object_to_the_right_turns_its_front_to_the_right(
    placed: Editor,
) -> None:
    yaw, pitch, roll = stroke(placed, np.array([8.0, 8.0]), np.array([58.0, 8.0])).turn
    assert yaw < START.turn[0]  # positive yaw turns the front to the left
    assert (pitch, roll) == START.turn[1:]


def test_a_click_changes_nothing(placed: Editor) -> None:
    before, at = placed.document, spot_on(placed)
    assert stroke(placed, at, at + (1, 0)) == START
    assert placed.document is before


def test_an_aborted_turn_changes_nothing(placed: Editor) -> None:
    before, shown = placed.document, gizmo(placed)
    assert shown is not None
    a, b = shown.rings["roll"].seen(np.radians([200.0, 260.0]))
    press(placed, PlaceTool(), a)
    move(placed, b)
    assert placed.document is not before
    placed.escape()
    assert placed.document is before


def test_the_pointer_tells_what_it_would_take(placed: Editor) -> None:
    shown, tool = gizmo(placed), PlaceTool()
    assert shown is not None
    assert tool.hover(placed, Pointer(*spot_on(placed))) is PointerShape.MOVE
    assert tool.hover(placed, Pointer(*shown.corners[1])) is PointerShape.SIZE
    reach = 9.0 * placed.view.scale  # hit areas are 10 points
    beside = shown.arrow.at((shown.arrow.near + shown.arrow.far) / 2) + (reach, 0)
    assert tool.part_at(placed, Pointer(*beside)) == "depth"
    assert tool.hint(placed)


@pytest.mark.parametrize("zoom", [0.3, 1.0, 20.0])
def test_the_gizmo_stays_within_reach_at_any_zoom(placed: Editor, zoom: float) -> None:
    placed.view.set_zoom(zoom, (360, 280), (180, 140))
    shown = gizmo(placed)
    assert shown is not None
    assert (shown.corners >= 0).all()
    assert (shown.corners <= (placed.view.width, placed.view.height)).all()
    for ring in shown.rings.values():
        seen = ring.seen(np.linspace(0, 2 * np.pi, 50))
        reach = np.linalg.norm(seen - shown.centre, axis=1).max()
        assert 40 < reach < 0.75 * placed.view.height


def test_arrows_nudge_the_object_by_pixels(placed: Editor) -> None:
    placed.placing.nudge(10, -1)
    assert placed.placing.placement is not None
    assert placed.placing.placement.move == pytest.approx((16.0, -5.0), abs=EXACT)


def test_each_group_of_numbers_goes_back_by_itself(placed: Editor) -> None:
    """Turn and size about the foot of what stands, as they are changed."""
    foot = placed.placing.pivot()
    run(placed, "reset_turn")
    placement = placed.placing.placement
    assert placement is not None and (placement.turn, placement.scale) == ((0, 0, 0), START.scale)
    assert np.allclose(placed.placing.pivot(), foot, atol=EXACT)
    assert why_not(placed, "reset_turn") == "The object is not turned"
    run(placed, "reset_size")
    assert np.allclose(placed.placing.pivot(), foot, atol=EXACT)
    run(placed, "reset_position")
    assert placed.placing.placement == Placement()
    assert why_not(placed, "reset_place") == "The object is where it was in the photo"
    for _ in range(3):
        run(placed, "undo")
    assert placed.placing.placement == START
    run(placed, "reset_place")
    assert placed.placing.placement == Placement()


# ---- on the ground --------------------------------------------------------------------------


@pytest.fixture
def grounded(placed: Editor, ball: Document) -> Editor:
    """The ball at rest, which stands on the ground; the horizon is above its foot."""
    placed.start(edits.set_grounded(edits.set_horizon(ball, 40.0), 0, True))
    placed.view.tool = ToolName.PLACE
    return placed


def below_ground(editor: Editor) -> float:
    """Object diameters by which the object is below the ground."""
    hold = editor.placing.hold()
    assert hold.ground is not None and editor.document is not None and editor.object is not None
    splats = editor.derived.posed(editor.document, 0)
    body = splats.means[splats.rest.lifted.texture.solidity > 0.5]
    return float(hold.ground.below(body).max()) / hold.unit


@pytest.mark.parametrize("name", ["as it is", "larger", "turned"])
def test_reset_position_brings_what_stands_back_on_the_ground(
    grounded: Editor, tmp_path: Path, name: str
) -> None:
    place, settings = grounded.placing, grounded.settings
    assert grounded.document is not None
    finish = grounded.document.objects[0].finish
    place.nudge(18.0, 9.0)
    if name == "larger":
        place.move_to(place.scaled(place.placement, 1.6))
        grounded.commit("Scale object")
    elif name == "turned":
        place.move_to(place.turned(place.placement, (0.0, 0.0, 50.0)))
        grounded.commit("Turn object")
    before = place.placement
    assert before is not None
    run(grounded, "reset_position")
    now, thing = place.placement, grounded.object
    assert now is not None and thing is not None
    assert (now.scale, now.turn) == (before.scale, before.turn)
    assert abs(below_ground(grounded)) < 1e-3
    assert thing.finish == finish
    if name == "as it is":
        assert now == Placement() and not thing.is_moved
        grounded.exporting.export_to(tmp_path / "out.png")
        wait_for_jobs(grounded)
        np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "out.png")), made_photo())
    steps = grounded.history.cursor if grounded.history else 0
    run(grounded, "reset_position")
    assert grounded.history is not None and grounded.history.cursor == steps, "it is there"
    run(grounded, "undo")
    assert place.placement == before, "one step"
    grounded.settings = settings


def test_an_object_on_the_ground_slides_over_it(grounded: Editor) -> None:
    start = spot_on(grounded)
    before = grounded.placing.hold()
    placement = stroke(grounded, start, start + (40, -50))
    after = grounded.placing.hold()
    assert placement.depth > 0.05, "up in the picture is farther away"
    assert abs(below_ground(grounded)) < EXACT
    gone = (after.xy - before.xy) * grounded.view.zoom
    np.testing.assert_allclose(gone, [40, -50], atol=1e-3)


def test_the_wheel_slides_it_away(grounded: Editor) -> None:
    start = spot_on(grounded)
    before = grounded.placing.hold()
    placement = stroke(grounded, start, start, wheel=-4.0)
    after = grounded.placing.hold()
    assert placement.depth == pytest.approx(0.2)
    assert abs(below_ground(grounded)) < EXACT
    assert after.xy[0] == pytest.approx(before.xy[0], abs=EXACT)
    assert after.xy[1] < before.xy[1]


@pytest.mark.parametrize("part", ["scale", "roll", "depth"])
def test_it_stays_on_the_ground_whatever_is_done(grounded: Editor, part: str) -> None:
    shown = gizmo(grounded)
    assert shown is not None
    if part == "scale":
        stroke(grounded, shown.corners[0], shown.corners[0] - (50, 50))
    elif part == "roll":
        stroke(grounded, *shown.rings["roll"].seen(np.radians([200.0, 230.0, 260.0])))
    else:
        stroke(grounded, shown.arrow.at(shown.arrow.far + 20), shown.arrow.at(shown.arrow.far))
    assert grounded.placing.placement != Placement()
    assert abs(below_ground(grounded)) < EXACT


@pytest.mark.parametrize("name", ["Right", "Down", "Farther", "Yaw", "Pitch", "Roll", "Scale"])
def test_whatever_number_is_typed_it_stays_on_the_ground(grounded: Editor, name: str) -> None:
    """And the number is then the one that was typed."""
    assert grounded.placing.placement is not None
    numbers = list(DONE)
    for typed in (0.8, 9.0, -0.4) if name == "Farther" else (-6.0, 12.0, 30.0):
        typed = 100 + typed if name == "Scale" else typed
        place_by(grounded, name, typed)
        assert grounded.placing.placement is not None
        assert abs(below_ground(grounded)) < EXACT, typed
        values = placed_values(grounded, grounded.placing.placement)
        assert values[numbers.index(name)] == pytest.approx(typed, abs=1e-3)
    grounded.commit(DONE[name])
    run(grounded, "undo")
    assert grounded.placing.placement == Placement()


@pytest.mark.parametrize("command", ["reset_turn", "reset_size"])
def test_it_goes_back_in_turn_or_size_by_the_way_it_came(grounded: Editor, command: str) -> None:
    """It neither floats nor sinks, and is where it was before it was turned or scaled."""
    placing, start = grounded.placing, grounded.placing.stood(Placement((9.0, 0.0)))
    placing.move_to(start)
    grounded.commit("Move")
    pitched, larger = placing.turned_to(start, (0.0, 60.0, 0.0)), placing.scaled(start, 1.6)
    placing.move_to(pitched if command == "reset_turn" else larger)
    grounded.commit("Change")
    run(grounded, command)
    assert abs(below_ground(grounded)) < EXACT
    back = placing.placement
    assert back is not None and (back.turn, back.scale) == (start.turn, start.scale)
    assert np.allclose((*back.move, back.depth), (*start.move, start.depth), atol=EXACT)


def test_the_horizon_can_be_dragged_and_is_one_step(grounded: Editor) -> None:
    shown = gizmo(grounded)
    assert shown is not None and shown.horizon is not None
    at = np.array([20.0, shown.horizon])
    tool = PlaceTool()
    assert tool.part_at(grounded, Pointer(*at)) == "horizon"
    stroke(grounded, at, at - (0, 10 * grounded.view.zoom))
    assert grounded.document is not None
    assert grounded.document.horizon == pytest.approx(30.0)
    assert grounded.history is not None and grounded.history.undo_label == "Move the horizon"
    run(grounded, "undo")
    assert grounded.document.horizon == 40.0


@pytest.mark.parametrize("is_horizon", [True, False])
def test_what_has_moved_stays_on_the_ground_that_is_told_later(
    grounded: Editor, is_horizon: bool
) -> None:
    """The next turn would otherwise move it there at a jump."""
    start, placing = spot_on(grounded), grounded.placing
    stroke(grounded, start, start + (40, -50))
    assert grounded.document is not None and grounded.object is not None
    before, seen = placing.placement, grounded.derived.posed(grounded.document, 0).means.mean(0)
    placing.drag_horizon(10.0) if is_horizon else placing.look_down(40.0)
    grounded.commit("The ground")
    assert placing.placement != before
    assert abs(below_ground(grounded)) < EXACT
    after = grounded.derived.posed(grounded.document, 0).means.mean(0)
    camera = grounded.document.photo.camera
    np.testing.assert_allclose(camera.project(after), camera.project(seen), atol=8.0)
    grounded.undo()
    assert placing.placement == before


def test_above_the_horizon_it_says_why_and_does_not_snap(grounded: Editor) -> None:
    grounded.placing.drag_horizon(135.0)
    grounded.commit("Move the horizon")
    start = spot_on(grounded)
    placement = stroke(grounded, start, start + (40, -40))
    assert grounded.message is not None
    assert grounded.message.text == (
        "The object's lowest point is above the horizon, so it cannot stand"
    )
    assert placement.depth == pytest.approx(0, abs=EXACT)


@pytest.mark.parametrize(("angle", "same"), [(190, -170), (-180, 180), (540, 180), (0, 0)])
def test_angles_are_wrapped(angle: float, same: float) -> None:
    assert wrapped(angle) == pytest.approx(same)


# ---- a hand on it ---------------------------------------------------------------------------


def _turned(before: Placement, now: Placement) -> float:
    """Degrees, about any axis."""
    both = turn_matrix(*now.turn) @ turn_matrix(*before.turn).T
    return float(np.degrees(np.linalg.norm(vector_from_matrix(both))))


def test_a_few_pixels_at_the_end_of_a_ring_turn_by_a_few_degrees(placed: Editor) -> None:
    shown = gizmo(placed)
    assert shown is not None
    ring = shown.rings["pitch"]  # always seen from its edge
    angles = np.linspace(0, 2 * np.pi, 720)
    seen, slow = ring.seen(angles), np.array([ring.speed(float(a)) for a in angles])
    end = seen[np.where(ring.is_front(angles), slow, np.inf).argmin()]
    inward = (shown.centre - end) / np.linalg.norm(shown.centre - end)
    placement = stroke(placed, end, end + 15 * inward)
    assert _turned(START, placement) == pytest.approx(np.degrees(15 / ring.reach), rel=0.05)


@uprights
@pytest.mark.parametrize("seed", range(12))
def test_with_ctrl_the_grabbed_point_follows_the_hand_as_far_as_a_turn_takes_it(
    placed: Editor, seed: int
) -> None:
    random, document = np.random.default_rng(seed), placed.document
    assert document is not None
    place = Placement(
        turn=(random.uniform(-180, 180), random.uniform(-60, 60), random.uniform(-90, 90)),
        move=(random.uniform(-30, 30), random.uniform(-20, 20)), scale=random.uniform(0.5, 1.5),
    )  # fmt: skip
    placed.start(edits.set_placement(document, 0, place))
    placed.view.tool, tool = ToolName.PLACE, PlaceTool()
    camera, middle, shown = document.photo.camera, placed.placing.centre(), gizmo(placed)
    assert shown is not None
    while True:  # a point that is neither so near the middle that it spins nor at the ball's rim
        first = shown.centre + random.uniform(-1, 1, 2) * shown.radius
        seen = placed.posing.surface_at(first)
        off = 0.0 if seen is None else float(np.linalg.norm(seen.world - middle))
        rim = off * camera.focal * placed.view.zoom / middle[2]  # px
        if seen is None or rim < 0.4 * shown.radius:
            continue
        is_on_it = np.linalg.norm(seen_from(placed, seen.world) - first) < PIXEL  # not beside it
        if is_on_it and np.linalg.norm(first - shown.centre) < 0.9 * rim:
            break
    grabbed = np.linalg.inv(_motion(placed)) @ [*seen.world, 1.0]
    press(placed, tool, first, ctrl=True)
    for _ in range(4):
        at = shown.centre + random.uniform(-1, 1, 2) * rim
        is_reached = np.linalg.norm(at - shown.centre) < 0.9 * rim
        move(placed, at, ctrl=True)
        now = (_motion(placed) @ grabbed)[:3]
        np.testing.assert_allclose(placed.placing.centre(), middle, atol=1e-5)
        if is_reached:
            assert np.linalg.norm(seen_from(placed, now) - at) < 3 * PIXEL
        else:  # it is taken at the rim, towards the hand
            way, hand = seen_from(placed, now) - shown.centre, at - shown.centre
            assert way @ hand > 0.9 * np.linalg.norm(way) * np.linalg.norm(hand)
    move(placed, first, ctrl=True)
    assert placed.object is not None
    assert _turned(place, placed.object.placement) < 0.01 and ghost(placed) == ()
    release(placed, first, ctrl=True)


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_what_is_grabbed_by_its_middle_does_not_spin(placed: Editor, share: float) -> None:
    shown, tool = gizmo(placed), PlaceTool()
    assert shown is not None
    first, right = shown.centre + [0, share * shown.radius], np.array([0.1 * shown.radius, 0.0])
    press(placed, tool, first, ctrl=True)
    move(placed, first + right, ctrl=True)
    assert placed.object is not None
    assert 3.0 < _turned(START, placed.object.placement) < 20.0
    release(placed, first, ctrl=True)


def _motion(editor: Editor) -> np.ndarray:
    """(4, 4): the placement of the object as it is shown."""
    document, thing = editor.document, editor.object
    assert document is not None and thing is not None and thing.lifted is not None
    return thing.placement.matrix(thing.lifted, document.photo.camera)


def test_without_ctrl_the_middle_moves_it(placed: Editor) -> None:
    shown = gizmo(placed)
    assert shown is not None
    right = np.array([0.3 * shown.radius, 0.0])
    placement = stroke(placed, shown.centre, shown.centre + right / 2, shown.centre + right)
    assert _turned(START, placement) == 0


@pytest.mark.parametrize("size", [4.0, 12.0, 30.0])
def test_a_small_object_is_moved_by_its_middle_and_its_parts_are_outside(
    placed: Editor, ball: Document, size: float
) -> None:
    """`size` canvas px across, about."""
    small = Placement(scale=size / (88 * placed.view.zoom))
    placed.start(edits.set_placement(ball, 0, small))
    placed.view.tool = ToolName.PLACE
    shown, frame = gizmo(placed), placed.placing.frame()
    assert shown is not None and frame is not None
    box = placed.view.canvas_from_image(frame.corners)
    half = np.linalg.norm(box - shown.centre, axis=1).max()
    assert min(ring.reach for ring in shown.rings.values()) >= half + 20
    assert np.abs(shown.corners - shown.centre).min() >= 20
    assert PlaceTool().part_at(placed, Pointer(*shown.centre)) == "move"
    before = shown.centre
    placement = stroke(placed, before, before + (40, 30))
    assert placement.turn == (0, 0, 0)
    np.testing.assert_allclose(np.array(placement.move) * placed.view.zoom, [40, 30], atol=1.0)


def test_what_the_object_moves_over_is_undone_and_delete_takes_the_object(placed: Editor) -> None:
    run(placed, "ground")
    assert placed.placing.is_grounded
    run(placed, "undo")
    assert not placed.placing.is_grounded and placed.placing.placement == START
    assert why_not(placed, "remove_handle") is None
    run(placed, "remove_handle")
    assert placed.document is not None and placed.document.objects == ()


def test_yaw_goes_about_what_the_artist_says_is_upright(
    placed: Editor,
) -> None:
    usual = placed.placing.seen_from
    placed.placing.look_down(50.0)
    placed.commit("Set what is upright")
    assert placed.placing.seen_from == 50.0
    assert placed.placing.usual_seen_from == usual
    before = placed.placing.gimbal.down
    start = placed.placing.placement
    assert start is not None
    yaw, pitch, roll = placed.placing.angles
    placed.placing.move_to(placed.placing.turned_to(start, (yaw + 30, pitch, roll)))
    np.testing.assert_allclose(placed.placing.angles, (yaw + 30, pitch, roll), atol=EXACT)
    np.testing.assert_allclose(placed.placing.gimbal.down, before)
    placed.commit("Turn object")
    placed.undo()
    placed.undo()
    assert placed.placing.seen_from == usual
