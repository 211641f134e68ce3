"""The stages' processes on Ray Serve, and how calls get to them.

A call carries as Serve's multiplexed model id what its process should have at hand: for a click the
hash of its photo, so that it reaches the process that has read it; else the backend, whose networks
are loaded there. Where that process is busy another one takes the call. How many photos a process
remembers is Serve's to keep to; what of its networks stays in memory is the ledger's.
"""

from __future__ import annotations

import asyncio
import logging
import os
import platform
import threading
from collections import OrderedDict
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, cast

from objectmorpher_core.base.progress import Cancelled, Progress
from objectmorpher_core.models import device

from ..system.logs import show_log
from ..worker import job_functions
from ..worker.job_functions import PhotoMemory
from .running import Call, JobOutcome, Offers, perform
from .table import Served, Table

log = logging.getLogger(__name__)

TRIES = 3  # processes that a call may cost
KEPT = 8  # large arrays in Ray's store
PHOTOS = 4  # that a process has read and remembers
WAIT = 0.1  # s between two looks at whether a call is still wanted
BEAT = 0.1  # s between two looks at a running job
STARTED, PROGRESS, DONE = "started", "progress", "done"  # what a process reports of a job


class Stages:
    """Runs calls in the stages' processes."""

    def __init__(self, handles: Mapping[str, Any], offers: Offers, most: int) -> None:
        """`handles`: of each stage's deployment; `most`: processes of each."""
        self._handles, self._offers, self._most = handles, offers, most
        self._stored: OrderedDict[str, Any] = OrderedDict()  # name -> reference
        self._lock = threading.Lock()

    def stages(self) -> dict[str, int]:
        """See `Runner`."""
        return dict.fromkeys(self._handles, self._most)

    def offers(self) -> Offers:
        """See `Runner`."""
        return self._offers

    def run(self, call: Call, served: Served, tell: Progress, stop: threading.Event) -> JobOutcome:
        """See `Runner`."""
        from ray import exceptions

        lost = exceptions.RayActorError, exceptions.WorkerCrashedError, exceptions.ObjectLostError
        for _ in range(TRIES):
            try:
                return self._try(call, served, tell, stop)
            except lost as error:
                if stop.is_set():
                    raise Cancelled from error
                log.warning("%s lost its process; it is run again", call.name)
                self._forget(call)
                tell(0.0, "once more, in another process")
        return JobOutcome(error=f"{call.name} has ended {TRIES} processes of the server")

    def _try(self, call: Call, served: Served, tell: Progress, stop: threading.Event) -> JobOutcome:
        """Raises one of Ray's errors where the process is lost."""
        from ray import exceptions

        handle = self._handles[served.stage].options(
            stream=True, multiplexed_model_id=call.at_hand
        )  # fmt: skip
        stream: Any = handle.run.remote(call.name, call.body, self._store(call))
        is_over = threading.Event()

        def watch() -> None:
            while not is_over.wait(WAIT):
                if stop.is_set():
                    stream.cancel()
                    return

        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        outcome: JobOutcome | None = None
        try:
            # To its end: until then Serve counts the process as busy, and sends others elsewhere.
            for item in stream:
                what, value = cast(tuple[str, Any], item)
                if what == DONE:
                    outcome = value
                    continue
                if stop.is_set():
                    raise Cancelled
                if what == STARTED:
                    log.info("%s runs on %s, process %d", call.name, *value)
                fraction, note = (0.0, "") if what == STARTED else value
                tell(fraction, note)
        except exceptions.TaskCancelledError as error:
            raise Cancelled from error
        finally:
            is_over.set()
            watcher.join()
            stream.cancel()  # of a job that goes on without us
        if outcome is None:  # it was cancelled there, or the stream closed without an outcome
            raise Cancelled
        return outcome

    def _store(self, call: Call) -> dict[str, Any]:
        """References to the call's large arrays in Ray's store, where each is put once."""
        import ray

        with self._lock:
            for name, body in call.blobs.items():
                if name not in self._stored:
                    self._stored[name] = ray.put(body)
                self._stored.move_to_end(name)
            found = {name: self._stored[name] for name in call.blobs}
            while len(self._stored) > max(KEPT, len(call.blobs)):
                self._stored.popitem(last=False)
            return found

    def _forget(self, call: Call) -> None:
        """What lay on a machine that is gone is put anew."""
        with self._lock:
            for name in call.blobs:
                self._stored.pop(name, None)


class StageProcess:
    """The class that Ray Serve starts as often as the plan says: runs a call at a time."""

    def __init__(self, table: Table, room: int) -> None:
        """`room`: bytes of the GPU's memory that it may take; 0: all."""
        from ray import serve

        show_log()
        self._table = table
        # One thread: job functions remember their photo, and are not made for two at a time.
        self._thread = ThreadPoolExecutor(1)
        device.keep_to(room)

        @serve.multiplexed(max_num_models_per_replica=PHOTOS)
        async def memory(at_hand: str) -> PhotoMemory:
            return PhotoMemory()  # empty at first; Serve lets the oldest go

        self._memory: Any = memory

    async def run(
        self, name: str, body: bytes, blobs: dict[str, Any]
    ) -> AsyncIterator[tuple[str, Any]]:
        """Tells the place, then steps, then the outcome; `blobs` are references to Ray's store.

        When the stream is closed the job is asked to stop.
        """
        import ray
        from ray import serve

        stop = threading.Event()
        steps: list[tuple[float, str]] = []
        memory = await self._memory(serve.get_multiplexed_model_id())

        def work() -> JobOutcome | None:
            arrays: Any = {key: ray.get(reference) for key, reference in blobs.items()}
            call = Call(name, body, arrays)
            job_functions.remember(memory)
            try:
                return perform(call, self._table[name], lambda *s: steps.append(s), stop.is_set)
            except Cancelled:
                return None

        yield STARTED, (platform.node(), os.getpid())
        job = asyncio.get_running_loop().run_in_executor(self._thread, work)
        try:
            while not job.done():
                await asyncio.wait({job}, timeout=BEAT)
                if steps:
                    step = steps[-1]
                    steps.clear()
                    yield PROGRESS, step
            yield DONE, job.result()
        finally:
            stop.set()
