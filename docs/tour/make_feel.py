"""Makes docs/tour/feel.md anew: `make feel`, on a machine that has nothing else to do.

How long the picture takes to follow the hand, in the real window (Xvfb and xdotool) as it logs its
own frames (`--frame-log`).
"""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from statistics import median, quantiles

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "app")]

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

from hands import Hands, window_environment, x_display  # noqa: E402
from objectmorpher_core.pictures.image import Picture, encode_picture  # noqa: E402
from objectmorpher_core.pipeline import open_photo  # noqa: E402
from objectmorpher_core.session.file import save_session  # noqa: E402

SAMPLE = ROOT / "assets" / "samples" / "astronaut.jpg"
SCREEN = (1440, 1100)  # px
SIZE = (1372, 1084)  # points of the window, in which the canvas has 1024 x 1024
OBJECT = (600, 420)  # px on the screen: on what is lifted
LARGE = (1024, 1024)  # px of the photo that is opened and clicked
COUNTS = (100_000, None)  # Gaussians; None: as many as usual
RATE = 1 / 60  # s between two places of the pointer
SECONDS = 8.0  # of a drag
SWING = 60.0  # px that the pointer goes to either side
QUIET = 6.0  # s after opening: the worker has read the photo and filled in the background
STARTS = 5  # and openings of a photo
PATIENCE = 60.0  # s

HEAD = """# How the window feels

Made by `make feel`: {machine}, OpenGL emulated on the same cores (llvmpipe), load {load:.1f}
when it began. A real pointer moves 60 times a second over a canvas of 1024 x 1024 px; the window
writes down when each frame was on the screen and which place of the pointer it shows.

- *Hand to picture*: from a place of the pointer to the first frame that shows it or a later one,
  all places counted. *Behind*: how old the place is that a frame shows, when it appears.
- *Frame*: what one takes, from its events to the end of the swap.

| | hand to picture, median (9 of 10) | behind, median | frame, median | frames |
|---|---:|---:|---:|---:|
"""


@dataclass(frozen=True)
class Feel:
    """ms; see `HEAD`."""

    latency: float
    latency_90: float
    behind: float
    frame: float
    frames: int

    @property
    def row(self) -> str:
        return (
            f"{self.latency:.0f} ms ({self.latency_90:.0f}) | {self.behind:.0f} ms "
            f"| {self.frame:.0f} ms | {self.frames}"
        )


class Mouse:
    """xdotool, kept open: a move takes a fraction of a millisecond."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._process = subprocess.Popen(
            ["xdotool", "-"], stdin=subprocess.PIPE, text=True, env=environment
        )

    def do(self, *words: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(" ".join(str(w) for w in words) + "\n")
        self._process.stdin.flush()

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


Places = list[tuple[float, int, int]]  # time, x, y of each place of the pointer


def swing(mouse: Mouse, at: tuple[float, float], seconds: float = SECONDS) -> Places:
    """Moves the pointer in a figure of eight."""
    sent, start = [], time.monotonic()
    while (now := time.monotonic()) - start < seconds:
        angle = 2 * math.pi * 0.4 * (now - start)
        x = round(at[0] + SWING * math.sin(angle))
        y = round(at[1] + 0.5 * SWING * math.sin(2 * angle))
        mouse.do("mousemove", x, y)
        sent.append((time.monotonic(), x, y))
        time.sleep(RATE)
    return sent


def feel(sent: Places, log: Path, kind: str) -> Feel:
    """Of the places `sent`, in the frames that are of a kind ("is_stroke", "job").

    A frame shows the newest place that it has seen.
    """
    frames = json.loads(log.read_text())
    delays, behind, work, k = [], [], [], 0
    for frame in frames:
        seen = (frame["x"], frame["y"])
        shows = [i for i in range(k, len(sent)) if sent[i][1:] == seen]
        shows = [i for i in shows if sent[i][0] <= frame["shown"]]
        if not shows:
            continue
        newest = shows[-1]
        first, k = k, newest + 1
        if not frame[kind]:
            continue
        delays += [1000 * (frame["shown"] - sent[i][0]) for i in range(first, newest + 1)]
        behind.append(1000 * (frame["shown"] - sent[newest][0]))
        work.append(1000 * (frame["shown"] - frame["began"]))
    nine_of_ten = quantiles(delays, n=10)[-1]
    return Feel(median(delays), nine_of_ten, median(behind), median(work), len(work))


@contextmanager
def window(path: Path, environment: dict[str, str], log: Path) -> Iterator[Mouse]:
    """The window with a session, ready, and the pointer; it writes its frames when it is closed."""
    command = [sys.executable, "-m", "objectmorpher", str(path), "--size", "{},{}".format(*SIZE)]
    command += ["--frame-log", str(log)]
    with subprocess.Popen(command, env=environment, cwd=ROOT) as process:
        hands, mouse = Hands(environment), Mouse(environment)
        hands.wait(lambda: path.name in hands.title(), "opening")
        time.sleep(QUIET)
        try:
            yield mouse
            mouse.do("key", "ctrl+s")
            time.sleep(3)
            mouse.do("key", "ctrl+q")
            process.wait(PATIENCE)
        finally:
            mouse.close()
            process.kill()


def drag(session: Path, environment: dict[str, str], folder: Path) -> Feel:
    """The first point of an object that is taken hold of."""
    log = folder / "frames.json"
    with window(session, environment, log) as mouse:
        mouse.do("mousemove", *OBJECT)
        time.sleep(1)
        mouse.do("mousedown", 1)
        time.sleep(1)
        sent = swing(mouse, OBJECT)
        mouse.do("mouseup", 1)
        time.sleep(1)
    return feel(sent, log, "is_stroke")


def work_beside(environment: dict[str, str], folder: Path) -> Feel:
    """The pointer moves over the photo while the worker lifts an object and fills in behind it."""
    log = folder / "frames.json"
    session = folder / "photo.omorph"
    save_session(open_photo(SAMPLE.read_bytes(), SAMPLE.name), session)
    with window(session, environment, log) as mouse:
        mouse.do("mousemove", *OBJECT)
        mouse.do("click", 1)
        time.sleep(4)
        mouse.do("key", "Return")
        sent = swing(mouse, OBJECT)
        time.sleep(4)
    return feel(sent, log, "job")


def first_click(environment: dict[str, str], folder: Path, number: int) -> tuple[float, float]:
    """s from a photo of 1 MP on the screen, clicked at once, to its selection and a closer look.

    It is opened in a window that has shown another, and differs each time.
    """
    log, other, photo = folder / "frames.json", folder / "other.omorph", folder / "large.omorph"
    pixels = Image.open(SAMPLE).convert("RGB").resize(LARGE, Image.Resampling.LANCZOS)
    shifted = encode_picture(Picture(np.roll(np.asarray(pixels), -number, axis=1)), ".png")
    save_session(open_photo(SAMPLE.read_bytes(), SAMPLE.name), other)
    save_session(open_photo(shifted, SAMPLE.name), photo)
    with window(other, environment, log) as mouse:
        hands = Hands(environment)
        mouse.do("mousemove", *OBJECT)
        hands.press("ctrl+o")
        hands.fill_in(photo)
        hands.wait(lambda: photo.name in hands.title(), "opening")
        mouse.do("click", 1)
        time.sleep(QUIET)
    phases = [(job, list(found)) for job, found in
              groupby(json.loads(log.read_text()), key=lambda frame: frame["job"])]  # fmt: skip
    opened = max(i for i, (job, _) in enumerate(phases) if job == "Reading the photo")
    assert phases[opened + 1][0] == "Selecting"
    done = next(i for i in range(opened, len(phases)) if not phases[i][0])
    began, *ends = (phases[i][1][0]["shown"] for i in (opened, opened + 2, done))
    return ends[0] - began, ends[1] - began


def start(environment: dict[str, str], folder: Path) -> float:
    """s from the command to the first frame on the screen."""
    log = folder / "frames.json"
    command = [sys.executable, "-m", "objectmorpher", "--frames", "2", "--frame-log", str(log)]
    began = time.monotonic()
    subprocess.run(command, env=environment, cwd=ROOT, check=True)
    return json.loads(log.read_text())[0]["shown"] - began


def lift(count: int | None, path: Path) -> None:
    """A session with the lifted object of the sample photo and what is behind it."""
    command = [sys.executable, "-m", "objectmorpher", "edit", str(SAMPLE), "--subject"]
    command += ["--session", str(path), "--move", "0.01,0", "-o", str(path.with_suffix(".png"))]
    command += [] if count is None else ["--gaussians", str(count)]
    subprocess.run(command, cwd=ROOT, check=True)


def main() -> None:
    load = os.getloadavg()[0]
    rows = []
    with tempfile.TemporaryDirectory() as name, x_display(*SCREEN) as display:
        folder = Path(name)
        if display is None:
            raise SystemExit("no free X display was found")
        # Nobody asks the window where its buttons are.
        environment = window_environment(display, folder, "") | {"OBJECTMORPHER_LANDMARKS": ""}
        starts = [start(environment, folder) for _ in range(STARTS)]
        for count in COUNTS:
            session = folder / f"{count}.omorph"
            lift(count, session)
            label = "usual number of" if count is None else f"{count:,}"
            rows.append(f"| a point dragged, {label} Gaussians | "
                        f"{drag(session, environment, folder).row} |\n")  # fmt: skip
        clicks = [first_click(environment, folder, n) for n in range(STARTS)]
        beside = work_beside(environment, folder)
        rows.append(f"| the pointer moves while the worker computes | {beside.row} |\n")
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    text = HEAD.format(machine=machine, load=load) + "".join(rows)
    text += f"\nFrom the command to the first frame on the screen: {median(starts):.2f} s "
    text += f"(median of {STARTS}). From a photo of 1 MP on the\n"
    first, settled = (median(c[i] for c in clicks) for i in (0, 1))
    text += f"screen, clicked at once, to its selection: {first:.2f} s; until a closer look has\n"
    text += f"settled it: {settled:.2f} s.\n"
    (HERE / "feel.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
