"""The status line: a message leaves the tool's hint to be read, and gives way to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from hands import opened
from objectmorpher.editor.view import StatusMessage
from objectmorpher.gui.window.status import GLANCE, PER_CHARACTER, StatusReading

HINT = "Click an object, or drag a box around it"
SAID = StatusMessage("Saved ball.omorph in Pictures")
ENOUGH = GLANCE + PER_CHARACTER * len(SAID.text)


def test_a_message_is_over_once_there_was_time_to_read_it() -> None:
    reading = StatusReading()
    assert not reading.is_over(SAID, (5.0, 5.0), 100.0)
    assert not reading.is_over(SAID, (6.0, 5.0), 101.0)
    assert not reading.is_over(SAID, (9.0, 9.0), 101.0 + 0.99 * ENOUGH)
    assert reading.is_over(SAID, (9.0, 9.0), 101.0 + 1.01 * ENOUGH)


def test_a_message_waits_for_somebody_to_come_back() -> None:
    reading = StatusReading()
    for now in (0.0, ENOUGH, 3600.0):
        assert not reading.is_over(SAID, (5.0, 5.0), now), "nobody has moved"
    assert not reading.is_over(SAID, (6.0, 5.0), 3601.0)
    assert reading.is_over(SAID, (6.0, 5.0), 3601.0 + 1.01 * ENOUGH)


def test_another_message_begins_anew_and_none_is_never_over() -> None:
    reading = StatusReading()
    for x, now in enumerate((0.0, 1.0, 2.0 * ENOUGH)):
        reading.is_over(SAID, (float(x), 0.0), now)
    again = StatusMessage(SAID.text)
    assert not reading.is_over(again, (3.0, 0.0), 2.0 * ENOUGH)
    assert not reading.is_over(again, (4.0, 0.0), 2.1 * ENOUGH)
    assert not reading.is_over(None, (5.0, 0.0), 9.0 * ENOUGH)


@pytest.mark.slow
@pytest.mark.window
def test_the_hint_is_there_beside_a_message_and_alone_a_little_later(
    without_networks: dict[str, str], photo_path: Path
) -> None:
    with opened(without_networks, photo_path) as hands:
        hands.area("Photo")
        hands.xdotool("mousemove", 300, 300)
        x, _, _, _ = hands.area(HINT)
        hands.press("ctrl+z")
        hands.area("Nothing to undo")
        assert hands.area(HINT)[0] > hands.area("Nothing to undo")[2]
        hands.nudge()
        hands.wait(lambda: "Nothing to undo" not in hands.places(), "giving way")
        hands.wait(lambda: HINT in hands.places(), "having the line")
        assert hands.area(HINT)[0] == x
