"""A monkey at the window: thousands of random events, and nothing breaks."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import CENTRE
from hands import ROOT, Hands
from objectmorpher_core.session.file import decode_session, encode_session

pytestmark = pytest.mark.window

SIZE = (1440, 900)
CANVAS = (48, 32, 1092, 840)  # x, y, width, height
EVENTS = 2000
KEYS = (
    "1", "2", "3", "4", "5", "6", "f", "x", "r", "Delete", "BackSpace", "Escape", "Left", "Right",
    "Up", "Down", "shift+Left", "shift+Down", "ctrl+z", "ctrl+z", "ctrl+shift+z", "ctrl+y",
    "ctrl+a", "ctrl+d", "ctrl+l", "ctrl+j", "ctrl+h", "ctrl+e", "ctrl+o", "ctrl+s", "ctrl+equal",
    "ctrl+minus", "ctrl+1", "backslash", "bracketleft", "bracketright", "shift+bracketleft",
    "ctrl+bracketleft", "ctrl+bracketright", "alt+1", "alt+2", "alt+3", "alt+4", "alt+5", "alt+6",
    "ctrl+shift+p", "ctrl+shift+a", "shift+Delete", "Tab", "Return", "space", "7", "minus",
)  # fmt: skip
HELD = ("shift", "ctrl", "alt", "space")
MENUS = (330, 32)  # px, of the menus: Quit is in there, and other keys for what ends the test


class Monkey:
    """Random events as lines for xdotool, about equally often on the canvas and beside it."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def events(self, count: int) -> Iterator[str]:
        acts = [self._move] * 3 + [self._click] * 5 + [self._drag] * 5
        acts += [self._wheel] + [self._key] * 6
        for _ in range(count):
            yield self._random.choice(acts)()

    def _place(self) -> tuple[int, int]:
        """On the canvas, mostly near its middle, or anywhere in the window."""
        pick = self._random
        if pick.random() < 0.6:
            x, y, width, height = CANVAS
            spread = pick.choice((0.1, 0.25, 0.5))
            return (
                round(x + width * min(max(pick.gauss(0.5, spread), 0), 1)),
                round(y + height * min(max(pick.gauss(0.5, spread), 0), 1)),
            )
        while True:
            at = pick.randrange(SIZE[0]), pick.randrange(SIZE[1])
            if at[0] >= MENUS[0] or at[1] >= MENUS[1]:
                return at

    def _move(self) -> str:
        return "mousemove {} {}".format(*self._place())

    def _click(self) -> str:
        button = self._random.choice((1, 1, 1, 1, 3, 2))
        times = self._random.choice((1, 1, 1, 2))
        return f"{self._move()}\n{self._with_key(f'click --repeat {times} --delay 20 {button}')}"

    def _drag(self) -> str:
        button = self._random.choice((1, 1, 1, 3, 2))
        moves = [self._move() for _ in range(self._random.randrange(1, 5))]
        end = "key Escape\n" if self._random.random() < 0.1 else ""
        steps = "\n".join(moves)
        stroke = f"mousedown {button}\n{steps}\n{end}mouseup {button}"
        return f"{self._move()}\n{self._with_key(stroke)}"

    def _wheel(self) -> str:
        button, times = self._random.choice((4, 5)), self._random.randrange(1, 4)
        return f"{self._move()}\nclick --repeat {times} --delay 5 {button}"

    def _key(self) -> str:
        return f"key {self._random.choice(KEYS)}"

    def _with_key(self, act: str) -> str:
        if self._random.random() < 0.75:
            return act
        held = self._random.choice(HELD)
        return f"keydown {held}\n{act}\nkeyup {held}"


def play(hands: Hands, seed: int, count: int) -> None:
    """Lets the monkey at the window; as fast as it takes the events."""
    with hands.script() as write:
        for event in Monkey(seed).events(count):
            write(event)
            write("sleep 0.012")
    hands.xdotool("keyup", "shift", "keyup", "ctrl", "keyup", "alt", "keyup", "space")


def check(hands: Hands, session: Path, log: Path) -> None:
    """The window still works: what it saves is whole, and its log holds no error."""
    for button in (1, 2, 3):
        hands.xdotool("mouseup", button)
    hands.catch_up()
    hands.press("ctrl+shift+s")
    hands.place("Cancel")
    hands.fill_in(session)
    hands.wait(session.exists, "saving after the monkey")
    data = session.read_bytes()
    assert encode_session(decode_session(data)) == data  # every array as it was saved
    errors = [line for line in log.read_text().splitlines() if " ERROR " in line]
    assert errors == []


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "count"), [(1, 150), (2, EVENTS)])
def test_random_events_break_nothing(
    window_environment: dict[str, str], photo_path: Path, tmp_path: Path, seed: int, count: int
) -> None:
    session, log = tmp_path / "monkey.omorph", tmp_path / "objectmorpher.log"
    command = [sys.executable, "-m", "objectmorpher", str(photo_path)]
    with subprocess.Popen(
        command, env=window_environment, cwd=ROOT, stderr=subprocess.PIPE, text=True
    ) as window:
        hands = Hands(window_environment)
        try:
            hands.wait(lambda: photo_path.name in hands.title(), "opening")
            _lift(hands)
            play(hands, seed, count)
            assert window.poll() is None, "the window is gone"
            check(hands, session, log)
        finally:
            window.kill()
        assert window.stderr is not None
        assert "Traceback" not in window.stderr.read()


def _lift(hands: Hands) -> None:
    """Something to play with."""
    from test_window import POSE_TOOL, PRIMARY, screen_xy

    hands.click(*screen_xy(*CENTRE))
    hands.wait(lambda: hands.is_accent(PRIMARY), "selecting")
    hands.click(*PRIMARY)
    hands.wait(lambda: hands.is_accent(POSE_TOOL), "lifting")
