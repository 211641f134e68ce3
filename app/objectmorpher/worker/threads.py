"""Chores: requests that are done each in a thread of its own: opening files, downloads."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from objectmorpher_core.base.progress import Cancelled

from .requests import Executor, JobError, Request

FAREWELL = 1.0  # s that closing waits for what was asked to stop


class Chores(Executor):
    """What runs in threads, and the answers."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """`wake` is called from another thread when `poll` has something to do."""
        self._wake = wake
        self._running: dict[str, tuple[Request, threading.Thread]] = {}  # by kind
        self._answers: queue.SimpleQueue[tuple[Request, str, Any]] = queue.SimpleQueue()

    def _begin(self, request: Request) -> None:
        chore = self._numbered(request)
        older, _ = self._running.get(chore.kind, (None, None))
        if older is not None:
            older.stop_asked = time.monotonic()
        thread = threading.Thread(target=self._work, args=(chore,), daemon=True, name=chore.kind)
        self._running[chore.kind] = chore, thread
        thread.start()
        if older is not None:
            older.replaced()

    @property
    def shown(self) -> Request | None:
        return next((c for c, _ in self._running.values() if not c.is_quiet), None)

    @property
    def is_idle(self) -> bool:
        return not self._running

    @property
    def kinds(self) -> tuple[str, ...]:
        return tuple(self._running)

    def is_busy(self, kind: str) -> bool:
        return kind in self._running

    def cancel(self, kind: str | None = None) -> None:
        """Forgets what runs, of a kind or all: its answer never comes."""
        for chore, _ in [c for c in self._running.values() if kind in (None, c[0].kind)]:
            chore.stop_asked = time.monotonic()
            del self._running[chore.kind]
            chore.cancelled()

    def poll(self) -> bool:
        is_changed = False
        while not self._answers.empty():
            chore, what, value = self._answers.get()
            if chore in [running for running, _ in self._running.values()]:
                is_changed = True
                self._take(chore, what, value)
        return is_changed

    def close(self) -> None:
        """The program ends: what runs is asked to stop, and given a moment."""
        threads = [thread for _, thread in self._running.values()]
        self.cancel()
        for thread in threads:
            thread.join(FAREWELL)

    def _take(self, chore: Request, what: str, value: Any) -> None:
        if what == "progress":
            chore.fraction, chore.note = value
            return
        del self._running[chore.kind]
        if what == "done":
            self._accept(chore, value)
        else:
            value.write_log(chore.title)
            self._fail(chore, value)

    def _work(self, chore: Request) -> None:
        """In the thread."""

        def progress(fraction: float, note: str) -> None:
            if chore.stop_asked is not None:
                raise Cancelled
            self._answers.put((chore, "progress", (fraction, note)))
            self._wake()

        try:
            answer = chore, "done", chore.function(*chore.arguments, progress=progress)
        except Cancelled:
            return
        except Exception as error:
            answer = chore, "failed", JobError.of(error, chore.title)
        self._answers.put(answer)
        self._wake()
