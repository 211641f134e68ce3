"""Take from here by hand, in the real window under Xvfb."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hands import ACCENT, opened
from objectmorpher_core.document.model import Document
from objectmorpher_core.session.file import save_session

pytestmark = [pytest.mark.window, pytest.mark.slow]

SHOT = "HINTING_SHOT"  # a file that the window's picture is written to, to be looked at


def test_a_drag_over_the_background_says_from_where(
    without_networks: dict[str, str], ball: Document, tmp_path: Path
) -> None:
    session = tmp_path / "ball.omorph"
    save_session(ball, session)
    size, plate = ball.photo.size, ball.plate
    assert plate is not None
    x0, y0, x1, y1 = plate.box
    middle = (x0 + x1) / 2, (y0 + y1) / 2
    with opened(without_networks, session) as hands:
        hands.settle()
        hands.press("shift+b")
        hands.wait(lambda: "Clear fill sources" in hands.places(), "choosing the drag")
        start, end = (hands.on_photo(*place, size) for place in ((14, 16), middle))
        hands.drag(start, end)
        hands.wait(lambda: "edited" in hands.title(), "filling in")
        picture = hands.settle()
        if SHOT in os.environ:
            Image.fromarray(picture).save(os.environ[SHOT])
        (a, b), (c, d) = start, end
        way = [(a + s * (c - a), b + s * (d - b)) for s in np.linspace(0.4, 0.8, 20)]
        on, beside = (
            [
                picture[int(y) - 3 : int(y) + 4, int(x + dx) - 3 : int(x + dx) + 4, :3]
                for x, y in way
            ]
            for dx in (0, 40)
        )
        gaps = [
            np.median([np.abs(part.astype(int) - ACCENT).sum(-1).min() for part in parts])
            for parts in (on, beside)
        ]
        assert gaps[0] < 0.6 * gaps[1], "an arrow"
        hands.press("ctrl+z")
        hands.wait(lambda: "edited" not in hands.title(), "going back")
