"""Several objects by hand, in the real window under Xvfb: their order, and which one is meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from editor_steps import CENTRE, HEIGHT, WIDTH
from hands import ACCENT, Hands, opened
from objectmorpher.editor.editor import Editor
from objectmorpher_core.document import edits, hold_edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import decode_session, save_session

pytestmark = [pytest.mark.window, pytest.mark.slow]

CANVAS = (48, 32, 1440 - 48 - 300, 900 - 32 - 28)  # x, y, width, height
PLACE_TOOL = (10, 176)  # in the Place tool's button, beside its icon
FIRST, TO = np.array([(75.0, 100.0), (60.0, 110.0)])  # image px, on the ball


def rows(hands: Hands) -> list[str]:
    """The objects' names, from the top of the list."""
    places = {k: v for k, v in hands.places().items() if k.startswith("row of ")}
    return [k.removeprefix("row of ") for k in sorted(places, key=lambda k: places[k][1])]


def take_up(hands: Hands, row: str, target: str) -> None:
    """Drags a row over another one's upper edge, and does not let go."""
    x, y = hands.place(f"row of {row}")
    top = hands.places()[f"row of {target}"][1]
    hands.xdotool("mousemove", round(x), round(y))
    hands.xdotool("mousedown", 1)
    for share in (0.3, 0.6, 1.0):
        hands.xdotool("mousemove", round(x), round(y + share * (top - y)))


def has_line(hands: Hands) -> bool:
    """Whether an accent line is in the list, from one side of it to the other."""
    picture = hands.picture()[60:260, 1160:1400, :3]
    return bool((picture == ACCENT).all(2).all(1).any())


def test_order_by_dragging_rows_and_choosing_where_it_is_seen(
    without_networks: dict[str, str], editor: Editor, ball: Document, tmp_path: Path
) -> None:
    session = tmp_path / "balls.omorph"
    two = edits.duplicate(ball, 0)
    editor.start(ball)
    save_session(edits.set_placement(two, 1, Placement(move=(50.0, 0.0))), session)
    size, scale = (editor.view.width, editor.view.height), editor.view.scale
    editor.view.resize((CANVAS[2], CANVAS[3]), 1.0, editor.photo_size)
    start, end = editor.view.canvas_from_image(np.array([FIRST, TO])) + CANVAS[:2]
    editor.view.resize(size, scale, editor.photo_size)
    with opened(without_networks, session) as hands:
        hands.wait(lambda: rows(hands) == ["Object 1 copy", "Object 1"], "listing")
        hands.catch_up()
        take_up(hands, "Object 1", "Object 1 copy")
        hands.wait(lambda: has_line(hands), "showing where it lands")
        hands.press("Escape")
        hands.wait(lambda: not has_line(hands), "letting go of the row")
        hands.xdotool("mouseup", 1)
        hands.catch_up()
        assert rows(hands) == ["Object 1 copy", "Object 1"]
        assert "edited" not in hands.title()
        take_up(hands, "Object 1", "Object 1 copy")
        hands.xdotool("mouseup", 1)
        hands.wait(lambda: rows(hands) == ["Object 1", "Object 1 copy"], "changing the order")
        hands.press("ctrl+z")
        hands.wait(lambda: rows(hands) == ["Object 1 copy", "Object 1"], "going back")
        hands.choose("row of Object 1 copy")
        hands.press("4")
        hands.wait(lambda: hands.is_accent(PLACE_TOOL), "choosing the tool")
        hands.drag(tuple(start), tuple(end))
        hands.wait(lambda: "edited" in hands.title(), "moving")
        hands.press("ctrl+s")
        hands.wait(lambda: "edited" not in hands.title(), "saving")
    first, second = decode_session(session.read_bytes()).objects
    assert first.placement.move[0] < -5, "the one under the pointer was moved"
    assert second.placement.move == (50.0, 0.0)


def test_a_row_let_go_on_a_tab_is_copied_there_and_a_key_pose_hides_no_button(
    without_networks: dict[str, str], ball: Document, photo_path: Path, tmp_path: Path
) -> None:
    session = tmp_path / "balls.omorph"
    save_session(edits.duplicate(ball, 0), session)
    with opened(without_networks, session, str(photo_path)) as hands:
        hands.press("ctrl+t")
        hands.area("Tab: New tab")
        hands.choose("Tab: balls.omorph")
        hands.drag(hands.place("row of Object 1"), hands.place("Tab: New tab"))
        hands.settle()
        assert rows(hands) == ["Object 1 copy", "Object 1"] and "edited" not in hands.title()
        hands.drag(hands.place("row of Object 1"), hands.place("Tab: ball.png"))
        hands.wait(lambda: "ball.png — edited" in hands.title(), "copying into the tab")
        hands.settle()
        assert rows(hands) == ["Object 1"]
        hands.press("3")
        hands.xdotool("mousemove", 1300, 600)
        hands.xdotool("click", "--repeat", 20, 5)
        hands.settle()
        before = hands.area("Add key pose")
        hands.choose("Add key pose")
        hands.area("Go to key pose 1")
        hands.settle()
        assert hands.area("Add key pose") == before
        hands.xdotool("mousemove", *(round(v) for v in hands.place("Go to key pose 1")))
        assert hands.area("Tooltip")[2] <= hands.area("Add key pose")[0], "beside all buttons"


def test_a_locked_object_has_no_frame_to_take_hold_of(
    without_networks: dict[str, str], ball: Document, tmp_path: Path
) -> None:
    """Neither is there a hint how to change it; one that is free can be taken from beside it."""
    session, size = tmp_path / "balls.omorph", (WIDTH, HEIGHT)
    two = edits.set_placement(edits.duplicate(ball, 0), 1, Placement(move=(50.0, 0.0)))
    save_session(hold_edits.set_locked(two, 1, True), session)
    with opened(without_networks, session) as hands:
        hands.choose("row of Object 1 copy")
        hands.press("4")
        hands.area("Object 1 copy is locked")
        place = hands.on_photo(CENTRE[0] + 50.0, CENTRE[1], size)
        hands.xdotool("mousemove", *(round(v) for v in place))
        hands.nudge()
        assert "Object 1 copy is locked" in hands.places() and "Ring: yaw" not in hands.places()
        hands.drag(hands.on_photo(*FIRST, size), hands.on_photo(*TO, size))
        hands.area("Ring: yaw")  # of the other one
        assert "Object 1 copy is locked" not in hands.places()


def test_a_hidden_object_is_not_moved_unseen(
    without_networks: dict[str, str], ball: Document, tmp_path: Path
) -> None:
    session, size = tmp_path / "balls.omorph", (WIDTH, HEIGHT)
    two = edits.set_placement(edits.duplicate(ball, 0), 1, Placement(move=(50.0, 0.0)))
    save_session(edits.set_visible(two, 1, False), session)
    with opened(without_networks, session) as hands:
        hands.choose("row of Object 1 copy")
        hands.press("4")
        hands.catch_up()
        assert "Ring: yaw" not in hands.places() and "Right" not in hands.places()
        hands.area("Object 1 copy is hidden")
        hands.press("Right")
        there = hands.on_photo(CENTRE[0] + 60.0, CENTRE[1], size)
        hands.drag(there, hands.on_photo(CENTRE[0] + 70.0, CENTRE[1] - 20.0, size))
        hands.area("Show object")
        hands.settle()
        assert "edited" not in hands.title()
        hands.choose("Show object")
        hands.area("Ring: yaw")
        hands.area("Right")


def test_the_select_tool_marks_a_moved_object_where_it_is_seen(
    without_networks: dict[str, str], ball: Document, tmp_path: Path
) -> None:
    session, move = tmp_path / "balls.omorph", np.array((50.0, 0.0))
    two = edits.duplicate(ball, 0)
    save_session(edits.set_placement(two, 1, Placement(move=(50.0, 0.0))), session)
    with opened(without_networks, session) as hands:
        hands.place("row of Object 1 copy")
        hands.catch_up()
        hands.choose("row of Object 1")
        hands.press("1")
        hands.settle()
        at = np.array(hands.on_photo(*(CENTRE + move), (WIDTH, HEIGHT)))
        hands.xdotool("mousemove", *at.round().astype(int))
        x0, y0, x1, y1 = hands.area("Other: Object 1 copy")
        np.testing.assert_allclose(((x0 + x1) / 2, (y0 + y1) / 2), at, atol=24)
        hands.xdotool("mousemove", *map(round, hands.on_photo(5, 5, (WIDTH, HEIGHT))))
        hands.wait(lambda: "Other: Object 1 copy" not in hands.places(), "leaving it")
