"""The Pose tool in the real window: turning, choosing several, removing them."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from hands import Hands, opened
from objectmorpher_core.document.model import Document
from objectmorpher_core.session.file import decode_session, save_session
from test_window import is_red, screen_xy

pytestmark = [pytest.mark.window, pytest.mark.slow]


def _saved(hands: Hands, path: Path, name: str) -> Document:
    """What the window shows, as it saves it."""
    before = path.stat().st_mtime_ns
    hands.press("ctrl+s")
    hands.wait(lambda: path.stat().st_mtime_ns > before, f"saving {name}")
    hands.wait(lambda: "edited" not in hands.title(), f"having saved {name}")
    return decode_session(path.read_bytes())


def test_handles_are_turned_chosen_and_removed_by_hand(
    ball: Document, without_networks: dict[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "ball.omorph"
    save_session(ball, path)
    first, second = screen_xy(80, 60), screen_xy(102, 80)
    with opened(without_networks, path) as hands:
        hands.wait(lambda: is_red(hands, 90, 100), "showing the ball")
        hands.click(*first)
        hands.wait(lambda: "edited" in hands.title(), "adding a handle")
        hands.xdotool("keydown", "ctrl")
        hands.xdotool("mousemove", *map(round, second), "mousedown", 1)
        for angle in np.radians([0, 25, 50, 75, 75]):
            arm = 60 * np.array([np.cos(angle), np.sin(angle)])
            hands.xdotool("mousemove", *map(round, np.array(second) + arm))
            time.sleep(0.4)  # a frame between two of them, however slow
        hands.xdotool("mouseup", 1)
        hands.xdotool("keyup", "ctrl")
        (thing,) = _saved(hands, path, "a turn").objects
        assert len(thing.handles) == 2
        assert thing.handles[0].turn is None
        assert thing.handles[1].turn is not None
        assert np.degrees(np.linalg.norm(thing.handles[1].turn)) == pytest.approx(75, abs=15)
        hands.xdotool("keydown", "shift")
        hands.click(*first)
        hands.xdotool("keyup", "shift")
        hands.press("Delete")
        hands.wait(lambda: "edited" in hands.title(), "removing")
        assert _saved(hands, path, "nothing").objects[0].handles == ()
