"""A user of the window: opens it, and has mouse, keyboard and eyes."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageGrab

ROOT = Path(__file__).parents[2]
ACCENT = (0x5A, 0xA9, 0xFF)
PATIENCE = 180.0  # s, of a machine that has much else to do
STILL = 0.4  # s without a change: nothing moves any more
CALM = 12  # looks without a job: what still changes then is a caret


class Hands:
    """Mouse, keyboard and eyes on the display."""

    def __init__(
        self, environment: dict[str, str], window: subprocess.Popen[bytes] | None = None
    ) -> None:
        """`window`: the program whose user this is; where it ends, waiting for it does."""
        self._environment, self._window = environment, window
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
        x0, y0, x1, y1 = self.area(label)
        return (x0 + x1) / 2, (y0 + y1) / 2

    def on_photo(self, x: float, y: float, size: tuple[int, int]) -> tuple[float, float]:
        """Where px of the photo, which is `size` px, are on the screen."""
        x0, y0, x1, y1 = self.area("Photo")
        return x0 + (x1 - x0) * x / size[0], y0 + (y1 - y0) * y / size[1]

    def area(self, label: str) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 px on the screen; waits until it is there."""
        self.wait(lambda: label in self.places(), f"showing {label}")
        return self.places()[label]

    def nudge(self) -> None:
        """Waits until the window has seen the pointer move, and so all that came before it."""
        x, y = self.pointer()
        for place in ((x + 1, y), (x, y)):
            self.xdotool("mousemove", *place)
            self.wait(lambda seen=(*place, *place): tuple(self.area("Pointer")) == seen, "pointing")

    def pointer(self) -> tuple[int, int]:
        """Where it is, px on the screen."""
        said = self.xdotool("getmouselocation", "--shell")
        x, y = re.findall(r"^[XY]=(\d+)", said, re.MULTILINE)
        return int(x), int(y)

    def settle(self) -> np.ndarray:
        """Waits until all is answered, no job runs and nothing but a caret moves; the picture."""
        self.nudge()
        before, end, calm = self.picture(), time.monotonic() + PATIENCE, 0
        while calm < CALM and time.monotonic() < end:
            time.sleep(STILL)
            after, is_busy = self.picture(), "Cancel the job" in self.places()
            if np.array_equal(before, after) and not is_busy:
                break
            before, calm = after, 0 if is_busy else calm + 1
        return before

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
            if self._window is not None and (code := self._window.poll()) is not None:
                if is_reached():
                    return
                pytest.fail(f"{what} did not happen; the program ended with {code}")
            if time.monotonic() > end:
                Image.fromarray(self.picture()).save(f"window-test-{what.replace(' ', '-')}.png")
                pytest.fail(f"{what} did not happen; a picture of the screen was saved")
            time.sleep(0.1)


@contextmanager
def opened(
    environment: dict[str, str], path: Path | None, *options: str, by: tuple[str, ...] = ()
) -> Iterator[Hands]:
    """Hands on a window that shows this photo or session; skips where nobody can type.

    `by`: what starts the program, if something stands before its command.
    """
    if shutil.which("xdotool") is None:
        pytest.skip("xdotool is not installed")
    command = [
        *by,
        sys.executable,
        "-m",
        "objectmorpher",
        *options,
        *([] if path is None else [str(path)]),
    ]
    title = "ObjectMorpher" if path is None else path.name
    with subprocess.Popen(command, env=environment, cwd=ROOT) as window:
        hands = Hands(environment, window)
        try:
            hands.wait(lambda: title in hands.title(), "opening")
            yield hands
        finally:
            window.kill()


@contextmanager
def x_display(width: int, height: int) -> Iterator[str | None]:
    """An X display of our own, or None where there is none to be had."""
    answer, told = os.pipe()
    # Without repeats (-r): a key that a busy machine releases late would be typed twice.
    command = ["Xvfb", "-displayfd", str(told), "-r", "-screen", "0", f"{width}x{height}x24"]
    command += ["-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, stderr=subprocess.DEVNULL, pass_fds=(told,))
    os.close(told)
    try:
        with os.fdopen(answer) as file:
            number = file.readline().strip()  # which it has found free, and taken
        yield f":{number}" if number else None
    finally:
        server.terminate()
        server.wait()


def window_environment(display: str, folder: Path, settings: str) -> dict[str, str]:
    """For a process with a window: its display, and settings and data of its own in `folder`."""
    path = folder / "settings.toml"
    path.write_text(f'dismissed = ["posing"]\n{settings}', encoding="utf-8")
    return {
        **os.environ,
        "DISPLAY": display,
        "OBJECTMORPHER_SETTINGS": str(path),
        "OBJECTMORPHER_DATA": str(folder / "data"),
        "OBJECTMORPHER_LANDMARKS": str(folder / "landmarks.json"),
        "PYTHONFAULTHANDLER": "1",
        "DBUS_SESSION_BUS_ADDRESS": "disabled:",  # else a daemon is started where there is none
    }
