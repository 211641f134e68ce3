"""Each fault at each operation: what it is, and what must be true afterwards."""

from __future__ import annotations

import errno
import importlib
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from .scenarios import NEW, OLD, Scenario, check_picture
from .tracer import PASS, Answer, Decide, Operation, Outcome, watch

TAKES_ROOM = ("write", "pwrite", "writev", "sendfile", "copy_file_range", "fallocate", "mkdir",
              "mkdirat", "link", "linkat")  # fmt: skip
REMOVES = ("unlink", "unlinkat", "rmdir")


def _is_new(op: Operation) -> bool:
    return op.name == "openat" and bool(op.flags & os.O_CREAT)


def _is_change(op: Operation) -> bool:
    return op.name != "openat" or bool(op.flags & (os.O_CREAT | os.O_WRONLY | os.O_RDWR))


def _once(number: int) -> Callable[[int], Decide]:
    return lambda n: lambda k, op: Answer(error=number) if k == n else PASS


def _full(n: int) -> Decide:
    return lambda k, op: (
        Answer(error=errno.ENOSPC) if k >= n and (op.name in TAKES_ROOM or _is_new(op)) else PASS
    )


def _read_only(n: int) -> Decide:
    return lambda k, op: Answer(error=errno.EROFS) if k >= n and _is_change(op) else PASS


def _short(then: Answer) -> Callable[[int], Decide]:
    """Half of a write is taken; `then` is what becomes of the operation after it."""

    def of(n: int) -> Decide:
        cut: list[int] = []  # n, once a write was

        def decide(k: int, op: Operation) -> Answer:
            if k == n and op.name == "write" and len(op.data) > 1:
                cut.append(k)
                return Answer(length=len(op.data) // 2, is_killed=then.is_killed)
            return then if cut and k == n + 1 and not then.is_killed else PASS

        return decide

    return of


FAULTS: dict[str, Callable[[int], Decide]] = {
    "I/O error": _once(errno.EIO),
    "no permission": _once(errno.EACCES),
    "interrupted": _once(errno.EINTR),
    "disk full from there on": _full,
    "read-only from there on": _read_only,
    "short write": _short(PASS),
    "short write, then full": _short(Answer(error=errno.ENOSPC)),
    "killed": lambda n: lambda k, op: Answer(is_killed=True) if k == n else PASS,
    "killed after half a write": _short(Answer(is_killed=True)),
}


WRITES = {name for name in FAULTS if "write" in name}  # which do nothing to another operation


@dataclass
class Result:
    """What became of one scenario."""

    name: str
    runs: dict[str, int] = field(default_factory=dict)  # by fault
    operations: int = 0  # of a run without faults
    ends: dict[str, int] = field(default_factory=dict)  # how many runs ended so
    wrong: list[str] = field(default_factory=list)


def inject(
    scenario: Scenario, faults: list[str], most: int | None = None, shift: int = 0
) -> Result:
    """Every fault at every operation of a scenario; of a long one at `most` so many, evenly.

    `shift`: at others of them, so that scenarios that write alike have all of them together.
    """
    result = Result(scenario.name)
    with tempfile.TemporaryDirectory() as scratch:
        bench = _Bench(scenario, Path(scratch))
        clean = bench.run(lambda k, op: PASS)
        result.operations = len(clean.operations)
        if clean.error or bench.state() != NEW:
            result.wrong.append(f"without a fault: {clean.error or bench.state()}\n{clean.trace}")
            return result
        step = max(-(-result.operations // most), 1) if most else 1
        for phase, fault in enumerate(faults, shift):
            for n, op in enumerate(clean.operations, 1):
                if (n + phase) % step:  # of the next fault other operations
                    continue
                if fault in WRITES and not (op.name == "write" and len(op.data) > 1):
                    continue
                outcome = bench.run(FAULTS[fault](n))
                result.runs[fault] = result.runs.get(fault, 0) + 1
                problem, end = bench.judge(outcome, fault, n)
                result.ends[end] = result.ends.get(end, 0) + 1
                if problem:
                    what = outcome.operations[n - 1]
                    about = f"{what.name} {Path(what.path).name}"
                    result.wrong.append(f"{fault} at operation {n} ({about}): {problem}")
    return result


class _Bench:
    """The folder of a scenario, made anew for each run."""

    def __init__(self, scenario: Scenario, scratch: Path) -> None:
        self._scenario = scenario
        self._seen: set[str] = set()  # states that were drawn
        self._work, self._kept = scratch / "work", scratch / "kept"
        self._work.mkdir()
        scenario.prepare(self._work)
        shutil.copytree(self._work, self._kept)

    def run(self, decide: Decide) -> Outcome:
        shutil.rmtree(self._work)
        shutil.copytree(self._kept, self._work)
        return watch(lambda: self._scenario.act(self._work), self._work, decide)

    def state(self) -> str:
        return self._scenario.state(self._work)

    def _look(self, state: str) -> None:
        """Equal documents need not be drawn again and again: once for each state."""
        opened = self._scenario.opened
        if opened is not None and state not in self._seen:
            self._seen.add(state)
            check_picture(lambda: opened(self._work))

    def judge(self, outcome: Outcome, fault: str, n: int) -> tuple[str, str]:
        """What is wrong after a run, if anything; and how it ended."""
        own = self._scenario
        try:
            state = self.state()
            self._look(state)
        except Exception as error:
            return f"{type(error).__name__}: {error}", "lost"
        if outcome.is_killed:
            problem = "" if state in {OLD, NEW, *own.between} else f"it is {state}"
            return problem or self._again(), f"killed, {state}"
        if outcome.error:
            problem = self._refused(outcome, state)
        else:
            is_told = state == NEW or (not own.tells and state == OLD)
            problem = "" if is_told else f"no error, and it is {state}"
        problem = problem or self._leftovers(outcome, fault, n) or self._again()
        return problem, f"{'refused' if outcome.error else 'done'}, {state}"

    def _refused(self, outcome: Outcome, state: str) -> str:
        """An error must be the product's own, one sentence, and mean that it changed nothing."""
        where, _, sentence = outcome.error.partition(": ")
        module, _, name = where.rpartition(".")
        kind = getattr(importlib.import_module(module), name)
        if not issubclass(kind, self._scenario.refusals):
            return f"it raised {outcome.error}\n{outcome.trace}"
        if not sentence or "\\n" in sentence:
            return f"no sentence: {outcome.error}"
        if state != self._scenario.refused(sentence) and "changed already" not in sentence:
            return f"it said {sentence!r}, and it is {state}"
        return ""

    def _leftovers(self, outcome: Outcome, fault: str, n: int) -> str:
        """Temporary files that stay, although they could be removed."""
        is_stuck = fault.startswith("read-only") or outcome.operations[n - 1].name in REMOVES
        if is_stuck or "*" in self._scenario.files:
            return ""
        found = {str(p.relative_to(self._work)) for p in self._work.rglob("*") if p.is_file()}
        more = found - self._scenario.files
        return f"left behind: {sorted(more)}" if more else ""

    def _again(self) -> str:
        """Without a fault it succeeds, whatever lies around from the time before."""
        outcome = watch(lambda: self._scenario.act(self._work), self._work)
        if outcome.error:
            return f"the next try failed: {outcome.error}\n{outcome.trace}"
        try:
            return "" if self.state() == NEW else "the next try did not write"
        except Exception as error:
            return f"after the next try: {type(error).__name__}: {error}"
