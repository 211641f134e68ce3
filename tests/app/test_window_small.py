"""The real window on a small screen: nothing lies outside it, and nothing covers the object."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from hands import Hands, opened, window_environment, x_display
from objectmorpher.editor.view import PoseMode
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.models import device
from objectmorpher_core.session.file import save_session

pytestmark = [pytest.mark.window, pytest.mark.slow]

SCREEN = (900, 600)
PANEL, REMOVE = "Panel (F8)", "Take out of the photo"


@contextmanager
def on_a_small_screen(document: Document, folder: Path) -> Iterator[Hands]:
    """In a window of the usual size; the card of posing is not dismissed."""
    path = folder / "ball.omorph"
    save_session(document, path)
    with x_display(*SCREEN) as display:
        if display is None:
            pytest.skip("no free X display was found")
        environment = window_environment(display, folder, "")
        # No network looks, and nobody for a GPU.
        environment |= {"OBJECTMORPHER_CACHE": str(folder / "weights"), device.DEVICE: "cpu"}
        settings = Path(environment["OBJECTMORPHER_SETTINGS"])
        settings.write_text('dialogs = "built-in"\n', encoding="utf-8")
        with opened(environment, path) as hands:
            hands.place("Photo")
            hands.catch_up()
            yield hands


def test_a_small_screen_holds_the_window(compiled: None, ball: Document, tmp_path: Path) -> None:
    """The panel is folded where it was unfolded: a second click there removes nothing."""
    with on_a_small_screen(ball, tmp_path) as hands:
        for x0, y0, x1, y1 in hands.places().values():
            assert 0 <= x0 <= x1 <= SCREEN[0] and 0 <= y0 <= y1 <= SCREEN[1]
        hands.choose(PANEL)
        hands.area(REMOVE)
        eye = hands.area("Hide or show the object")
        hands.wait(lambda: hands.area("Tooltip")[3] <= eye[1], "telling above the eye")
        hands.click(*hands.pointer())
        hands.wait(lambda: REMOVE not in hands.places(), "folding the panel")
        hands.catch_up()
        assert "edited" not in hands.title()
        hands.choose(PANEL)
        hands.area("row of Object 1")
        hands.press("3")
        assert unnamed_ways(hands) == []


def unnamed_ways(hands: Hands) -> list[str]:
    """The ways to pose below whose icons nothing is written."""
    places = [hands.area(mode.value) for mode in PoseMode]
    picture = hands.settle()
    found = []
    for mode, place in zip(PoseMode, places, strict=True):
        x0, y0, x1, y1 = map(round, place)
        below = picture[y0 + 3 * (y1 - y0) // 5 : y1 - 3, x0 + 3 : x1 - 3].mean(2)
        columns = np.abs(below - np.median(below)).max(0) > 40
        if columns.sum() < 10:  # px: less than two letters
            found.append(mode.value)
    return found


@pytest.mark.parametrize("down", [-20.0, 30.0])
def test_the_card_of_posing_lies_beside_the_object(
    compiled: None, ball: Document, tmp_path: Path, down: float
) -> None:
    """Below an object that is high in the photo, and above one that is low."""
    document = edits.set_placement(ball, 0, Placement(move=(0.0, down)))
    mask = document.objects[0].mask
    assert mask is not None
    rows = np.flatnonzero(mask.any(1)) + down
    with on_a_small_screen(document, tmp_path) as hands:
        _, y0, _, y1 = hands.area("Got it")
        middle = hands.on_photo(0.0, float(rows.mean()), document.photo.size)[1]
        assert (y0 > middle) == (down < 0)
        assert 0 <= y0 < y1 <= SCREEN[1]
