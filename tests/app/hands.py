"""A user of the window: opens it, and has mouse, keyboard and eyes."""

from __future__ import annotations

import json
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
        self._landmarks = Path(environment["OBJECTMORPHER_LANDMARKS"])

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

    @contextmanager
    def script(self) -> Iterator[Callable[[str], None]]:
        """Writes lines to one xdotool, which does them one after the other."""
        command = ["xdotool", "-"]
        with subprocess.Popen(
            command, env=self._environment, stdin=subprocess.PIPE, text=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ) as process:  # fmt: skip
            assert process.stdin is not None
            stdin = process.stdin

            def write(line: str) -> None:
                stdin.write(line + "\n")
                stdin.flush()

            yield write
            stdin.close()

    def places(self) -> dict[str, tuple[float, float, float, float]]:
        """x0, y0, x1, y1 px on the screen of all that has a label."""
        if not self._landmarks.exists():
            return {}
        return json.loads(self._landmarks.read_text(encoding="utf-8"))

    def place(self, label: str) -> tuple[float, float]:
        """The middle of the button or field that says `label`; waits until there is one."""
        self.wait(lambda: label in self.places(), f"showing {label}")
        x0, y0, x1, y1 = self.places()[label]
        return (x0 + x1) / 2, (y0 + y1) / 2

    def catch_up(self) -> None:
        """Waits until the window has answered everything: it opens and closes its help."""
        end = time.monotonic() + PATIENCE
        while "Reset all" not in self.places() and time.monotonic() < end:
            self.press("Escape")
            self.press("F1")
            self._wait_a_moment(lambda: "Reset all" in self.places())
        self.press("Escape")
        self.wait(lambda: "Reset all" not in self.places(), "closing the help")

    def _wait_a_moment(self, is_reached: Callable[[], bool]) -> None:
        end = time.monotonic() + 3.0
        while not is_reached() and time.monotonic() < end:
            time.sleep(0.05)

    def choose(self, label: str) -> None:
        """Clicks the button that says `label`."""
        self.click(*self.place(label))

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
