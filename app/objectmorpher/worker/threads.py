"""Chores, each in a thread of its own beside the window: opening files, downloads.

The worker process (`jobs.py`) computes; here is what mostly waits for a disk or a network, or
what must not wait behind a long computation. Answers are delivered on the main thread by `poll`.
Of one kind only the newest request counts.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from objectmorpher_core.base.progress import Cancelled, Progress

from .job_error import JobError

log = logging.getLogger(__name__)

FAREWELL = 1.0  # s that closing waits for what was asked to stop


@dataclass(eq=False)
class Chore:
    """A request, and how far it is."""

    title: str  # "Opening coffee.jpg"
    kind: str
    function: Callable[[Progress], Any]
    done: Callable[[Any], None]
    failed: Callable[[JobError], None]
    cancelled: Callable[[], None]
    is_quiet: bool = False
    fraction: float = 0.0
    note: str = ""
    started: float = field(default_factory=time.monotonic)  # s
    stop: threading.Event = field(default_factory=threading.Event)
    thread: threading.Thread | None = None


class Chores:
    """What runs, and the answers."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """`wake` is called from another thread when `poll` has something to do."""
        self._wake = wake
        self._running: dict[str, Chore] = {}  # by kind
        self._answers: queue.SimpleQueue[tuple[Chore, str, Any]] = queue.SimpleQueue()

    def start(
        self,
        title: str,
        function: Callable[[Progress], Any],
        *,
        kind: str,
        done: Callable[[Any], None],
        failed: Callable[[JobError], None],
        cancelled: Callable[[], None] = lambda: None,
        is_quiet: bool = False,
    ) -> None:
        """Runs `function(progress)`; one of the same kind that runs already is forgotten."""
        if (older := self._running.get(kind)) is not None:
            older.stop.set()
        chore = Chore(title, kind, function, done, failed, cancelled, is_quiet)
        self._running[kind] = chore
        chore.thread = threading.Thread(target=self._work, args=(chore,), daemon=True, name=kind)
        chore.thread.start()

    @property
    def shown(self) -> Chore | None:
        """What the status line tells of."""
        return next((c for c in self._running.values() if not c.is_quiet), None)

    @property
    def is_idle(self) -> bool:
        return not self._running

    def is_busy(self, kind: str) -> bool:
        return kind in self._running

    def cancel(self, kind: str | None = None) -> None:
        """Forgets what runs, of a kind or all: its answer never comes."""
        for chore in [c for c in self._running.values() if kind in (None, c.kind)]:
            chore.stop.set()
            del self._running[chore.kind]
            chore.cancelled()

    def poll(self) -> bool:
        """Delivers answers; once a frame, on the main thread. Whether anything changed."""
        is_changed = False
        while not self._answers.empty():
            chore, what, value = self._answers.get()
            if self._running.get(chore.kind) is chore:
                is_changed = True
                self._take(chore, what, value)
        return is_changed

    def close(self) -> None:
        """The program ends: what runs is asked to stop, and given a moment."""
        chores = list(self._running.values())
        self.cancel()
        for chore in chores:
            assert chore.thread is not None
            chore.thread.join(FAREWELL)

    def _take(self, chore: Chore, what: str, value: Any) -> None:
        if what == "progress":
            chore.fraction, chore.note = value
            return
        del self._running[chore.kind]
        if what == "done":
            log.debug("%s took %.2f s", chore.title, time.monotonic() - chore.started)
            chore.done(value)
        else:
            value.write_log(chore.title)
            chore.failed(value.retried_by(lambda: self._again(chore)))

    def _again(self, chore: Chore) -> None:
        """The request of a chore that failed, once more."""
        self.start(
            chore.title, chore.function, kind=chore.kind, done=chore.done, failed=chore.failed,
            cancelled=chore.cancelled, is_quiet=chore.is_quiet,
        )  # fmt: skip

    def _work(self, chore: Chore) -> None:
        """In the thread."""

        def progress(fraction: float, note: str) -> None:
            if chore.stop.is_set():
                raise Cancelled
            self._answers.put((chore, "progress", (fraction, note)))
            self._wake()

        try:
            self._answers.put((chore, "done", chore.function(progress)))
        except Cancelled:
            return
        except Exception as error:
            self._answers.put((chore, "failed", JobError.of(error, chore.title)))
        self._wake()
