"""The whole job by keyboard: no event of a mouse, and what has the keys is seen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import CENTRE, WIDTH
from hands import Hands, opened
from keyboard import Keys
from objectmorpher_core.document.model import Document
from objectmorpher_core.session.file import save_session
from test_window import POSE_TOOL, PRIMARY

pytestmark = [pytest.mark.window, pytest.mark.slow]

GONE = (20, -1.1)  # px of the photo that the handle is moved by


@pytest.fixture
def hands(without_networks: dict[str, str]) -> Iterator[Hands]:
    """On the start screen."""
    with opened(without_networks, None) as hands:
        yield hands


def test_the_whole_job_by_keyboard_alone(hands: Hands, photo_path: Path, tmp_path: Path) -> None:
    keys, (x, y) = Keys(hands), CENTRE
    keys.wait("Cat")
    keys.reach("Open a photo…")
    keys.press("Return")
    keys.wait("Cancel")
    keys.type(str(photo_path))
    keys.press("Return")
    keys.wait("Photo")

    keys.point(x, y)
    keys.press("Return")
    hands.wait(lambda: hands.is_accent(PRIMARY), "selecting")
    keys.press("Return")
    hands.wait(lambda: hands.is_accent(POSE_TOOL), "lifting")
    hands.wait(lambda: not hands.is_accent(PRIMARY), "asking for a drag")

    keys.point(x - 20, y + 10)
    keys.press("space")  # a second handle, which holds
    keys.wait("Handle 1")
    before = hands.places()
    keys.press("Escape")
    keys.settle(before)
    keys.point(x, y - 30)
    keys.press("space")
    keys.wait("Handle 2")
    before = hands.place("Handle 2")
    keys.press("shift+Right", "shift+Right", "Up", "alt+Up", "Prior")
    photo = hands.area("Photo")
    px = (photo[2] - photo[0]) / WIDTH
    hands.wait(
        lambda: np.allclose(
            np.subtract(hands.place("Handle 2"), before) / px, (20, -1.1), atol=0.3
        ),
        "moving the handle",
    )
    hands.wait(lambda: hands.is_accent(PRIMARY), "posing")

    keys.reach("Depth")
    picture = hands.picture()
    Image.fromarray(picture).save(tmp_path / "ring.png")
    x0, y0, x1, y1 = (round(v) for v in hands.area("Depth"))
    ring = picture[y0 - 6 : y1 + 6, x0 - 6 : x1 + 6].astype(int)
    inside = picture[y0 + 2 : y1 - 2, x0 + 2 : x1 - 2].astype(int)
    assert (ring.min(-1) > 200).sum() - (inside.min(-1) > 200).sum() > 2 * (x1 - x0)
    keys.press("Return", "ctrl+a")
    keys.type("0.2")
    keys.press("Return")

    keys.press("Escape", "6")
    keys.reach("Fill in again")
    keys.press("Return")
    keys.reach("Harmonise")
    keys.press("Return")
    keys.reach("Place")  # what harmonising can be set to

    keys.press("Escape", "F10")
    keys.reach("Menu: File", by="Left")
    keys.press("Escape", "Escape", "F6")
    hands.wait(lambda: keys.focus == "Tool: Select", "going to the next part of the window")
    keys.press("F1")
    keys.wait("Reset all")
    keys.press("Escape")
    hands.wait(lambda: "Reset all" not in hands.places(), "closing the help")
    keys.press("ctrl+e")
    exported = tmp_path / "edited.png"
    keys.wait("Cancel")
    for by, format, ending in (("Down", "JPEG", "jpg"), ("Up", "PNG", "png")):
        keys.reach("PNG" if format == "JPEG" else "JPEG")
        keys.press("Return")  # the list of formats unfolds
        keys.reach(format, by=by)
        keys.press("Return")  # it chooses, and does not export yet
        keys.wait(f"Export ball-edited.{ending}")
    assert not list(photo_path.parent.glob("*-edited*"))
    keys.reach("Name", by="shift+Tab")
    keys.press("ctrl+a")
    keys.type(str(exported))
    keys.press("Return")
    hands.wait(exported.exists, "exporting")
    changed = np.asarray(Image.open(exported)) != np.asarray(Image.open(photo_path))
    assert changed.any()


def test_a_list_that_is_unfolded_begins_at_what_is_chosen(
    without_networks: dict[str, str], ball: Document, tmp_path: Path
) -> None:
    save_session(ball, tmp_path / "ball.omorph")
    with opened(without_networks, tmp_path / "ball.omorph") as hands:
        keys = Keys(hands)
        keys.wait("Photo")
        keys.press("ctrl+e")
        keys.wait("Focus: Name")
        keys.reach("Photo")
        for name in ("Object cut-out", "Mask", "Depth"):
            keys.press("space")
            keys.wait("3D object")
            keys.press("Down")
            keys.wait(f"Focus: {name}")
            keys.press("Return")
            hands.wait(lambda: "3D object" not in hands.places(), "folding the list up")
            keys.wait(f"Focus: {name}")
