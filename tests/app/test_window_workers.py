"""Workers in the real window: named in Preferences, their licences in the list of models."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from hands import Hands, opened
from objectmorpher_core.lift.workers import file as worker_file

WORKER = """
command = ["{python}", "-c", "raise SystemExit(9)"]
licence = "Terms of Use"
licence_kind = "non-commercial"
page = "https://example.org/terms"
"""
FREE = 'command = ["{python}", "-c", "raise SystemExit(9)"]\nlicence = "MIT"\n'
BOX = "I have read and accept the Terms of Use"
PICTURES = os.environ.get("OBJECTMORPHER_PICTURES")  # a folder to look at what was seen
pytestmark = [pytest.mark.window, pytest.mark.slow]


@pytest.fixture
def workers(tmp_path: Path) -> Path:
    folder = tmp_path / "workers"
    folder.mkdir()
    (folder / "asking.toml").write_text(WORKER, "utf-8")
    (folder / "free.toml").write_text(FREE, "utf-8")
    return folder


@pytest.fixture
def hands(without_networks: dict[str, str], photo_path: Path, workers: Path) -> Iterator[Hands]:
    with opened(without_networks | {worker_file.FOLDER: str(workers)}, photo_path) as hands:
        yield hands


def show(hands: Hands, name: str) -> None:
    picture = hands.settle()
    if PICTURES:
        Image.fromarray(picture).save(Path(PICTURES) / f"{name}.png")


def test_a_worker_is_named_in_preferences_and_chosen(
    hands: Hands, window_environment: dict[str, str]
) -> None:
    settings = Path(window_environment["OBJECTMORPHER_SETTINGS"])
    hands.press("ctrl+comma")
    hands.choose("lift")
    hands.wait(lambda: {"lift: free", "lift: asking"} <= set(hands.places()), "naming workers")
    show(hands, "preferences-workers")
    hands.choose("lift: asking")  # greyed: its licence is not accepted
    hands.choose("lift: free")
    hands.wait(lambda: "lift: free" not in hands.places(), "choosing")
    show(hands, "preferences-chosen")
    hands.press("Escape")
    hands.press("ctrl+q")
    hands.wait(lambda: 'lift = "free"' in settings.read_text("utf-8"), "keeping the choice")


def test_a_licence_is_accepted_by_its_box_and_the_worker_lifts(hands: Hands, workers: Path) -> None:
    hands.choose("Menu: Window")
    hands.choose("Models…")
    hands.wait(lambda: "Download" in hands.places(), "listing the models")
    x0, y0, x1, _ = hands.area("Close")
    hands.xdotool("mousemove", round((x0 + x1) / 2) - 150, round(y0) - 200)
    hands.xdotool("click", "--repeat", 80, "--delay", 20, 5)  # to the list's end
    hands.wait(lambda: BOX in hands.places(), "showing the licence")
    show(hands, "models-workers")
    assert not (workers / worker_file.ACCEPTED).exists()
    hands.choose(BOX)
    hands.wait((workers / worker_file.ACCEPTED).exists, "accepting")
    show(hands, "models-accepted")
