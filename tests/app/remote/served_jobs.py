"""Job functions for servers in tests: they wait, tell steps, and fail."""

from __future__ import annotations

import time

import numpy as np

from objectmorpher.server.message import MessageError
from objectmorpher.server.table import Served
from objectmorpher_core.base.arrays import F32
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.edits import EditError

seen: list[str] = []


def halve(values: F32, progress: Progress) -> F32:
    seen.append("halve")
    return values / np.float32(2)


def count(steps: int, progress: Progress) -> int:
    """A step every 20 ms."""
    for k in range(steps):
        progress(k / steps, f"step {k}")
        time.sleep(0.02)
    seen.append("counted")
    return steps


def refuse(progress: Progress) -> None:
    raise EditError("nothing is selected")


def break_down(progress: Progress) -> None:
    raise ArithmeticError("out of memory on the device")


def look(progress: Progress) -> tuple[str, ...]:
    """What was done in this process."""
    return tuple(seen)


def need_positive(number: int) -> None:
    if number < 0:
        raise MessageError(f"{number} steps")


TABLE = {
    row.function.__name__: row
    for row in (
        Served(halve, "lift", (F32,), F32),
        Served(count, "lift", (int,), int, need_positive),
        Served(refuse, "lift", (), None),
        Served(break_down, "lift", (), None),
        Served(look, "lift", (), tuple[str, ...]),
    )
}
