"""Seconds of something that is done again and again."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Effort:
    """The effort of a measurement: until both `least` and `seconds` are reached, or `most`."""

    seconds: float
    least: int
    most: int


@dataclass(frozen=True)
class Timing:
    """Seconds."""

    first: float  # the first run, which does whatever is done once
    median: float  # of those after it
    least: float

    def less(self, part: Timing) -> Timing:
        """Return the rest of it without a part of it."""
        return Timing(
            max(self.first - part.first, 0.0),
            max(self.median - part.median, 0.0),
            max(self.least - part.least, 0.0),
        )


def measure(run: Callable[[int], Any], effort: Effort) -> Timing:
    """Times `run(k)` for k = 0, 1, ..."""
    first, taken = seconds(lambda: run(0)), []
    while len(taken) < effort.most:
        if len(taken) >= effort.least and sum(taken) >= effort.seconds:
            break
        taken.append(seconds(lambda: run(len(taken) + 1)))
    return Timing(first, float(np.median(taken)), min(taken))


def times(run: Callable[[], Any], repeats: int) -> list[float]:
    """Seconds of each of so many runs, after one that does whatever is done once."""
    run()
    return [seconds(run) for _ in range(repeats)]


def seconds(run: Callable[[], Any]) -> float:
    """Seconds of one run."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def ms(value: Any) -> float:
    """Milliseconds of seconds, as they are reported."""
    return round(1000 * float(value), 3)


def cpu_name() -> str:
    """Return the processor's name."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(x.split(":", 1)[1].strip() for x in file if x.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
