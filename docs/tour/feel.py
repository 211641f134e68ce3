"""How long a picture takes to follow the hand, measured on the real window."""

from __future__ import annotations

import json
import math
import os
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles

ROOT = Path(__file__).parents[2]
RATE = 1 / 60  # s between two places of the pointer
SECONDS = 8.0  # of a drag
SWING = 60.0  # px that the pointer goes to either side


@dataclass(frozen=True)
class Latency:
    """ms from the pointer's move to the first frame that shows it or a later place."""

    median: float
    p90: float
    frames: int
    shown: float  # ms, median of a frame's own work


class Mouse:
    """xdotool, kept open: a move takes a fraction of a millisecond."""

    def __init__(self, display: str) -> None:
        self._process = subprocess.Popen(
            ["xdotool", "-"],
            stdin=subprocess.PIPE,
            text=True,
            env={**os.environ, "DISPLAY": display},
        )

    def do(self, *words: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(" ".join(str(w) for w in words) + "\n")
        self._process.stdin.flush()

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def swing(
    mouse: Mouse, at: tuple[float, float], seconds: float = SECONDS
) -> list[tuple[float, ...]]:
    """Moves the pointer in a figure of eight; (time, x, y) of each place."""
    sent, start = [], time.monotonic()
    while (now := time.monotonic()) - start < seconds:
        angle = 2 * math.pi * 0.4 * (now - start)
        x = round(at[0] + SWING * math.sin(angle))
        y = round(at[1] + 0.5 * SWING * math.sin(2 * angle))
        mouse.do("mousemove", x, y)
        sent.append((time.monotonic(), x, y))
        time.sleep(RATE)
    return sent


def latency(sent: list[tuple[float, ...]], log: Path, is_stroke: bool) -> Latency:
    """Of the places `sent`, by the frames of a log; a frame shows the newest place it has seen."""
    frames = [f for f in json.loads(log.read_text()) if sent[0][0] <= f["shown"] <= sent[-1][0] + 1]
    frames = [f for f in frames if f["is_stroke"] == is_stroke]
    delays, k = [], 0
    for frame in frames:
        shows = [i for i in range(k, len(sent)) if sent[i][1:] == (frame["x"], frame["y"])]
        if not shows or sent[shows[0]][0] > frame["shown"]:
            continue
        newest = max(i for i in shows if sent[i][0] <= frame["shown"])
        delays += [1000 * (frame["shown"] - sent[i][0]) for i in range(k, newest + 1)]
        k = newest + 1
    work = [1000 * (f["shown"] - f["began"]) for f in frames]
    return Latency(median(delays), quantiles(delays, n=10)[-1], len(frames), median(work))
