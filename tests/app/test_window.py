"""The real window under Xvfb: a few frames of it, and the whole job by mouse and keyboard."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import CENTRE, HEIGHT, WIDTH
from hands import PATIENCE, ROOT, Hands, opened
from tests.tree import quick

pytestmark = pytest.mark.window

CANVAS = (48, 32, 1440 - 48 - 300, 900 - 32 - 28)  # x, y, width, height
PRIMARY = (1160, 839)  # in the primary button, left of its label
POSE_TOOL = (10, 132)  # in the Pose tool's button, beside its icon


def run_app(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "objectmorpher", *arguments]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=PATIENCE, cwd=ROOT
    )


@pytest.mark.parametrize(("theme", "is_broken"), quick([("dark", True), ("light", False)], 1))
def test_the_start_screen_is_drawn_and_stays_where_a_photo_is_broken(
    window_environment: dict[str, str], tmp_path: Path, theme: str, is_broken: bool
) -> None:
    broken, shot = tmp_path / "broken.jpg", tmp_path / "shot.png"
    broken.write_bytes(b"not a photo")
    arguments = ("--frames", "5", "--screenshot", str(shot), "--theme", theme)
    result = run_app(window_environment, *[str(broken)] * is_broken, *arguments)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    pixels = np.asarray(Image.open(shot))
    assert pixels.shape == (900, 1440, 3)
    surround = (30, 31, 34) if theme == "dark" else (217, 218, 220)
    assert tuple(pixels[850, 700]) == surround
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1000  # the thumbnails
    status = pixels[875:, 10:400].astype(int)
    red = (status[..., 0] - status[..., 2] > 80).sum()
    assert (red > 50) == is_broken  # the sentence, in the colour of errors


@pytest.mark.parametrize("renderer", quick(["gl", "tiles"], 1))
def test_the_photo_is_shown_as_it_is(
    without_networks: dict[str, str], photo_path: Path, tmp_path: Path, renderer: str
) -> None:
    shot = tmp_path / "shot.png"
    arguments = ("--frames", "5", "--screenshot", str(shot), "--renderer", renderer)
    result = run_app(without_networks, str(photo_path), *arguments)
    assert result.returncode == 0, result.stderr
    pixels, photo = np.asarray(Image.open(shot)), np.asarray(Image.open(photo_path))
    for x, y in ((20, 20), (90, 70), (150, 120)):
        left, top = screen_xy(x + 0.5, y + 0.5)  # at 4x and more single pixels are shown
        np.testing.assert_array_equal(pixels[round(top), round(left)], photo[y, x])


def screen_xy(x: float, y: float) -> tuple[float, float]:
    """Where image px are on the screen while the photo is fitted."""
    left, top, width, height = CANVAS
    zoom = min((width - 48) / WIDTH, (height - 48) / HEIGHT, 4.0)
    return (
        left + width / 2 + (x - WIDTH / 2) * zoom,
        top + height / 2 + (y - HEIGHT / 2) * zoom,
    )


def is_red(hands: Hands, x: float, y: float) -> bool:
    """Whether the canvas shows the ball at image px."""
    left, top = screen_xy(x, y)
    red, green, _ = hands.picture()[round(top), round(left), :3].astype(int)
    return bool(red > green + 30)


@pytest.fixture
def hands(window_environment: dict[str, str], photo_path: Path) -> Iterator[Hands]:
    """On a window that shows the made photo."""
    with opened(window_environment, photo_path) as hands:
        yield hands


@pytest.mark.slow
def test_the_whole_job_by_hand(hands: Hands, photo_path: Path, tmp_path: Path) -> None:
    x, y = CENTRE
    hands.click(*screen_xy(x, y))
    hands.wait(lambda: hands.is_accent(PRIMARY), "selecting")
    hands.click(*PRIMARY)
    hands.wait(lambda: hands.is_accent(POSE_TOOL), "lifting")
    hands.wait(lambda: not hands.is_accent(PRIMARY), "asking for a drag")
    assert not is_red(hands, x + 30, y - 34)  # the wall, right above the ball
    hands.drag(screen_xy(x, y - 30), screen_xy(x + 36, y - 40))
    hands.wait(lambda: hands.is_accent(PRIMARY), "dragging")
    hands.wait(lambda: is_red(hands, x + 30, y - 34), "following")  # the ball, near the handle

    exported, session = tmp_path / "edited.png", tmp_path / "ball.omorph"
    hands.press("ctrl+e")
    hands.fill_in(exported)
    hands.wait(exported.exists, "exporting")
    difference = np.asarray(Image.open(exported)) != np.asarray(Image.open(photo_path))
    assert difference.any()
    hands.press("ctrl+s")
    hands.fill_in(session)
    hands.wait(lambda: "ball.omorph · " in hands.title(), "saving")

    hands.press("ctrl+z")
    hands.wait(lambda: "edited" in hands.title(), "undoing")
    hands.wait(lambda: not hands.is_accent(PRIMARY), "asking for a drag again")
    hands.press("ctrl+shift+z")
    hands.wait(lambda: "edited" not in hands.title(), "redoing")
    hands.press("ctrl+w")
    hands.wait(lambda: hands.title() == "ObjectMorpher", "closing the photo")
    hands.press("ctrl+o")
    hands.fill_in(session)
    hands.wait(lambda: "ball.omorph · " in hands.title(), "reopening")
    hands.wait(lambda: hands.is_accent(PRIMARY), "showing the session")


@pytest.mark.slow
def test_closing_asks_about_unsaved_changes(
    without_networks: dict[str, str], photo_path: Path
) -> None:
    """The whole job closes a photo by ctrl+w that nothing has changed."""
    with opened(without_networks, photo_path) as hands:
        hands.click(*screen_xy(*CENTRE))
        hands.wait(lambda: "edited" in hands.title(), "selecting")
        for keys in ("ctrl+w", "ctrl+q"):
            hands.press(keys)
            time.sleep(0.4)
            assert "edited" in hands.title()  # the question is there instead
            hands.press("Escape")
            time.sleep(0.3)
        hands.press("ctrl+z")
        hands.wait(lambda: "edited" not in hands.title(), "undoing")
        hands.press("ctrl+q")
        hands.wait(lambda: hands.title() == "", "closing")


def test_without_a_screen_there_is_one_sentence(window_environment: dict[str, str]) -> None:
    environment = window_environment | {"DISPLAY": ":9999"}
    command = [sys.executable, "-m", "objectmorpher"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("objectmorpher: no window can be opened: ")
    assert done.stderr.count("\n") == 1
