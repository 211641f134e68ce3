"""A user of the window: opens it, and has mouse, keyboard and eyes."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import PATIENCE
from PIL import Image, ImageGrab

ROOT = Path(__file__).parents[2]
ACCENT = (0x5A, 0xA9, 0xFF)


class Hands:
    """Mouse, keyboard and eyes on the display."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._environment = environment
        self._display = environment["DISPLAY"]

    def xdotool(self, *arguments: object) -> str:
        command = ["xdotool", *(str(a) for a in arguments)]
        result = subprocess.run(command, env=self._environment, capture_output=True, text=True)
        time.sleep(0.08)
        return result.stdout

    def click(self, x: float, y: float, button: int = 1) -> None:
        self.xdotool("mousemove", round(x), round(y))
        self.xdotool("click", button)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.xdotool("mousemove", round(start[0]), round(start[1]))
        self.xdotool("mousedown", 1)
        for share in (0.25, 0.5, 0.75, 1.0, 1.0):
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.xdotool("mousemove", round(x), round(y))
        self.xdotool("mouseup", 1)

    def press(self, keys: str) -> None:
        self.xdotool("key", keys)

    def fill_in(self, path: Path) -> None:
        """Types a path into the open dialog, in place of what it suggests."""
        time.sleep(0.5)
        self.press("ctrl+a")
        self.xdotool("type", "--delay", 5, path)
        self.press("Return")

    def picture(self) -> np.ndarray:
        return np.asarray(ImageGrab.grab(xdisplay=self._display))

    def is_accent(self, at: tuple[int, int]) -> bool:
        return tuple(int(v) for v in self.picture()[at[1], at[0], :3]) == ACCENT

    def title(self) -> str:
        names = self.xdotool("search", "--name", "ObjectMorpher", "getwindowname", "%@")
        return names.strip()

    def wait(self, is_reached: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not is_reached():
            if time.monotonic() > end:
                Image.fromarray(self.picture()).save(f"window-test-{what.replace(' ', '-')}.png")
                pytest.fail(f"{what} did not happen; a picture of the screen was saved")
            time.sleep(0.1)


@contextmanager
def opened(environment: dict[str, str], path: Path) -> Iterator[Hands]:
    """Hands on a window that shows this photo or session; skips where nobody can type."""
    if shutil.which("xdotool") is None:
        pytest.skip("xdotool is not installed")
    command = [sys.executable, "-m", "app", str(path)]
    with subprocess.Popen(command, env=environment, cwd=ROOT) as window:
        hands = Hands(environment)
        try:
            hands.wait(lambda: path.name in hands.title(), "opening")
            yield hands
        finally:
            window.kill()
