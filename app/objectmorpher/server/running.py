"""What a server can run, and the runners of a served function: a process, or a cluster."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from objectmorpher_core.base.progress import Cancelled, Progress

from ..editor.settings import AUTO, STAGES, by_stage
from ..worker.requests import JobError
from .message import MessageError, decode, encode
from .table import Served, types

# Serves from this very process, one job after the other: no Ray, no GPU scheduling.

WAIT = 0.1  # s between two looks at whether a waiting call is still wanted


# Which backends a server can run, and which of them "auto" is there.

MOST_NAMES = 64  # of a stage's backends that a server may name
MOST_LETTERS = 48


@dataclass(frozen=True)
class Offer:
    """The backends that can be asked for in a stage."""

    auto: str  # the backend that "auto" is; empty: none can run
    able: tuple[str, ...]


Offers = dict[str, Offer]  # by stage


def look_at_offers() -> Offers:
    """Return the offers of this machine; may load PyTorch to ask for a GPU."""
    from objectmorpher_core import doctor

    found = by_stage(doctor.look_at_stages())
    return {stage: Offer(looked.auto, looked.able) for stage, looked in found.items()}


def told_offers(offers: Offers) -> dict[str, Any]:
    return {stage: asdict(offer) for stage, offer in offers.items()}


def read_offers(told: Any) -> Offers:
    """Read a server's offers; those of another form are left out."""
    if not isinstance(told, dict):
        return {}
    return {stage: _offer(told[stage]) for stage in STAGES if isinstance(told.get(stage), dict)}


def _offer(told: dict[str, Any]) -> Offer:
    auto, able = told.get("auto"), told.get("able")
    names = able[:MOST_NAMES] if isinstance(able, list) else []
    fitting = tuple(name for name in names if _is_name(name))
    return Offer(next((name for name in fitting if name == auto), ""), fitting)


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) <= MOST_LETTERS and value.isprintable()


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


@dataclass(frozen=True)
class Call:
    """A request that was looked at, as it came over the wire."""

    name: str  # of the table
    body: bytes
    blobs: Mapping[str, bytes]
    at_hand: str = AUTO  # what the process should have that runs it, see `Served.at_hand`


@dataclass(frozen=True)
class JobOutcome:
    """The answer's bytes, or why there is none."""

    body: bytes = b""
    error: str = ""  # one sentence
    is_expected: bool = False  # the request was at fault, not the server


class Runner(Protocol):
    """Runs one call after the other, or several at a time."""

    def stages(self) -> dict[str, int]:
        """Stage -> how many calls of it may run at a time."""
        ...

    def offers(self) -> Offers:
        """Which backends can run."""
        ...

    def run(self, call: Call, served: Served, tell: Progress, stop: threading.Event) -> JobOutcome:
        """Blocks until the outcome is there. Raises Cancelled soon after `stop` is set."""
        ...


def perform(
    call: Call, served: Served, tell: Callable[[float, str], None], is_stopped: Callable[[], bool]
) -> JobOutcome:
    """Runs a call here. Raises Cancelled."""

    def progress(fraction: float, note: str) -> None:
        if is_stopped():
            raise Cancelled
        tell(float(fraction), str(note))

    try:
        arguments: Any = served.checked(decode(call.body, types(), call.blobs))
        answer = served.function(*arguments, progress=progress)
        return JobOutcome(encode(answer, types()).body)
    except Cancelled:
        raise
    except MessageError as error:
        return JobOutcome(error=str(error), is_expected=True)
    except Exception as error:
        told = JobError.of(error, call.name)
        told.write_log(call.name)
        return JobOutcome(error=told.sentence, is_expected=told.is_expected)
