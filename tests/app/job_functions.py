"""Job functions for the tests; they must be importable by the spawned worker."""

from __future__ import annotations

import os
import time

import numpy as np

from objectmorpher_core.edits import EditError
from objectmorpher_core.progress import Progress

_seen: list[np.ndarray] = []


def double(value: np.ndarray, progress: Progress) -> np.ndarray:
    progress(0.5, "halfway")
    return value * 2


def is_same_as_last_time(value: np.ndarray, progress: Progress) -> bool:
    is_same = bool(_seen) and _seen[-1] is value
    _seen.append(value)
    return is_same


def wait(seconds: float, progress: Progress) -> str:
    """Stops when asked, within 20 ms."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        progress(1 - left / seconds, "waiting")
        time.sleep(0.02)
    return "waited"


def hang(seconds: float, progress: Progress) -> str:
    """Never asks whether it should stop."""
    time.sleep(seconds)
    return "slept"


def fail(progress: Progress) -> None:
    raise ValueError("the mask is empty")


def divide(progress: Progress) -> None:
    """Fails with an error of numpy's."""
    np.linalg.inv(np.zeros((2, 2)))


def refuse(progress: Progress) -> None:
    raise EditError("nothing is selected")


def crash(progress: Progress) -> None:
    os._exit(11)
