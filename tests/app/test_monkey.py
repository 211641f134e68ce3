"""A monkey at the window for a while: `make monkey` lets it play for longer."""

from __future__ import annotations

from pathlib import Path

import pytest

from hands import x_display
from monkey import SCREEN, prepared, rounds

pytestmark = pytest.mark.window

EVENTS = 200


@pytest.mark.slow
def test_random_events_break_nothing(compiled: None, tmp_path: Path) -> None:
    """It always answers, saves a whole session, and undoing everything gives the first document."""
    with x_display(*SCREEN) as display:
        if display is None:
            pytest.skip("no free X display was found")
        environment, place = prepared(display, tmp_path)
        played = list(rounds(environment, place, tmp_path / "objectmorpher.log", 1, EVENTS))
    assert sum(told["events"] for told in played) == EVENTS
    assert played[-1]["entries"] > 5
