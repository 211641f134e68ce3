"""Somebody opens the editor for the first time and does what it says: a photo is edited.

Where the system lets it be seen, nothing has been asked of a network meanwhile.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import first_use
from hands import ROOT, Hands, opened
from tests.faults import network
from tests.faults.tracer import missing

pytestmark = [pytest.mark.window, pytest.mark.slow, pytest.mark.usefixtures("networks")]

MOST = 12  # clicks and drags from the start screen to the exported photo
AROUND = (slice(100, 280), slice(290, 420))  # rows and columns of the photo around the nose
FAR = 120  # px of the photo's left that the edit leaves alone
COMPRESSED = 24  # of 255: what JPEG changes


class CountingHands(Hands):
    """Hands that count how often they press a button."""

    def __init__(self, environment: dict[str, str]) -> None:
        super().__init__(environment)
        self.presses = 0

    def xdotool(self, *arguments: object) -> str:
        self.presses += sum(word in ("click", "mousedown") for word in arguments)
        return super().xdotool(*arguments)


def test_following_what_the_window_says_edits_a_photo(
    window_environment: dict[str, str], tmp_path: Path
) -> None:
    settings = Path(window_environment["OBJECTMORPHER_SETTINGS"])
    settings.write_text(f'{settings.read_text()}export_folder = "{tmp_path}"\n')
    exported, out = tmp_path / "rocket-edited.jpg", tmp_path / "tried.jsonl"
    watched = () if missing() else network.watcher(out)
    with opened(window_environment, None, by=watched):
        hands = CountingHands(window_environment)
        for step in first_use.STEPS:
            hands.place(step.said)  # it waits until the window says so
            step.act(hands)
        hands.wait(exported.exists, "exporting")
        assert not watched or network.tried(out) == []
    assert hands.presses == len(first_use.STEPS) <= MOST
    before = np.asarray(Image.open(ROOT / "assets/samples" / first_use.SAMPLE).convert("RGB"))
    after = np.asarray(Image.open(exported).convert("RGB"))
    is_changed = (np.abs(before.astype(int) - after) > COMPRESSED).any(2)
    assert is_changed[AROUND].mean() > 0.1
    assert not is_changed[:, :FAR].any()
