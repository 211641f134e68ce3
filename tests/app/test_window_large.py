"""Texts of twice the size: what there is no room for is scrolled to, not cut off."""

from __future__ import annotations

from pathlib import Path

import pytest

import hands
from hands import Hands, opened
from keyboard import Keys
from objectmorpher_core.models import device

pytestmark = [pytest.mark.window, pytest.mark.slow]

SIZE = (1440, 900)  # px of the screen: 720 x 450 points


@pytest.fixture
def large(display: str, tmp_path: Path) -> dict[str, str]:
    settings = 'dialogs = "built-in"\nscale = 2.0\nmotion = "reduced"\n'
    environment = hands.window_environment(display, tmp_path, settings)
    # No network looks, and nobody for a GPU.
    return environment | {"OBJECTMORPHER_CACHE": str(tmp_path / "weights"), device.DEVICE: "cpu"}


def check_all_inside(user: Hands) -> None:
    """Whatever has a label is wholly in the window; as the panels scroll, only across."""
    for label, (x0, _, x1, _) in user.places().items():
        if label not in ("Pointer", "Photo"):
            assert 0 <= x0 <= x1 <= SIZE[0], label


def test_preferences_and_dialogs_are_reached_to_their_ends(
    large: dict[str, str], photo_path: Path
) -> None:
    with opened(large, photo_path) as user:
        user.area("Photo")
        check_all_inside(user)
        user.press("ctrl+comma")
        user.area("200 %")
        assert "Server" not in user.places()  # below the end of what is seen
        Keys(user).reach("Server")
        x0, y0, x1, y1 = user.area("Focus: Server")
        assert 0 <= x0 < x1 <= SIZE[0]
        assert 0 <= y0 < y1 <= SIZE[1]
        check_all_inside(user)
        user.press("Escape")
        user.press("ctrl+o")
        panel = (0x26, 0x28, 0x2C)
        user.area("Cancel")
        user.wait(lambda: tuple(user.picture()[450, 100, :3]) == panel, "showing the dialog")
        for row in (2, SIZE[1] - 3):  # its first and last rows are not at the screen's ends
            assert tuple(user.picture()[row, SIZE[0] // 2, :3]) != panel
