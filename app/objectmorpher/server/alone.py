"""Serves from this very process, one job after the other: no Ray, no GPU scheduling."""

from __future__ import annotations

import threading

from objectmorpher_core.base.progress import Cancelled, Progress

from ..worker.stages import STAGES
from .offers import Offers, look_at_offers
from .running import Call, JobOutcome, perform
from .table import Served

WAIT = 0.1  # s between two looks at whether a waiting call is still wanted


class Alone:
    """A queue of one place: job functions remember their last photo and are not thread-safe."""

    def __init__(self, stages: tuple[str, ...] = STAGES) -> None:
        self._stages = stages
        self._turn = threading.Lock()
        self._offers: Offers | None = None

    def stages(self) -> dict[str, int]:
        return dict.fromkeys(self._stages, 1)

    def offers(self) -> Offers:
        if self._offers is None:
            found = look_at_offers()
            self._offers = {stage: found[stage] for stage in self._stages}
        return self._offers

    def run(self, call: Call, served: Served, tell: Progress, stop: threading.Event) -> JobOutcome:
        while not self._turn.acquire(timeout=WAIT):
            if stop.is_set():
                raise Cancelled
        try:
            tell(0.0, "")
            return perform(call, served, tell, stop.is_set)
        finally:
            self._turn.release()

    def close(self) -> None:
        """Close; nothing was started."""
