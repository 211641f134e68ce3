"""Painting on the object by hand, in the real window under Xvfb."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import CENTRE
from hands import opened
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import save_session

pytestmark = [pytest.mark.window, pytest.mark.slow]

SHOT = "PAINTING_SHOT"  # a file that the window's picture is written to, to be looked at
AROUND = 6  # px of the screen about a place
FAR = 60  # levels, of one colour from another


def test_what_is_taken_from_the_wall_is_painted_on_the_turned_ball_and_erased(
    without_networks: dict[str, str], ball: Document, tmp_path: Path
) -> None:
    session = tmp_path / "ball.omorph"
    turned = edits.set_placement(ball, 0, Placement(turn=(30.0, 0.0, 0.0)))
    save_session(turned, session)
    size = ball.photo.size
    with opened(without_networks, session) as hands:

        def colour(at: tuple[float, float]) -> np.ndarray:
            x, y = (round(v) for v in at)
            part = hands.settle()[y - AROUND : y + AROUND, x - AROUND : x + AROUND, :3]
            return np.median(part.reshape(-1, 3), axis=0)

        def away(start: tuple[float, float]) -> tuple[float, float]:
            return start[0] + 60, start[1] + 20

        hands.settle()
        middle = hands.on_photo(*CENTRE, size)
        wall = hands.on_photo(16, 16, size)
        hands.xdotool("mousemove", *wall)  # another test may have left it on the ball
        red, grey = colour(middle), colour(wall)
        assert np.abs(red - grey).max() > FAR
        hands.press("shift+p")
        hands.wait(lambda: "Clone" in hands.places(), "choosing the brush")
        hands.xdotool("mousemove", *wall, "keydown", "ctrl", "click", 1, "keyup", "ctrl")
        hands.drag(middle, away(middle))
        hands.wait(lambda: "edited" in hands.title(), "painting")
        hands.xdotool("mousemove", *wall)
        assert np.abs(colour(middle) - grey).max() < FAR / 2
        if SHOT in os.environ:
            Image.fromarray(hands.settle()).save(os.environ[SHOT])
        for _ in range(2):  # the brush covers what it painted
            hands.press("bracketright")
        hands.xdotool("keydown", "alt")
        hands.drag(middle, away(middle))
        hands.xdotool("keyup", "alt")
        hands.xdotool("mousemove", *wall)
        hands.wait(lambda: np.abs(colour(middle) - red).max() < FAR / 2, "erasing")
        hands.press("ctrl+z")
        hands.wait(lambda: np.abs(colour(middle) - grey).max() < FAR / 2, "going back")
