"""Dragging, turning and choosing handles of the lifted ball, by real strokes of the tool."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from editor_steps import CENTRE, RADII, close_all, wait_until
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import PoseView, ToolName
from objectmorpher.tools.pointer import Pointer
from objectmorpher.tools.pose_tool import RING, PoseTool
from objectmorpher_core.base.rotations import matrix_from_vector
from objectmorpher_core.document import edits
from objectmorpher_core.document.hold_edits import Stays
from objectmorpher_core.document.model import Document
from strokes import move, press, release

PIXEL = 1.0  # canvas px
TOOL = PoseTool()


@pytest.fixture
def posed(editor: Editor, ball: Document) -> Iterator[Editor]:
    """An editor with the lifted ball, no handle yet."""
    editor.start(ball)
    editor.view.tool, editor.view.pose = ToolName.POSE, PoseView()
    yield editor
    editor.view.pose = PoseView()


def at(editor: Editor, x: float, y: float) -> np.ndarray:
    """Canvas px of image px."""
    return editor.view.canvas_from_image(np.array([x, y]))


def stroke(editor: Editor, *places: np.ndarray, wheel: float = 0.0, **held: bool) -> None:
    """Press at the first place, through the others, release at the last."""
    TOOL.hover(editor, Pointer(*places[0], **held))
    press(editor, TOOL, places[0], **held)
    move(editor, *places[1:], wheel=wheel, **held)
    release(editor, places[-1], **held)


def labels(editor: Editor) -> list[str]:
    """The steps since the ball was opened, the last first; they are undone for it."""
    assert editor.history is not None
    found = []
    while (label := editor.history.undo_label) is not None:
        found.append(label)
        editor.undo()
    return found


def surface_xy(editor: Editor, h: int) -> np.ndarray:
    """Canvas px at which a handle's surface point is seen, as it is skinned."""
    assert editor.document is not None and editor.object is not None
    puppet = editor.derived.shape(editor.document.photo, editor.object).puppet
    handle, thing = editor.object.handles[h], editor.object
    xy = puppet.picture_of(handle.point, thing.pose, thing.placement)
    return editor.view.canvas_from_image(xy)


@pytest.mark.parametrize("zoom", [0.7, 4.0, 23.0])
def test_the_dragged_point_stays_under_the_pointer_at_any_zoom(posed: Editor, zoom: float) -> None:
    random = np.random.default_rng(int(10 * zoom))
    posed.view.set_zoom(zoom, (360.0, 280.0), (180, 140))
    begun = posed.document
    assert begun is not None
    for _ in range(50):
        angle, share = random.uniform(0, 2 * np.pi), np.sqrt(random.uniform(0, 0.85))
        offset = share * np.array([np.cos(angle), np.sin(angle)]) * RADII
        start = at(posed, *(np.array(CENTRE) + offset))
        press(posed, TOOL, start)
        for _ in range(2):
            way = random.uniform(-25, 25, 2) * zoom
            now = start + way * max(1.0, 6.0 / np.abs(way).max())  # a drag, not a click
            move(posed, now)
            assert np.abs(surface_xy(posed, 0) - now).max() < PIXEL
        posed.escape()
        assert posed.document is begun


def test_shift_keeps_one_axis_and_the_wheel_moves_in_depth(posed: Editor) -> None:
    start = at(posed, 90, 60)
    stroke(posed, start, start + (30, 8), shift=True)
    np.testing.assert_allclose(surface_xy(posed, 0), start + (30, 0), atol=PIXEL)
    before = posed.posing.spot(0)
    stroke(posed, start + (30, 0), start + (30, 0), wheel=2.0)
    after = posed.posing.spot(0)
    assert after.depth < before.depth
    np.testing.assert_allclose(after.xy, before.xy, atol=1e-6)
    assert labels(posed) == ["Drag point", "Drag point"]


def test_alt_drags_along_the_normal_and_alt_click_pins(posed: Editor) -> None:
    start = at(posed, CENTRE[0] + 24, CENTRE[1])
    stroke(posed, start, alt=True)
    assert posed.object is not None and posed.object.handles[0].is_pin
    posed.undo()
    stroke(posed, start, start + (10, -4), start + (30, -10), alt=True)
    handle = posed.object.handles[0]
    assert not handle.is_pin
    posed.undo()
    assert posed.document is not None
    normal = posed.cache.facts.normal_at(posed.document, 0, handle.point)
    linear = posed.cache.facts.turn_of(posed.document, 0)
    way = linear @ (handle.target - handle.point)
    assert way @ normal / np.linalg.norm(way) == pytest.approx(1.0, abs=1e-6)


def test_ctrl_drag_turns_by_the_angle_around_the_handle(posed: Editor) -> None:
    centre = at(posed, 90, 60)
    stroke(posed, centre)
    arms = [centre + 40 * np.array([np.cos(a), np.sin(a)]) for a in np.radians([0, 20, 40, 60])]
    stroke(posed, centre, *arms, ctrl=True)
    numbers = posed.handle_numbers.read()
    assert numbers is not None
    assert numbers.turn == pytest.approx(60, abs=1.0)
    assert posed.object is not None and posed.object.pose is not None
    node = posed.object.handles[0].control_point
    assert posed.object.handles[0].turn is not None
    turned = matrix_from_vector(posed.object.handles[0].turn)
    np.testing.assert_allclose(posed.object.pose.rotations[node], turned, atol=1e-6)
    np.testing.assert_allclose(surface_xy(posed, 0), centre, atol=PIXEL)
    assert posed.posing.readout == ""
    assert labels(posed) == ["Turn point", "Add handle"]


def test_ctrl_and_shift_turn_out_of_the_picture(posed: Editor) -> None:
    centre = at(posed, 90, 60)
    stroke(posed, centre, centre + (50, 0), ctrl=True, shift=True)
    assert posed.object is not None and posed.object.handles[0].turn is not None
    assert posed.document is not None
    turn = posed.cache.facts.turn_of(posed.document, 0) @ posed.object.handles[0].turn
    assert abs(turn[1]) > 0.2
    np.testing.assert_allclose(turn[[0, 2]], 0, atol=1e-6)


def test_the_ring_turns_and_shift_snaps(posed: Editor) -> None:
    centre = at(posed, 90, 60)
    stroke(posed, centre)
    arms = [centre + RING * np.array([np.cos(a), np.sin(a)]) for a in np.radians([0, 30, 65, 97])]
    stroke(posed, *arms)
    numbers = posed.handle_numbers.read()
    assert numbers is not None
    assert numbers.turn == pytest.approx(97, abs=0.5)
    stroke(posed, *arms[:2], shift=True)
    numbers = posed.handle_numbers.read()
    assert numbers is not None
    assert numbers.turn == pytest.approx(120, abs=0.1)  # 127, in steps of 15
    run(posed, "ring")
    assert not TOOL.is_on_ring(posed, Pointer(*arms[0]))


def _three(editor: Editor) -> np.ndarray:
    """Three handles; canvas px of them, (3, 2)."""
    places = np.array([at(editor, 80, 60), at(editor, 100, 60), at(editor, 90, 95)])
    for place in places:
        stroke(editor, place)
    return places


def test_shift_click_adds_and_removes_and_a_group_moves_together(posed: Editor) -> None:
    places = _three(posed)
    stroke(posed, places[0])
    stroke(posed, places[1], shift=True)
    assert posed.posing.selected == (0, 1)
    stroke(posed, places[1], shift=True)
    assert posed.posing.selected == (0,)
    stroke(posed, places[1], shift=True)
    depths = [posed.posing.spot(h).depth for h in range(3)]
    stroke(posed, places[0], places[0] + (24, 12))
    now = posed.view.canvas_from_image(posed.posing.positions())
    np.testing.assert_allclose(now - places, [[24, 12], [24, 12], [0, 0]], atol=PIXEL)
    np.testing.assert_allclose([posed.posing.spot(h).depth for h in range(3)], depths)
    assert posed.posing.selected == (1, 0)
    stroke(posed, now[0])
    assert posed.posing.selected == (0,)
    assert labels(posed)[:2] == ["Drag 2 points", "Add handle"]


def test_a_box_selects_and_delete_removes_all_in_one_step(posed: Editor) -> None:
    _three(posed)
    stroke(posed, at(posed, 40, 20), at(posed, 100, 40), at(posed, 135, 75))
    assert posed.posing.selected == (0, 1)
    run(posed, "remove_handle")
    assert posed.object is not None and len(posed.object.handles) == 1
    assert posed.posing.selected == ()
    posed.undo()
    run(posed, "select_handles")
    assert posed.posing.selected == (0, 1, 2)
    posed.posing.nudge(1, 0)
    posed.escape()
    assert posed.posing.selected == ()
    assert labels(posed)[0] == "Nudge point"


def test_an_aborted_new_handle_is_not_selected(posed: Editor) -> None:
    press(posed, TOOL, at(posed, 90, 60))
    posed.escape()
    assert posed.posing.handle is None


def test_numbers_move_turn_and_soften_one_step_each(posed: Editor) -> None:
    stroke(posed, at(posed, 90, 60))
    numbers = posed.handle_numbers.read()
    assert numbers is not None
    posed.handle_numbers.move(numbers.x + 5, numbers.y - 3, 0.1)
    posed.posing.finish("X of handle")
    posed.handle_numbers.turn(25.0)
    posed.posing.finish("Turn of handle")
    posed.handle_numbers.soften(0.5)
    posed.posing.finish("Softness of handle")
    posed.handle_numbers.set_pin(True)
    now = posed.handle_numbers.read()
    assert now is not None
    shown = (now.x, now.y, now.depth, now.turn, now.softness)
    expected = (numbers.x + 5, numbers.y - 3, 0.1, 25.0, 0.5)
    np.testing.assert_allclose(shown, expected, atol=1e-6)
    assert now.is_pin and not now.is_free
    run(posed, "reset_handle")
    back = posed.handle_numbers.read()
    assert back is not None and not back.is_free and back.turn == pytest.approx(0)
    np.testing.assert_allclose((back.x, back.y), numbers.rest, atol=1e-6)
    assert len(labels(posed)) == 6


def test_symmetry_moves_the_mirrored_point_the_mirrored_way(posed: Editor) -> None:
    run(posed, "mirror")
    plane = posed.posing.mirroring.plane
    assert plane is not None and np.isfinite(plane.gap)
    assert posed.document is not None
    across = posed.cache.facts.turn_of(posed.document, 0) @ plane.normal
    assert abs(across[2]) < 0.75  # it does not part the front from the back
    start = at(posed, 74, 60)
    stroke(posed, start, start + (-20, -8))
    assert posed.object is not None
    first, second = posed.object.handles
    np.testing.assert_allclose(
        plane.mirrored_vector(first.target - first.point), second.target - second.point, atol=1e-9
    )
    assert np.linalg.norm(plane.mirrored(first.point) - second.point) < 0.05
    stroke(posed, start + (-20, -8), start + (-30, -8))
    assert len(posed.object.handles) == 2
    assert labels(posed) == ["Drag point", "Drag point"]


def test_influence_is_one_at_the_handle_and_less_elsewhere(posed: Editor) -> None:
    stroke(posed, at(posed, 90, 60))
    assert posed.document is not None and posed.object is not None
    shares = posed.cache.facts.influence(posed.document, 0, 0)
    own = posed.object.handles[0].control_point
    assert shares[own] > 0.9
    assert shares.min() < 0.05
    anchors = posed.derived.shape(posed.document.photo, posed.object).puppet.deformer.anchors(
        posed.object.handles
    )
    np.testing.assert_allclose(shares[anchors], 0, atol=1e-9)


def _shown(editor: Editor) -> np.ndarray:
    """Image px (M, 2) of the control points."""
    assert editor.document is not None
    return editor.derived.control_points(editor.document, editor.current)


def test_nothing_moves_but_what_is_dragged(posed: Editor) -> None:
    run(posed, "mirror")  # the partner of a new handle holds what is there, too
    head = at(posed, 80, 45)
    stroke(posed, head, head + (60, -30))
    run(posed, "mirror")
    before = _shown(posed)
    stroke(posed, at(posed, 95, 95))
    stroke(posed, at(posed, 75, 80), alt=True)
    assert posed.object is not None and posed.object.handles[-1].is_pin
    posed.handle_numbers.soften(0.7)
    posed.posing.finish("Softness of handle")
    posed.handle_numbers.set_free(True)
    posed.posing.remove(0)
    assert len(posed.object.base.anchors) > 0 if posed.object.base.anchors is not None else False
    for stays in Stays:
        posed.posing.set_stays(stays)
        assert np.abs(_shown(posed) - before).max() == 0
        for h in range(len(posed.object.handles)):  # a drag begins with what is seen
            place = posed.view.canvas_from_image(posed.posing.spot(h).xy)
            press(posed, TOOL, place)
            move(posed, place + (4, 0), place)
            assert np.abs(_shown(posed) - before).max() < 0.05
            posed.escape()


def test_a_drag_or_a_turn_that_comes_back_is_none(posed: Editor) -> None:
    """Solved for again, an object that only its handle holds would be turned otherwise."""
    x, y = CENTRE
    posed.posing.set_stays(Stays.NOTHING)
    stroke(posed, at(posed, x - 20, y), at(posed, x + 30, y - 25))
    place, before = posed.view.canvas_from_image(posed.posing.positions()[0]), posed.committed
    stroke(posed, place, place + 40, place + (60, -30), place)
    assert posed.committed is before and posed.posing.selected == (0,)
    stroke(posed, place, place + (60, -30), place + (9, 60), place + (60, -30), place, ctrl=True)
    assert posed.committed is before
    old = _shown(posed)
    new = at(posed, x + 50, y - 10)
    stroke(posed, new, new + 30, new)  # a new one is there, and has moved nothing
    assert posed.object is not None and len(posed.object.handles) == 2
    np.testing.assert_allclose(_shown(posed), old, atol=0.05)


def test_p_pins_what_is_under_the_pointer_and_a_handle_that_is(posed: Editor) -> None:
    run(posed, "pin")
    assert posed.message is not None, "where to point"
    place = at(posed, 90, 60)
    TOOL.hover(posed, Pointer(*place))
    posed.pointer = Pointer(*place)
    run(posed, "pin")
    assert posed.message is None
    assert posed.object is not None and posed.object.handles[0].is_pin
    TOOL.hover(posed, Pointer(*place))
    run(posed, "pin")
    assert not posed.object.handles[0].is_pin
    assert labels(posed) == ["Make it a handle", "Add pin"]


def test_symmetry_is_of_one_object_of_one_photo(posed: Editor, ball: Document) -> None:
    run(posed, "mirror")
    assert posed.posing.mirroring.is_on
    posed.objects.start_another()
    assert not posed.posing.mirroring.is_on
    posed.objects.choose(0)
    assert posed.posing.mirroring.is_on
    posed.start(ball)
    assert not posed.posing.mirroring.is_on


def test_symmetry_stays_on_while_the_outline_is_painted_and_in_its_tab(
    posed: Editor, ball: Document
) -> None:
    mirroring, mask, tab = posed.posing.mirroring, ball.objects[0].mask, posed.tab
    assert mask is not None
    run(posed, "mirror")
    painted = edits.change_mask(ball, 0, mask | np.roll(mask, 1, axis=1))
    posed.masking.take("Paint selection", painted, 0)
    assert posed.is_lifted and posed.mask is not mask and mirroring.is_on
    posed.undo()
    assert mirroring.is_on
    posed.tabs.open(ball)
    assert not mirroring.is_on
    posed.tabs.go(tab)
    wait_until(posed, lambda: posed.tab is tab)
    assert mirroring.is_on
    run(posed, "mirror")
    assert not mirroring.is_on
    close_all(posed)
