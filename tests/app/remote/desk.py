"""A window's jobs and the server that they may go to, in one process."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from objectmorpher.server.address import Address, Server
from objectmorpher.server.elsewhere import Elsewhere
from objectmorpher.server.front import Front
from objectmorpher.server.running import Alone, Call, JobOutcome
from objectmorpher.server.table import Served, table
from objectmorpher.worker import job_functions
from objectmorpher.worker.jobs import Jobs
from objectmorpher_core.base.arrays import frozen
from objectmorpher_core.base.progress import Progress

TOKEN = "a-token-that-is-long-enough"


class Counting(Alone):
    """Serves from this process, and knows what it was asked."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[str] = []

    def run(self, call: Call, served: Served, tell: Progress, stop: Any) -> JobOutcome:
        self.asked.append(call.name)
        return super().run(call, served, tell, stop)


class Desk:
    """A window's jobs, the server that they may go to, and what the status bar says."""

    def __init__(self, jobs: Jobs) -> None:
        """`jobs` are done by a worker process that starts in seconds: desks may share it."""
        self.runner = Counting()
        self.front = Front(("127.0.0.1", 0), TOKEN, self.runner, table())
        self.front.start()
        self.server: Server | None = Server(Address(*self.front.address), TOKEN)
        self.said: list[str] = []
        self.answers: list[Any] = []
        self.errors: list[Any] = []
        self.cancels = 0
        self.jobs = jobs
        self.elsewhere = Elsewhere(lambda: self.server, lambda server, why: self.said.append(why))
        self.jobs.elsewhere = self.elsewhere

    def _cancelled(self) -> None:
        self.cancels += 1

    def ask(self, function: Any, *arguments: Any) -> None:
        self.jobs.start(
            "Test", function, *arguments, done=self.answers.append, failed=self.errors.append,
            cancelled=self._cancelled,
        )  # fmt: skip

    def wait(self) -> None:
        end = time.monotonic() + 300  # a busy machine takes a minute to import PyTorch
        while not self.jobs.is_idle:
            assert time.monotonic() < end
            self.jobs.poll()
            time.sleep(0.01)

    def close(self) -> None:
        self.jobs.cancel()
        self.wait()
        self.front.close()


def fill() -> tuple:
    """What `fill_variants` is asked: a noisy photo (H, W, 3), its hole, 2 backgrounds."""
    random = np.random.default_rng(1)
    pixels = frozen(random.integers(90, 140, (90, 120, 3)).astype(np.uint8))
    hole = np.zeros((90, 120), bool)
    hole[30:60, 40:80] = True
    return pixels, frozen(hole), job_functions.BackendChoice("telea"), 2
