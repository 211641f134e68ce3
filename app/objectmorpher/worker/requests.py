"""What is asked to be done beside the window, and what is common to those who do it.

The worker process (`jobs.py`) computes, one request after another. Threads (`Chores`) do what
mostly waits for a disk or a network, or what must not wait behind a long computation. Of one kind
only the newest request counts. `JobError` says why one failed: in a sentence, and whether it was
our fault, the request's or the machine's.
"""

from __future__ import annotations

import errno
import logging
import math
import queue
import threading
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from objectmorpher_core.base.progress import Cancelled

log = logging.getLogger(__name__)

LIFT, READY = "lift", "ready"  # kinds: a job lifts an object, a thread makes it ready to bend
OURS = ("objectmorpher", "objectmorpher_core")  # packages
# What the system says of a wrong request: no other try makes it right.
LASTING = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG, errno.EINVAL)


@dataclass(frozen=True)
class JobError:
    """Why a job failed."""

    name: str  # the exception's type, or "Crash"
    sentence: str  # for the status line
    trace: str  # for "Details" and the log
    retry: Callable[[], None] | None = None  # asks for the same once more, where that may help
    is_expected: bool = False  # one of our own errors: the request was at fault, not the program
    may_pass: bool = False  # the machine was at fault: the same may succeed on another try

    @classmethod
    def of(cls, error: Exception, what: str) -> JobError:
        """Make it from an exception that is being handled; `what` failed."""
        name = type(error).__name__
        # Of others' kinds some are values' errors, too: numpy's of a singular matrix is one.
        is_ours = type(error).__module__.partition(".")[0] in OURS
        is_expected = is_ours and isinstance(error, ValueError)
        sentence = str(error) or f"{what} failed ({name})"
        return cls(
            name, sentence, traceback.format_exc(),
            is_expected=is_expected, may_pass=_may_pass(error),
        )  # fmt: skip

    def retried_by(self, again: Callable[[], None]) -> JobError:
        """Return the same error with `again` as its remedy if another try may help."""
        return replace(self, retry=again) if self.may_pass else self

    def write_log(self, title: str) -> None:
        """Log the failure of `title`, as an error of the program's unless it was expected."""
        level = logging.INFO if self.is_expected else logging.ERROR
        log.log(level, "%s failed: %s\n%s", title, self.sentence, self.trace)


def _may_pass(error: BaseException | None) -> bool:
    """Whether the system failed, and not for good: a full disk, a lost drive, too little memory.

    An error without a number is not the system's: Pillow calls a broken picture an OSError.
    """
    if error is None or isinstance(error, MemoryError):
        return error is not None
    if isinstance(error, OSError) and error.errno is not None and error.errno not in LASTING:
        return True
    return _may_pass(error.__cause__)


@dataclass(eq=False)
class Request:
    """A request, and how far it is."""

    title: str  # "Lifting the object"
    kind: str
    function: Callable[..., Any]  # called with the arguments and a keyword `progress`
    arguments: tuple[Any, ...]
    done: Callable[[Any], None]
    failed: Callable[[JobError], None]
    cancelled: Callable[[], None]
    replaced: Callable[[], None]
    is_quiet: bool = False
    is_spare: bool = False
    number: int = 0
    fraction: float = 0.0
    note: str = ""
    asked: float = 0.0  # s, monotonic
    started: float = 0.0  # s, monotonic; not before it was asked
    stop_asked: float | None = None  # s, monotonic
    ends_at: float = math.inf  # s, monotonic; not stopped by then, its process is ended


class Executor(ABC):
    """Does requests beside the window; answers are delivered on the main thread by `poll`."""

    _count = 0

    def start(
        self,
        title: str,
        function: Callable[..., Any],
        *arguments: Any,
        done: Callable[[Any], None],
        failed: Callable[[JobError], None],
        cancelled: Callable[[], None] = lambda: None,
        replaced: Callable[[], None] = lambda: None,
        kind: str = "",
        is_quiet: bool = False,
        is_spare: bool = False,
    ) -> None:
        """Runs `function(*arguments, progress=...)`.

        A request of the same `kind` that waits or runs is replaced: its answer never comes, and
        `replaced` is all that it is told.
        A quiet one is not the user's: the status line does not show it. A spare one besides gives
        way: any other request ends it.
        """
        request = Request(
            title, kind or function.__name__, function, arguments, done, failed, cancelled,
            replaced, is_quiet, is_spare,
        )  # fmt: skip
        self._begin(request)

    @abstractmethod
    def _begin(self, request: Request) -> None:
        """Takes up a request, now or after others."""

    @property
    @abstractmethod
    def shown(self) -> Request | None:
        """What runs, or else waits, and is the user's: the status line shows it."""

    @property
    @abstractmethod
    def is_idle(self) -> bool:
        """Whether nothing waits or runs."""

    @property
    @abstractmethod
    def kinds(self) -> tuple[str, ...]:
        """Return the kinds of what runs and waits."""

    @abstractmethod
    def is_busy(self, kind: str) -> bool:
        """Whether a request of this kind waits or runs."""

    @abstractmethod
    def cancel(self, kind: str | None = None) -> None:
        """Stops the running and waiting requests of a kind, or all."""

    @abstractmethod
    def poll(self) -> bool:
        """Delivers answers; once a frame, on the main thread. Whether anything changed."""

    @abstractmethod
    def close(self) -> None:
        """The program ends."""

    def _numbered(self, request: Request) -> Request:
        """Answers are matched by their numbers."""
        self._count += 1
        request.number, request.asked = self._count, time.monotonic()
        request.started = request.asked
        return request

    def _again(self, request: Request) -> None:
        """The request that failed, once more."""
        anew = {"fraction": 0.0, "note": "", "stop_asked": None, "ends_at": math.inf}
        self._begin(replace(request, **anew))

    def _accept(self, request: Request, value: Any) -> None:
        """Hands the answer over; one that cannot be used is a failure, not the window's end."""
        level = logging.DEBUG if request.is_quiet else logging.INFO
        log.log(level, "%s took %.2f s", request.title, time.monotonic() - request.started)
        try:
            request.done(value)
        except Exception as error:
            log.exception("The answer of %s cannot be used", request.title)
            request.failed(JobError.of(error, request.title))

    def _fail(self, request: Request, error: JobError) -> None:
        """Says so, and offers another try where that may help."""
        request.failed(error.retried_by(lambda: self._again(request)))


# Chores: requests that are done each in a thread of its own: opening files, downloads.

PROGRESS = "progress"  # a message that wakes nobody: who shows it looks by itself
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
                is_changed = is_changed or what != PROGRESS
                self._take(chore, what, value)
        return is_changed

    def close(self) -> None:
        """The program ends: what runs is asked to stop, and given a moment."""
        threads = [thread for _, thread in self._running.values()]
        self.cancel()
        for thread in threads:
            thread.join(FAREWELL)

    def _take(self, chore: Request, what: str, value: Any) -> None:
        if what == PROGRESS:
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
            self._answers.put((chore, PROGRESS, (fraction, note)))

        try:
            answer = chore, "done", chore.function(*chore.arguments, progress=progress)
        except Cancelled:
            return
        except Exception as error:
            answer = chore, "failed", JobError.of(error, chore.title)
        self._answers.put(answer)
        self._wake()
