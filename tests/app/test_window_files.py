"""The real window is killed, and the next one gives the work back."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from editor_steps import CENTRE
from hands import ROOT, Hands, opened
from test_window import screen_xy

pytestmark = [pytest.mark.window, pytest.mark.slow]

WARNING = (0xF2, 0xB8, 0x4B)
RECOVER = (924, 152)  # the button in the first row of the start screen, one recent file listed


def is_warning(hands: Hands) -> bool:
    """Whether the first row's sign is there."""
    sign = hands.picture()[140:164, 372:398, :3]
    return bool((sign == WARNING).all(-1).any())


def test_a_killed_window_gives_its_work_back(
    without_networks: dict[str, str], photo_path: Path, tmp_path: Path
) -> None:
    with opened(without_networks, photo_path) as hands:
        hands.click(*screen_xy(*CENTRE))
        hands.wait(lambda: "edited" in hands.title(), "selecting")
        kept = tmp_path / "data" / "recovery"
        hands.wait(lambda: bool(list(kept.glob("*/document.json"))), "keeping")
    command = [sys.executable, "-m", "objectmorpher"]
    with subprocess.Popen(command, env=without_networks, cwd=ROOT) as window:
        hands = Hands(without_networks)
        try:
            hands.wait(lambda: is_warning(hands), "offering")
            hands.click(*RECOVER)
            hands.wait(lambda: "ball.png — edited" in hands.title(), "recovering")
        finally:
            window.kill()
