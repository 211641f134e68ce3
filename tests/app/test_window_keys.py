"""Keys in the real window: Enter alone does what the large button names."""

from __future__ import annotations

from pathlib import Path

import pytest

from editor_steps import CENTRE
from hands import opened
from test_window import POSE_TOOL, PRIMARY, screen_xy

pytestmark = [pytest.mark.window, pytest.mark.slow]


def test_enter_takes_every_step_and_the_title_counts_what_changed(
    without_networks: dict[str, str], photo_path: Path
) -> None:
    with opened(without_networks, photo_path) as hands:
        x, y = screen_xy(*CENTRE)
        hands.xdotool("mousemove", round(x), round(y))

        def is_selected() -> bool:
            hands.press("Return")  # also before the candidate is there: then it does nothing
            return hands.is_accent(PRIMARY) or hands.is_accent(POSE_TOOL)

        hands.wait(is_selected, "selecting")
        hands.press("KP_Enter")  # harmless where the last Return has lifted it already
        hands.wait(lambda: hands.is_accent(POSE_TOOL), "lifting")
        hands.drag((x, y - 100), (x + 60, y - 120))
        hands.wait(lambda: "of the photo" in hands.title(), "counting")
        hands.press("Return")  # the large button exports; the same key must not confirm at once
        hands.area("Export ball-edited.png")
        hands.settle()
        assert "Export ball-edited.png" in hands.places()
        assert not list(photo_path.parent.glob("*-edited*"))
        hands.press("Return")
        hands.wait(lambda: bool(list(photo_path.parent.glob("*-edited.png"))), "exporting")
