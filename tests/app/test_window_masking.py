"""Painting in the real window: what is painted comes out of the veil."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from PIL import Image

from editor_steps import CENTRE
from hands import Hands, opened
from objectmorpher_core import segment
from test_window import PRIMARY, screen_xy

pytestmark = [pytest.mark.window, pytest.mark.slow]


def brightness(hands: Hands, x: float, y: float) -> float:
    left, top = screen_xy(x, y)
    return float(hands.picture()[round(top), round(left), :3].mean())


def test_a_stroke_by_hand_makes_the_selection_larger(
    window_environment: dict[str, str], photo_path: Path
) -> None:
    with opened(window_environment, photo_path) as hands:
        hands.area("Photo")
        hands.settle()  # the title says the photo's name before it is drawn
        before, far = brightness(hands, 30.5, 18.5), brightness(hands, 70.5, 18.5)
        hands.click(*screen_xy(*CENTRE))
        hands.wait(lambda: hands.is_accent(PRIMARY), "selecting")
        hands.wait(lambda: brightness(hands, 30.5, 18.5) < 0.8 * before, "veiling")
        if segment.load("dino").missing() is None:
            hands.wait(lambda: any("% sure" in text for text in hands.places()), "telling")
        hands.press("2")
        hands.xdotool("mousemove", *map(round, screen_xy(20, 18)))
        hands.xdotool("mousedown", 1)
        hands.wait(lambda: brightness(hands, 30.5, 18.5) > 0.95 * before, "putting it down")
        for x in (40, 55, 70):
            hands.xdotool("mousemove", *map(round, screen_xy(x, 18)))
        hands.wait(lambda: brightness(hands, 70.5, 18.5) > 0.95 * far, "painting")
        hands.xdotool("mouseup", 1)
        hands.press("ctrl+z")
        hands.wait(lambda: brightness(hands, 30.5, 18.5) < 0.7 * before, "undoing")


def test_nothing_below_a_control_jumps_while_the_selection_changes(
    window_environment: dict[str, str], photo_path: Path, tmp_path: Path
) -> None:
    """What cannot be switched just now is greyed out, and not taken away."""
    large = tmp_path / "large.png"  # what is looked for in it takes a moment
    with Image.open(photo_path) as photo:
        photo.resize((8 * photo.width, 8 * photo.height)).save(large)
    with opened(window_environment, large) as hands:
        hands.area("Photo")
        hands.settle()
        hands.click(*screen_xy(*CENTRE))
        hands.wait(lambda: hands.is_accent(PRIMARY), "selecting")
        hands.settle()
        assert "Keep in front" in hands.places()
        hands.xdotool("mousemove", *map(round, screen_xy(6, 6)))
        hands.xdotool("click", 3)
        seen, end = [], time.monotonic() + 1.5
        while time.monotonic() < end:
            seen.append("Keep in front" in hands.places())
            time.sleep(0.01)
        assert all(seen)
