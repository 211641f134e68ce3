"""One process of a stage on a cluster: runs a call at a time, and tells how far it is."""

from __future__ import annotations

import asyncio
import os
import platform
import threading
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from objectmorpher_core.base.progress import Cancelled

from .running import Call, Outcome, perform
from .table import table

BEAT = 0.1  # s between two looks at a running job
STARTED, PROGRESS, DONE = "started", "progress", "done"  # what it tells


class Replica:
    """What Ray Serve starts, as often as the plan says."""

    def __init__(self) -> None:
        # One thread: job functions remember their last photo, and are not made for two at a time.
        self._thread = ThreadPoolExecutor(1)

    async def run(
        self, name: str, body: bytes, blobs: dict[str, Any]
    ) -> AsyncIterator[tuple[str, Any]]:
        """Tells the place, then steps, then the outcome; `blobs` are references to Ray's store.

        When the stream is closed the job is asked to stop.
        """
        stop = threading.Event()
        steps: list[tuple[float, str]] = []

        def work() -> Outcome | None:
            import ray

            arrays: Any = {key: ray.get(reference) for key, reference in blobs.items()}
            call = Call(name, body, arrays)
            try:
                return perform(call, table()[name], lambda *s: steps.append(s), stop.is_set)
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
