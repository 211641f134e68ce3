"""What an editor and its worker hold together, watched while they work."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

EVERY = 0.2  # s


class Watch:
    """The most memory that both have held since it was asked for, what they share counted once."""

    def __init__(self, worker: Callable[[], str]) -> None:
        """`worker`: tells its process's number."""
        self._worker, self._ends = worker, threading.Event()
        self._most = [0.0, 0.0, 0.0]
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def most(self) -> tuple[float, float, float]:
        """MiB of the editor, of the worker and of both at a time; begins anew."""
        self._look()
        found, self._most = tuple(self._most), [0.0, 0.0, 0.0]
        return found[0], found[1], found[2]

    def close(self) -> None:
        self._ends.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ends.wait(EVERY):
            self._look()

    def _look(self) -> None:
        own, other = share("self"), share(self._worker())
        now = (own, other, own + other)
        self._most = [max(a, b) for a, b in zip(self._most, now, strict=True)]


def share(process: str) -> float:
    """MiB that a process holds, its part of what it shares; 0 where it has ended."""
    try:
        text = Path(f"/proc/{process}/smaps_rollup").read_text()
    except OSError:
        return 0.0
    return int(text.split("Pss:")[1].split()[0]) / 1024
