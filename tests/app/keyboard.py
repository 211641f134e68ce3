"""Only the keyboard of a user: what has the keys is seen, and each press before the next one."""

from __future__ import annotations

import time

import numpy as np
import pytest

from editor_steps import HEIGHT, WIDTH
from hands import Hands

SLOW, STAYS = 2.0, 0.15  # s that a busy machine may take; s without a change
MOST = 60  # presses until a control is reached
NEAR = 6.0  # px of the screen


class Keys:
    """Only the keyboard of a user."""

    def __init__(self, hands: Hands) -> None:
        self._hands = hands

    def press(self, *keys: str) -> None:
        self._hands.xdotool("key", "--delay", 15, *keys)

    def type(self, text: str) -> None:
        self._hands.xdotool("type", "--delay", 5, text)

    def wait(self, label: str) -> None:
        self._hands.area(label)

    @property
    def focus(self) -> str:
        """What has the keys, or "" for the photo."""
        shown = [label for label in self._hands.places() if label.startswith("Focus: ")]
        return shown[0].removeprefix("Focus: ") if shown else ""

    def reach(self, label: str, by: str = "Tab") -> None:
        """Presses one key until the ring is around the control that says `label`."""
        for _ in range(MOST):
            if self.focus == label:
                return
            before = self._hands.places()
            self.press(by)
            self.settle(before)
        pytest.fail(f"{label} was not reached; the ring is around {self.focus!r}")

    def settle(self, before: object) -> None:
        """Waits until something else is shown, and then until that stays."""
        end = time.monotonic() + SLOW
        while self._hands.places() == before and time.monotonic() < end:
            time.sleep(0.02)
        seen = None
        while (now := self._hands.places()) != seen and time.monotonic() < end:
            seen = now
            time.sleep(STAYS)

    def point(self, x: float, y: float) -> None:
        """Moves the crosshair to px of the photo."""
        before = self._hands.places()
        self.press("Right")
        self.settle(before)
        for pace, far in (("shift+", 64.0), ("", 8.0)):
            here = self._hands.place("Crosshair")
            there = self._hands.on_photo(x, y, (WIDTH, HEIGHT))
            for axis, (back, on) in enumerate((("Left", "Right"), ("Up", "Down"))):
                steps = round((there[axis] - here[axis]) / far)
                if steps:
                    before = self._hands.places()
                    self.press(*[pace + (on if steps > 0 else back)] * abs(steps))
                    self.settle(before)
        there = self._hands.on_photo(x, y, (WIDTH, HEIGHT))
        self._hands.wait(
            lambda: bool(np.hypot(*np.subtract(self._hands.place("Crosshair"), there)) < NEAR),
            "pointing by keys",
        )
