"""A monkey at the window: random events, what artists do clumsily among them.

`python tests/app/monkey.py [--events 20000] [--seed 1] [--report F.json]` (`make monkey`). It
draws, drags out of the window, clicks twice, lets Escape end a stroke, resizes the window, types
nonsense into whatever can be clicked, runs every menu entry, and closes photos and the program
while a job runs. After each few events the window must answer; after each round it must save a
whole session, and undoing everything must give the document that opening the photo gives.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from _pytest.outcomes import Failed

from hands import ROOT, Hands, window_environment, x_display

OFFLINE = "OBJECTMORPHER_OFFLINE"  # it is set: a download that is asked for fails, and says so

SCREEN = (1600, 1000)  # px; the window is smaller, so that one can drag out of it
USUAL = (1440, 900)
SIZES = (USUAL, USUAL, USUAL, (640, 480), (900, 1000), (1600, 700))
CANVAS = (0.03, 0.04, 0.76, 0.93)  # x, y, width, height, x the window's
ROUND = 500  # events, after which all is undone
BURST = 6  # events at most, before the window must have answered
PAUSE = "sleep 0.012"
STUCK = 2.0  # s of the window's own time without an answer
GONE = 120.0  # s of anybody's time
UNDO = 50  # steps at a time
KEYS = (
    "1", "2", "3", "4", "5", "6", "f", "x", "r", "Delete", "BackSpace", "Escape", "Left", "Right",
    "Up", "Down", "shift+Left", "shift+Down", "ctrl+z", "ctrl+z", "ctrl+shift+z", "ctrl+y",
    "ctrl+a", "ctrl+d", "ctrl+l", "ctrl+j", "ctrl+h", "ctrl+e", "ctrl+o", "ctrl+s", "ctrl+equal",
    "ctrl+minus", "ctrl+1", "backslash", "bracketleft", "bracketright", "shift+bracketleft",
    "ctrl+bracketleft", "ctrl+bracketright", "alt+1", "alt+2", "alt+3", "alt+4", "alt+5", "alt+6",
    "ctrl+shift+p", "ctrl+shift+a", "shift+Delete", "Tab", "Return", "space", "7", "minus", "b",
)  # fmt: skip
HELD = ("shift", "ctrl", "alt", "space")
NONSENSE = (
    "1e999", "-1e30", "nan", "-", "0.0.0", "99999999999999999999", "abc", "5,5", "%d%s", "-0",
    "1e-320", "x" * 300,
)  # fmt: skip
UPWARDS = "One folder up"  # leads out of the folder where everything may be overwritten
ASKED = "Don't save"
KEYS_PAGE, KEYS_BACK = "Keyboard and pointer…", "Reset all"


@dataclass
class Place:
    """The window's folder: as far from other people's files as its own dialogs can lead."""

    folder: Path
    photo: Path = field(init=False)

    def __post_init__(self) -> None:
        deep = self.folder.joinpath(*"abcdefgh")
        deep.mkdir(parents=True)
        self.photo = deep / "ball.png"

    def tidy(self) -> None:
        """Removes what was saved: a session that is opened again begins with another document."""
        for path in self.photo.parent.iterdir():
            if path != self.photo and path.is_file():
                path.unlink(missing_ok=True)


class Stuck(AssertionError):
    """The window answered nothing for too long."""


class Player:
    """The program and a user who knows no fear; the program is started again where it was quit."""

    def __init__(self, environment: dict[str, str], place: Place) -> None:
        self._environment, self._place = environment, place
        self.slowest = 0.0  # s of the window's own time until an answer
        self.starts = 0
        self._start()

    def _start(self) -> None:
        command = [sys.executable, "-m", "objectmorpher", str(self._place.photo)]
        self._noise = tempfile.TemporaryFile("w+")  # noqa: SIM115  closed by `close`
        self.process = subprocess.Popen(
            command, env=self._environment, cwd=ROOT, stderr=self._noise
        )
        self.hands = Hands(self._environment, self.process)
        self._typist: subprocess.Popen[str] | None = None
        self.starts += 1
        self.size = USUAL
        self.hands.wait(lambda: bool(self.hands.title()), "starting")
        self.hands.wait(lambda: bool(self.hands.places()), "starting")
        self.open_photo()

    def close(self) -> None:
        """Ends the program, if it has not ended, and checks what it said."""
        self._stop_typing()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self._noise.seek(0)
        said = self._noise.read()
        self._noise.close()
        assert "Traceback" not in said or OFFLINE in said, said[-2000:]

    def write(self, lines: str) -> None:
        """Lines for xdotool, which does them one after the other.

        It ends where a window is gone: another one does what comes later.
        """
        if self._typist is None or self._typist.poll() is not None:
            self._stop_typing()
            self._typist = subprocess.Popen(
                ["xdotool", "-"], env=self._environment, stdin=subprocess.PIPE, text=True,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        assert self._typist.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._typist.stdin.write(lines + "\n")
            self._typist.stdin.flush()

    def _stop_typing(self) -> None:
        if self._typist is not None:
            self._typist.kill()
            with contextlib.suppress(BrokenPipeError):
                self._typist.communicate()
            self._typist = None

    def answered(self) -> bool:
        """Waits until the window has seen all that was done; False where it was quit.

        Its own time counts: not what it waits for a processor that others use, nor the time until
        the screen's pointer is where the window is to see it.
        """
        here = tuple(self.hands.places().get("Pointer", ())[:2])
        right, low = self.size[0] - 3, self.size[1] - 3
        x, y = (right, low) if here != (right, low) else (right - 1, low)
        self.write(f"mousemove {x} {y}")
        start, before = time.monotonic(), _waits(self.process.pid)
        asked = start  # when the window could answer
        there = False
        while self.hands.places().get("Pointer", ())[:2] != [x, y]:
            if self.process.poll() is not None:
                assert self.process.returncode == 0, f"it ended with {self.process.returncode}"
                return False
            if self._typist is None or self._typist.poll() is not None:
                self.write(f"mousemove {x} {y}")
            taken = time.monotonic() - start
            own = time.monotonic() - asked - self._waited_since(before)
            if own > STUCK and not there:
                there = self.hands.pointer() == (x, y)
                asked, before = time.monotonic(), _waits(self.process.pid)
            elif own > STUCK or taken > GONE:
                raise Stuck(f"no answer for {taken:.1f} s, {own:.1f} s of them its own")
            time.sleep(0.004)
        taken = time.monotonic() - asked
        self.slowest = max(self.slowest, taken - self._waited_since(before))
        return True

    def _waited_since(self, before: dict[int, float]) -> float:
        """s that threads which still run have waited for a processor."""
        now = _waits(self.process.pid)
        return sum(waited - before.get(thread, 0.0) for thread, waited in now.items())

    def again(self) -> None:
        """Starts the program after it was quit."""
        self.close()
        self._start()

    def open_photo(self) -> None:
        """The photo is open, and no dialog."""
        self.calm()
        if self._place.photo.name in self.hands.title():
            return
        self.hands.press("ctrl+o")
        self.hands.wait(lambda: UPWARDS in self.hands.places(), "asking for a photo")
        self.hands.fill_in(self._place.photo)
        self.hands.wait(
            lambda: ASKED in self.hands.places() or self._place.photo.name in self.hands.title(),
            "opening the photo",
        )
        if ASKED in self.hands.places():
            self.hands.choose(ASKED)
        self.hands.wait(lambda: self._place.photo.name in self.hands.title(), "opening the photo")

    def calm(self) -> None:
        """Nothing is held, no dialog is open, and the window has its usual size."""
        self.answered()
        for button in (1, 2, 3):
            self.hands.xdotool("mouseup", button)
        self.hands.xdotool("keyup", "shift", "keyup", "ctrl", "keyup", "alt", "keyup", "space")
        self.resize(USUAL)
        self._use_the_usual_keys()

    def _use_the_usual_keys(self) -> None:
        """By the menu: the monkey may have given any key to anything."""
        end = time.monotonic() + GONE
        while KEYS_BACK not in self.hands.places():
            assert time.monotonic() < end, f"{KEYS_PAGE} does not open"
            self.hands.press("Escape")
            for label in ("Menu: Help", KEYS_PAGE):
                if self._appears(label):
                    self.hands.choose(label)
            self._appears(KEYS_BACK)
        self.hands.choose(KEYS_BACK)
        while KEYS_BACK in self.hands.places():
            assert time.monotonic() < end, f"{KEYS_PAGE} does not close"
            self.hands.press("Escape")

    def _appears(self, label: str) -> bool:
        end = time.monotonic() + 3
        while label not in self.hands.places() and time.monotonic() < end:
            time.sleep(0.02)
        return label in self.hands.places()

    def resize(self, size: tuple[int, int]) -> None:
        self.write(f"search --name ObjectMorpher windowsize %@ {size[0]} {size[1]}")
        self.size = size

    def undone(self, save_to: Path) -> bytes:
        """Everything is undone, and saved: the session's bytes."""
        self.calm()
        before = b""
        for _ in range(4 * ROUND // UNDO):
            self.write(f"key --repeat {UNDO} --delay 8 ctrl+z")
            self.answered()
            self.hands.press("ctrl+shift+s")
            self.hands.place("Cancel")
            save_to.unlink(missing_ok=True)
            self.hands.fill_in(save_to)
            self.hands.wait(save_to.exists, "saving after the monkey")
            self.hands.wait(lambda: save_to.name in self.hands.title(), "having saved")
            after = save_to.read_bytes()
            if after == before:
                return after
            before = after
        raise AssertionError("undoing has no end")


def _waits(pid: int) -> dict[int, float]:
    """s that each of a process's threads was ready to run while others had the processors."""
    waits = {}
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with contextlib.suppress(OSError, IndexError, ValueError):
            waits[int(path.parent.name)] = int(path.read_text().split()[1]) / 1e9
    return waits


class Monkey:
    """Random events, about equally often on the canvas and beside it."""

    def __init__(self, player: Player, seed: int, titles: dict[str, tuple[str, ...]]) -> None:
        """`titles`: the labels of the entries of each menu."""
        self._player, self._random, self._titles = player, random.Random(seed), titles
        self._acts: list[tuple[Callable[[], None], int]] = [
            (self._move, 3), (self._click, 5), (self._drag, 5), (self._wheel, 1), (self._key, 6),
            (self._drag_out, 1), (self._press, 3), (self._type, 1), (self._menu, 2),
        ]  # fmt: skip
        self.done: Counter[str] = Counter()
        self.entries: Counter[str] = Counter()

    def play(self, count: int) -> None:
        """So many events; the window answers after each few of them."""
        rare: tuple[tuple[Callable[[], None], float], ...] = (
            (self._resize, 0.006), (self._close_while_busy, 0.003), (self._quit_while_busy, 0.001),
        )  # fmt: skip
        acts, weights = zip(*self._acts, strict=True)
        left = 0
        for _ in range(count):
            act = self._random.choices(acts, weights)[0]
            for other, chance in rare:
                act = other if self._random.random() < chance else act
            self.done[act.__name__.strip("_")] += 1
            act()
            self._player.write(PAUSE)
            left -= 1
            if left <= 0:
                left = self._random.randrange(1, BURST)
                if not self._player.answered():
                    self._player.again()

    def _place(self) -> tuple[int, int]:
        """On the canvas, mostly near its middle, or anywhere in the window."""
        pick, (wide, high) = self._random, self._player.size
        if pick.random() < 0.6:
            x, y, width, height = CANVAS
            spread = pick.choice((0.1, 0.25, 0.5))
            across, down = (min(max(pick.gauss(0.5, spread), 0), 1) for _ in "xy")
            return round(wide * (x + width * across)), round(high * (y + height * down))
        at = pick.randrange(wide), pick.randrange(high)
        x0, y0, x1, y1 = self._player.hands.places().get(UPWARDS, (0, 0, 0, 0))
        return at if not (x0 <= at[0] <= x1 and y0 <= at[1] <= y1) else (1, high - 1)

    def _to(self, at: tuple[int, int] | None = None) -> str:
        return "mousemove {} {}".format(*(at or self._place()))

    def _move(self) -> None:
        self._player.write(self._to())

    def _click(self) -> None:
        button = self._random.choice((1, 1, 1, 1, 3, 2))
        times = self._random.choice((1, 1, 1, 2))
        self._player.write(self._to())
        self._with_key(f"click --repeat {times} --delay 20 {button}")

    def _drag(self) -> None:
        self._stroke([self._to() for _ in range(self._random.randrange(1, 5))])

    def _drag_out(self) -> None:
        """Beyond the window's edge, and let go there or after coming back."""
        outside = self._to((self._player.size[0] + 60, self._random.randrange(SCREEN[1])))
        back = [self._to()] if self._random.random() < 0.5 else []
        self._stroke([self._to(), outside, *back])

    def _stroke(self, moves: list[str]) -> None:
        button = self._random.choice((1, 1, 1, 3, 2))
        if self._random.random() < 0.15:  # in the middle of it
            moves.insert(self._random.randrange(len(moves) + 1), "key Escape")
        self._player.write(self._to())
        self._with_key("\n".join([f"mousedown {button}", *moves, f"mouseup {button}"]))

    def _wheel(self) -> None:
        button, times = self._random.choice((4, 5)), self._random.randrange(1, 4)
        self._player.write(f"{self._to()}\nclick --repeat {times} --delay 5 {button}")

    def _key(self) -> None:
        self._player.write(f"key {self._random.choice(KEYS)}")

    def _with_key(self, act: str) -> None:
        if self._random.random() < 0.75:
            return self._player.write(act)
        held = self._random.choice(HELD)
        return self._player.write(f"keydown {held}\n{act}\nkeyup {held}")

    def _label(self) -> tuple[int, int]:
        """The middle of something that has a label; the program's end is left to others."""
        places = {
            label: area for label, area in self._player.hands.places().items()
            if label not in (UPWARDS, ASKED, "Quit", "Pointer")
        }  # fmt: skip
        if not places:
            return self._place()
        x0, y0, x1, y1 = places[self._random.choice(sorted(places))]
        return round((x0 + x1) / 2), round((y0 + y1) / 2)

    def _press(self) -> None:
        times = self._random.choice((1, 1, 1, 2))
        self._player.write(f"{self._to(self._label())}\nclick --repeat {times} --delay 30 1")

    def _type(self) -> None:
        """Nonsense, into a field or wherever a click leads."""
        text = self._random.choice(NONSENSE)
        text = text.replace("%", "").replace(" ", "") or "-"
        self._press()
        self._player.write(f"type --delay 2 -- {text}")
        self._player.write(f"key {self._random.choice(('Return', 'Tab', 'Escape'))}")

    def _menu(self) -> None:
        """An entry of a menu: one that was chosen least often."""
        title = self._random.choice(sorted(self._titles))
        places = self._player.hands.places()
        if f"Menu: {title}" not in places:
            return
        x0, y0, x1, y1 = places[f"Menu: {title}"]
        self._player.write(f"{self._to((round((x0 + x1) / 2), round((y0 + y1) / 2)))}\nclick 1")
        if not self._player.answered():
            return
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            found = self._shown(title)
            if found:
                self._player.write(self._to(self._rarest(found)) + "\nclick 1")
                return
            time.sleep(0.02)
        self._player.write("key Escape")  # out of the dialog that is in the way

    def _shown(self, title: str) -> dict[str, tuple[float, float, float, float]]:
        """The entries of a menu that are on the screen, by their label without what varies."""
        places = self._player.hands.places()
        return {
            label: area for label in self._titles[title] if label != "Quit"
            for shown, area in places.items()
            if shown == label or shown.startswith(f"{label}: ")
        }  # fmt: skip

    def _rarest(self, found: dict[str, tuple[float, float, float, float]]) -> tuple[int, int]:
        least = min(self.entries[label] for label in found)
        rare = sorted(label for label in found if self.entries[label] == least)
        label = self._random.choice(rare)
        self.entries[label] += 1
        x0, y0, x1, y1 = found[label]
        return round((x0 + x1) / 2), round((y0 + y1) / 2)

    def _resize(self) -> None:
        self._player.resize(self._random.choice(SIZES))

    def _start_a_job(self) -> None:
        """Escape out of whatever is open, select something, and lift it."""
        self._player.write("key Escape\nkey Escape\nkey 1\nkey ctrl+shift+a")
        if self._random.random() < 0.5:
            self._player.write(f"sleep {self._random.uniform(0.1, 1.0):.2f}\nkey ctrl+l")
        self._player.write(f"sleep {self._random.uniform(0, 0.3):.2f}")

    def _close_while_busy(self) -> None:
        self._start_a_job()
        self._player.write("key ctrl+w\nsleep 0.3")
        self._answer()
        if self._player.answered() and self._random.random() < 0.9:
            self._player.open_photo()

    def _quit_while_busy(self) -> None:
        self._start_a_job()
        self._player.write("key ctrl+q\nsleep 0.3")
        self._answer()

    def _answer(self) -> None:
        """To the question about unsaved changes, where there is one."""
        end = time.monotonic() + 1.0
        while ASKED not in self._player.hands.places() and time.monotonic() < end:
            time.sleep(0.02)
        area = self._player.hands.places().get(ASKED)
        if area is None or self._random.random() < 0.2:
            self._player.write("key Escape")
            return
        at = round((area[0] + area[2]) / 2), round((area[1] + area[3]) / 2)
        self._player.write(self._to(at) + "\nclick 1\nsleep 0.05")


def menu_titles() -> dict[str, tuple[str, ...]]:
    """The labels of the entries of each menu."""
    from objectmorpher.commands import COMMANDS
    from objectmorpher.gui.window.menu import MENUS

    return {
        title: tuple(COMMANDS[n].label for n in names if n in COMMANDS)
        for title, names in MENUS.items()
    }


def check(player: Player, place: Place, log: Path) -> None:
    """What is saved after undoing everything is whole, and the photo as it was opened."""
    from objectmorpher_core.pipeline import open_photo
    from objectmorpher_core.session.file import decode_session, encode_session

    session = place.photo.with_name("monkey.omorph")
    data = player.undone(session)
    saved = decode_session(data)
    assert encode_session(saved) == data  # every array as it was saved
    first = open_photo(saved.photo.source, saved.photo.name)
    assert encode_session(first) == data, "undoing everything gives another document"
    lines = log.read_text().splitlines()
    errors = [line for line in lines if " ERROR " in line and OFFLINE not in line]
    assert errors == [], errors[-5:]
    place.tidy()


def rounds(
    environment: dict[str, str], place: Place, log: Path, seed: int, events: int
) -> Iterator[dict[str, Any]]:
    """What came of each round; raises AssertionError where something broke."""
    player = Player(environment, place)
    entries: Counter[str] = Counter()
    try:
        while events > 0:
            monkey = Monkey(player, seed, menu_titles())
            monkey.entries = entries
            player.open_photo()
            count = min(ROUND, events)
            monkey.play(count)
            player.open_photo()
            check(player, place, log)
            player.hands.press("ctrl+w")
            yield {
                "seed": seed, "events": count, "slowest_s": round(player.slowest, 2),
                "starts": player.starts, "entries": len(entries), "done": dict(monkey.done),
            }  # fmt: skip
            events, seed = events - count, seed + 1
    except (AssertionError, Failed):
        from PIL import Image

        Image.fromarray(player.hands.picture()).save(place.folder / "stuck.png")
        raise
    finally:
        player.close()


def main() -> int:
    parser = argparse.ArgumentParser(prog="python tests/app/monkey.py", description=__doc__)
    parser.add_argument("--events", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--report", type=Path, help="a file for a line of JSON of each round")
    parser.add_argument("--keep", type=Path, help="the folder in which it plays")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch, x_display(*SCREEN) as display:
        if display is None:
            sys.exit("no X display: install Xvfb and xdotool")
        folder = options.keep or Path(scratch)
        environment, place = prepared(display, folder)
        log = folder / "objectmorpher.log"
        for told in rounds(environment, place, log, options.seed, options.events):
            line = json.dumps(told)
            print(line, flush=True)
            if options.report is not None:
                with options.report.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
    return 0


def prepared(display: str, folder: Path) -> tuple[dict[str, str], Place]:
    """The surroundings of a window: a photo, a home, and no network."""
    from PIL import Image

    from editor_steps import made_photo

    place = Place(folder)
    Image.fromarray(made_photo()).save(place.photo)
    settings = 'dialogs = "built-in"\ngaussians = 3000\n'
    environment = window_environment(display, folder, settings)
    environment |= {"HOME": str(place.photo.parent), OFFLINE: "1"}
    return environment, place


if __name__ == "__main__":
    sys.exit(main())
