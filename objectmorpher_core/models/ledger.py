"""Who holds what of a device's memory: one book for all networks of a process.

A job says which model it wants and what that needs. The best way that can fit is chosen anew each
time: what other models hold counts as room, for the least recently used of them give way. A model
that is open in the way that was chosen is used again. Main memory is counted as the GPU's is.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from threading import RLock
from typing import Any, Generic, Protocol, TypeVar

from . import device
from .device import Device
from .plans import Needs, Plan
from .registry import ModelError

log = logging.getLogger(__name__)
T = TypeVar("T")
R = TypeVar("R")
SPARE = 0.9  # x free memory that may be used: blocks of memory have gaps
MORE = 1.1  # x the room in which a way was too large, from which on it is tried again


class Memory(Protocol):
    """What is asked of the machine; the module `device` does it."""

    def devices(self) -> tuple[Device, ...]: ...

    def free_memory(self, device: Device, /) -> int | None: ...

    def empty_cache(self, device: Device, /) -> None: ...


@dataclass(frozen=True)
class Model(Generic[T]):
    """What a job wants to use."""

    name: str  # of whom it is; one model of a name is open at a time
    made_of: Hashable  # files and adapters: another is opened anew
    need: Needs
    open: Callable[[Plan], T]


@dataclass(eq=False)
class _Entry:
    """A model in memory."""

    lock: Any = field(default_factory=RLock)  # one job at a time
    made_of: Hashable = None
    plan: Plan | None = None  # None: nothing is open
    value: Any = None
    used: int = 0
    jobs: int = 0  # that are running
    reserved: Plan | None = None  # of the running job

    def holds(self, where: Device) -> int:
        return 0 if self.plan is None else self.plan.holds(where)

    def claims(self, where: Device) -> int:
        """What the running job may still take, beside what is held."""
        if self.reserved is None:
            return 0
        return max(0, self.reserved.takes(where) - self.holds(where))


class Ledger:
    """See the module. Threads may share one."""

    def __init__(self, memory: Memory = device) -> None:
        """Nothing is open."""
        self._memory = memory
        self._entries: dict[str, _Entry] = {}
        self._lock = RLock()
        self._clock = count(1)
        self._full: dict[tuple[Hashable, Plan], int] = {}  # the room in which memory ran out

    def run(self, model: Model[T], job: Callable[[T, Plan], R]) -> R:
        """What `job(opened model, plan)` makes in the best way for which there is memory.

        Where memory runs out all the same, all others give way, and then the next way is taken.
        Raises ModelError: one sentence; what the job raises passes through.
        """
        with self._lock:
            entry = self._entries.setdefault(model.name, _Entry())
        failed: set[Plan] = set()
        with entry.lock, self._busy(entry):
            while True:
                plan, room = self._chosen(model, entry, failed)
                try:
                    return job(self._opened(model, entry, plan), plan)
                except Exception as error:
                    if not device.is_out_of_memory(error):
                        raise
                # Out of the handler: the error's frames held on to memory.
                if not self._ran_out(model, entry, plan, room):
                    failed.add(plan)

    def plan(self, model: Model[Any]) -> Plan:
        """The way in which a job would run now; nothing gives way yet. Raises ModelError."""
        with self._lock:
            return self._best(model, self._entries.get(model.name, _Entry()), set())[0]

    def opened(self, name: str) -> Any:
        """The open model of that name, or None."""
        entry = self._entries.get(name)
        return None if entry is None else entry.value

    def holds(self, where: Device) -> dict[str, int]:
        """Bytes that each model holds on a device."""
        with self._lock:
            held = {name: entry.holds(where) for name, entry in self._entries.items()}
            return {name: size for name, size in held.items() if size}

    def clear(self) -> None:
        """All models that no job uses are closed."""
        with self._lock:
            for entry in self._idle():
                self._close(entry)
            self._full.clear()

    @contextmanager
    def _busy(self, entry: _Entry) -> Iterator[None]:
        with self._lock:
            entry.jobs += 1
        try:
            yield
        finally:
            with self._lock:
                entry.jobs -= 1
                entry.reserved = None if entry.jobs == 0 else entry.reserved
                entry.used = next(self._clock)

    def _chosen(
        self, model: Model[Any], entry: _Entry, failed: set[Plan]
    ) -> tuple[Plan, int | None]:
        """The best way, for which the others have given way and memory is reserved."""
        with self._lock:
            without = set(failed)
            while True:
                plan, room = self._best(model, entry, without)
                if entry.plan is not None and (entry.made_of, entry.plan) != (model.made_of, plan):
                    self._close(entry)
                if self._make_room(entry, plan):
                    entry.reserved = plan
                    return plan, room
                without.add(plan)  # what gave way held less than it said

    def _best(
        self, model: Model[Any], entry: _Entry, without: set[Plan]
    ) -> tuple[Plan, int | None]:
        """The best way that fits once all idle models give way, and the room on its device."""
        devices = self._memory.devices()
        ways = [
            plan
            for name in devices
            if name != "cpu" or len(devices) == 1 or not model.need.is_slow_on_cpu
            for plan in model.need.on(name)
        ]
        fitting = [p for p in ways if p not in without and self._fits(p, entry)]
        if not fitting:
            raise ModelError(self._too_small(model, ways, entry))
        rooms = {p: self._room(p.device, entry, is_all=True) for p in fitting}
        # A way for which memory ran out is tried again where there is more, or nothing else.
        for plan, room in rooms.items():
            full = self._full.get((model.made_of, plan))
            if full is None or (room is not None and room > MORE * full):
                return plan, room
        return next(iter(rooms.items()))

    def _fits(self, plan: Plan, entry: _Entry) -> bool:
        for where in _places(plan):
            room = self._room(where, entry, is_all=True)
            if room is not None and plan.takes(where) > SPARE * room:
                return False
        return True

    def _room(self, where: Device, entry: _Entry, is_all: bool = False) -> int | None:
        """Bytes that `entry` can have on a device, its own too; `is_all`: and all that is idle."""
        free = self._memory.free_memory(where)
        if free is None:
            return None
        others = [e for e in self._entries.values() if e is not entry]
        free += entry.holds(where) - sum(e.claims(where) for e in others)
        if is_all:
            free += sum(e.holds(where) for e in others if e.jobs == 0)
        return free

    def _make_room(self, entry: _Entry, plan: Plan) -> bool:
        """Idle models are closed, the least recently used first, until the plan fits."""
        for where in _places(plan):
            while True:
                room = self._room(where, entry)
                if room is None or plan.takes(where) <= SPARE * room:
                    break
                idle = [e for e in self._idle() if e is not entry and e.holds(where)]
                if not idle:
                    return False
                self._close(min(idle, key=lambda e: e.used))
        return True

    def _idle(self) -> list[_Entry]:
        return [e for e in self._entries.values() if e.jobs == 0 and e.plan is not None]

    def _opened(self, model: Model[T], entry: _Entry, plan: Plan) -> T:
        if entry.plan is None:
            value = model.open(plan)
            with self._lock:
                entry.made_of, entry.plan, entry.value = model.made_of, plan, value
        return entry.value

    def _close(self, entry: _Entry) -> None:
        plan, entry.plan, entry.value = entry.plan, None, None
        if plan is not None:
            self._memory.empty_cache(plan.device)

    def _ran_out(self, model: Model[Any], entry: _Entry, plan: Plan, room: int | None) -> bool:
        """Memory was less than was thought; whether others have given way, so that it can go on."""
        with self._lock:
            self._close(entry)
            self._memory.empty_cache(plan.device)
            others = [e for e in self._idle() if e.holds(plan.device)]
            for other in others:
                self._close(other)
            log.warning("Memory ran out %s", plan.in_words)
            if not others:
                self._full[model.made_of, plan] = room or 0
            return bool(others)

    def _too_small(self, model: Model[Any], ways: list[Plan], entry: _Entry) -> str:
        """Why no way is left, as a sentence with numbers."""
        plan = min(ways, key=lambda way: way.peak)
        told = f"there is not enough memory {plan.in_words} for {model.name}"
        for where in _places(plan):
            room, takes = self._room(where, entry, is_all=True), plan.takes(where)
            if room is not None and takes > SPARE * room:
                what = f" of {device.NAMES[where]}" if where != plan.device else ""
                told += f": {takes / 2**30:.1f} GB{what} are needed, {room / 2**30:.1f} GB are free"
                break
        lacking = model.need.lacking()
        return f"{told}; {lacking}" if lacking else told


def _places(plan: Plan) -> tuple[Device, ...]:
    """Where it takes memory."""
    return ("cpu",) if plan.device == "cpu" else (plan.device, "cpu")


SHARED = Ledger()  # of this process
