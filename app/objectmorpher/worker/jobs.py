"""One worker process for everything that takes longer than a frame.

The window starts a job and goes on; `poll` delivers the answer on the main thread. A job function
takes plain values and a keyword `progress`, and knows nothing of this module. Of one kind only the
newest request counts. Cancelling asks first and ends the process a little later.
"""

from __future__ import annotations

import importlib
import logging
import multiprocessing
import os
import queue
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base import torch_environment
from objectmorpher_core.base.progress import Cancelled

from ..system.logs import crash_folder, note_crashes
from .apart import ApartProcess, Flag
from .requests import PROGRESS, Executor, JobError, Request
from .wire import Connection, PipeReader, PipeWriter

if TYPE_CHECKING:
    from ..server.elsewhere import Elsewhere

log = logging.getLogger(__name__)

PATIENCE = 0.35  # s between asking a job to stop and ending its process: the user waits
RELUCTANCE = 2.0  # s, where nobody waits: a new process has to read the photo again
TRIES = 3  # processes that may end before they say anything; the next one waits for a request
REPORT_EVERY = 0.03  # s between two progress messages


class Worker:
    """The process, its pipe and the two threads that keep the pipe from blocking a frame."""

    def __init__(self, warm: tuple[str, ...], wake: Callable[[], None]) -> None:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        self.has_answered = False
        self.answers: queue.SimpleQueue[tuple[str, int, Any]] = queue.SimpleQueue()
        self._requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.stop: Any
        self.process: Any
        if (command := torch_environment.apart()) is not None:
            self.stop = Flag()
            self.process = ApartProcess(command, theirs, self.stop, warm)
        else:
            # Without a lock: one that the process took with it when it was ended would stop us.
            self.stop = context.RawValue("b", 0)
            self.process = context.Process(
                target=work, args=(theirs, self.stop, warm, crash_folder()), daemon=True,
                name="objectmorpher-worker",
            )  # fmt: skip
            self.process.start()
        theirs.close()
        self._connection = ours
        self._wake = wake
        for target in (self._write, self._read):
            threading.Thread(target=target, daemon=True).start()

    def send(self, job: Request, function: Callable[..., Any]) -> None:
        self._requests.put((job.number, function, job.arguments))

    def close(self) -> None:
        """Ends the process, whatever it does."""
        self._requests.put(None)
        self.process.kill()
        self.process.join()

    def _write(self) -> None:
        writer = PipeWriter(self._connection)
        while (request := self._requests.get()) is not None:
            try:
                writer.write(request)
            except OSError:  # the process is gone; the reader says so
                return
            except Exception as error:  # a value that cannot be pickled: our mistake, said as data
                self._deliver("failed", request[0], JobError.of(error, "the request"))

    def _read(self) -> None:
        reader = PipeReader(self._connection)
        try:
            while True:
                self._deliver(*reader.read())
        except (EOFError, OSError):
            self._deliver("gone", -1, None)

    def _deliver(self, what: str, number: int, value: Any) -> None:
        self.answers.put((what, number, value))
        if what != PROGRESS:  # the window looks by itself while a job runs
            self._wake()


class Jobs(Executor):
    """Running and waiting jobs, and their answers."""

    def __init__(self, warm: tuple[str, ...] = (), wake: Callable[[], None] = lambda: None) -> None:
        """`warm`: modules the worker imports at once. `wake` is called from another thread."""
        self._warm, self._wake = warm, wake
        self._worker: Worker | None = Worker(warm, wake)
        self._deaths = 0  # processes in a row that ended without a word
        self.restarted: Callable[[], None] = lambda: None  # called when the worker's memory is lost
        self._waiting: dict[str, Request] = {}  # kind -> newest request, in the order they came
        self.current: Request | None = None
        self.elsewhere: Elsewhere | None = None  # what has jobs done by a server

    def _begin(self, request: Request) -> None:
        job = self._numbered(request)
        displaced = self._waiting.pop(job.kind, None)
        self._waiting[job.kind] = job
        current = self.current
        if current is not None and (
            current.kind == job.kind or (current.is_spare and not job.is_spare)
        ):
            self._ask_to_stop(current, RELUCTANCE)
        self._send_next()
        if displaced is not None:
            displaced.replaced()

    def promote(self, kind: str, wanted: str) -> bool:
        """The spare job that runs is the user's own from now on, of the kind `wanted`.

        Whether there was one.
        """
        job = self.current
        if job is None or job.kind != kind or job.stop_asked is not None:
            return False
        job.kind, job.is_quiet, job.is_spare = wanted, False, False
        return True

    @property
    def shown(self) -> Request | None:
        jobs = (self.current, *self._waiting.values())  # what waits for a quiet one is shown, too
        return next((job for job in jobs if job is not None and not job.is_quiet), None)

    @property
    def held_up(self) -> tuple[Request, ...]:
        """Return the user's requests that wait for what is shown; not those that replace it."""
        shown = self.shown
        rest = [job for job in self._waiting.values() if job is not shown and not job.is_quiet]
        return tuple(job for job in rest if shown is None or job.kind != shown.kind)

    def is_busy(self, kind: str) -> bool:
        current = self.current
        runs = current is not None and current.kind == kind and current.stop_asked is None
        return runs or kind in self._waiting

    @property
    def is_idle(self) -> bool:
        return self.current is None and not self._waiting

    @property
    def kinds(self) -> tuple[str, ...]:
        current = () if self.current is None else (self.current.kind,)
        return (*current, *self._waiting)

    def cancel(self, kind: str | None = None, patience: float = PATIENCE) -> None:
        """Stops the running and waiting requests of a kind, or all, within `patience` s."""
        for job in [j for j in self._waiting.values() if kind in (None, j.kind)]:
            del self._waiting[job.kind]
            job.cancelled()
        if self.current is not None and kind in (None, self.current.kind):
            self._ask_to_stop(self.current, patience)

    def poll(self) -> bool:
        is_changed = False
        while self._worker is not None and not self._worker.answers.empty():
            answer = self._worker.answers.get()
            self._take(*answer)
            is_changed = is_changed or answer[0] != PROGRESS
        job = self.current
        if job and time.monotonic() > job.ends_at:
            log.info("%s did not stop when asked; restarting the worker", job.title)
            self._restart()
            self._finish(job, job.cancelled)
            self.restarted()
            is_changed = True
        return is_changed

    def close(self) -> None:
        self._waiting.clear()
        if self._worker is not None:
            self._worker.close()

    def _ask_to_stop(self, job: Request, patience: float) -> None:
        now = time.monotonic()
        job.ends_at = min(job.ends_at, now + patience)
        if job.stop_asked is None and self._worker is not None:
            job.stop_asked = now
            self._worker.stop.value = 1

    def _send_next(self) -> None:
        if self.current is None and self._waiting:
            users = (kind for kind, job in self._waiting.items() if not job.is_spare)
            first = next(users, next(iter(self._waiting)))  # a spare one gives way here, too
            job = self.current = self._waiting.pop(first)
            job.started = time.monotonic()
            self._worker = self._worker or Worker(self._warm, self._wake)
            self._worker.stop.value = 0
            placed = self.elsewhere.placed(job.function) if self.elsewhere else job.function
            self._worker.send(job, placed)

    def _restart(self) -> None:
        """Another process, which knows nothing of what was read before."""
        assert self._worker is not None
        self._deaths = 0 if self._worker.has_answered else self._deaths + 1
        self._worker.close()
        self._worker = Worker(self._warm, self._wake) if self._deaths < TRIES else None

    def _take(self, what: str, number: int, value: Any) -> None:
        job = self.current
        if what == "gone":
            self._crash(job)
            return
        assert self._worker is not None
        self._worker.has_answered = True
        if job is None or number != job.number:
            return  # an answer of a process that was ended
        if what == PROGRESS:
            job.fraction, job.note = value
        elif what == "cancelled" or job.stop_asked is not None:
            self._finish(job, job.cancelled)
        elif what == "failed" and self._comes_back(job, value):
            self._finish(job, lambda: self._again(job))  # here, this time
        elif what == "failed":
            value.write_log(job.title)
            self._finish(job, lambda: self._fail(job, value))
        else:
            self._finish(job, lambda: self._accept(job, value))

    def _comes_back(self, job: Request, error: JobError) -> bool:
        """Whether a server gave no answer."""
        asked = self.elsewhere
        return asked is not None and asked.takes_back(job.function, error.name, error.sentence)

    def _crash(self, job: Request | None) -> None:
        """The process ended by itself, or someone ended it."""
        log.error("The worker process ended unexpectedly")
        self._restart()
        if job is not None and job.stop_asked is not None:
            self._finish(job, job.cancelled)
        elif job is not None:
            sentence = f"{job.title} stopped: the worker process ended unexpectedly"
            error = JobError("Crash", sentence, sentence, may_pass=True)
            self._finish(job, lambda: self._fail(job, error))
        if self._worker is not None:
            self.restarted()

    def _finish(self, job: Request, tell: Callable[[], None]) -> None:
        self.current = None
        is_replaced = job.kind in self._waiting
        if is_replaced:  # it is not the user's question any more
            job.replaced()
        else:
            tell()
        self._send_next()


def work(connection: Connection, stop: Any, warm: tuple[str, ...], crashes: Path | None) -> None:
    """The worker's main loop; ends with the pipe."""
    _lower_priority()
    if crashes is not None:
        note_crashes(crashes)
    for module in warm:
        importlib.import_module(module)
    reader, writer = PipeReader(connection), PipeWriter(connection, kept=0)
    while True:
        try:
            number, function, arguments = reader.read()
        except (EOFError, OSError, KeyboardInterrupt):
            # At once: native libraries' threads still run, and what an orderly end takes from
            # under them may end in a fault. Nothing is left to be written.
            os._exit(0)
        try:
            answer = "done", number, function(*arguments, progress=_reporter(writer, number, stop))
        except Cancelled:
            answer = "cancelled", number, None
        except Exception as error:
            answer = "failed", number, JobError.of(error, function.__name__)
        try:
            writer.write(answer)
        except BrokenPipeError:  # the window was killed: nobody is there to listen
            os._exit(0)
        except Exception as error:  # such as an answer that cannot be sent
            writer.write(("failed", number, JobError.of(error, function.__name__)))
        del arguments, answer  # gigabytes, maybe, that would wait here for the next request


def _lower_priority() -> None:
    """A drag must not stutter because a lift runs."""
    if sys.platform != "win32":
        os.nice(15)


def _reporter(writer: PipeWriter, number: int, stop: Any) -> Callable[[float, str], None]:
    last = ""
    last_time = 0.0

    def progress(fraction: float, note: str) -> None:
        nonlocal last, last_time
        if stop.value:
            raise Cancelled
        now = time.monotonic()
        if note != last or now - last_time > REPORT_EVERY:
            last, last_time = note, now
            writer.write((PROGRESS, number, (float(fraction), note)))

    return progress
