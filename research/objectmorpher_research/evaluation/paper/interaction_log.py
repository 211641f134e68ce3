"""The log of a method editing a photo, and from it how soon it answers and how long it computes.

The paper's RI, real-time interaction, is whether one sees at once what a click or a drag does; its
MT, model inference time, how long the computing takes. Neither is typed in here: both are read from
a log of one JSON object a line, with times of one clock in seconds,

    {"t": 0.00, "event": "begin", "what": "lift"}       the method computes
    {"t": 2.10, "event": "end", "what": "lift"}
    {"t": 5.02, "event": "input", "what": "drag"}       a click, a drag's move, a key
    {"t": 5.03, "event": "feedback"}                    its result, or a part of it, is shown

or from the report of `objectmorpher edit --report`, which knows the computing only, and from the
frames of our own window (`--frame-log`), which know how soon a drag is seen.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..error import EvaluationError

INPUT, FEEDBACK, BEGIN, END = "input", "feedback", "begin", "end"
MOST_BYTES = 64 << 20
# The limits below which an answer seems immediate, and a train of thought is not broken:
# Miller, Response time in man-computer conversational transactions, 1968; Nielsen 1993, 5.5.
IMMEDIATE, UNBROKEN = 0.1, 1.0  # s
# Stages of our report in which something is computed; loading and saving are files.
COMPUTING = ("segment", "lift", "graph", "deform", "inpaint", "render", "refine")


@dataclass(frozen=True)
class Event:
    """One line of the log."""

    t: float  # s
    kind: str
    what: str = ""


@dataclass(frozen=True)
class Recorded:
    """A log's record of one edit."""

    latencies: tuple[float, ...]  # s, of each input until it is answered; inf: never
    computing: float | None  # s; None: it is unknown

    @property
    def latency(self) -> float | None:
        """Seconds within which 95 % of the inputs were answered; None where there are none."""
        if not self.latencies:
            return None
        return float(np.quantile(self.latencies, 0.95, method="higher"))


def read_recorded(path: Path) -> Recorded:
    """Read a .jsonl log or our own report. Raises EvaluationError: one sentence."""
    text = _text_of(path)
    try:
        return of_events(_events(text)) if path.suffix == ".jsonl" else _of_report(text)
    except EvaluationError as error:
        raise EvaluationError(f"{path}: {error}") from error


def read_frames(path: Path) -> tuple[float, ...]:
    """Read the latencies of drags in a window's frame log, s. Raises EvaluationError.

    A pointer's move is taken to have come just after the frame before had looked for events: no
    latency is told too small, and each up to a frame too large.
    """
    text = _text_of(path)
    try:
        frames = json.loads(text)
        told = [(f["began"], f["shown"], (f["x"], f["y"]), f["is_stroke"]) for f in frames]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise EvaluationError(f"{path} is no frame log of the window") from error
    if not all(_is_seconds(began) and _is_seconds(shown) for began, shown, _, _ in told):
        raise EvaluationError(f"{path} is no frame log of the window")
    return tuple(
        shown - before
        for (before, _, last, _), (_, shown, pointer, is_stroke) in pairwise(told)
        if is_stroke and pointer != last
    )


def _text_of(path: Path) -> str:
    """Raises EvaluationError."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise EvaluationError(f"{path} has more than {MOST_BYTES >> 20} MB")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise EvaluationError(f"{path} cannot be read") from error


def of_events(events: Sequence[Event]) -> Recorded:
    """An input is answered by the first feedback after it; a time counts once, however many
    stages run in it."""
    waiting: list[float] = []
    latencies: list[float] = []
    for event in events:
        if event.kind == INPUT:
            waiting.append(event.t)
        elif event.kind == FEEDBACK:
            latencies += [event.t - t for t in waiting]
            waiting.clear()
    latencies += [math.inf] * len(waiting)
    return Recorded(tuple(latencies), _computing(events))


def encode_events(events: Iterable[Event]) -> bytes:
    """The lines of a log."""
    lines = [
        json.dumps({"t": round(e.t, 6), "event": e.kind} | ({"what": e.what} if e.what else {}))
        for e in events
    ]
    return ("\n".join(lines) + "\n").encode()


def _computing(events: Sequence[Event]) -> float | None:
    """Seconds in which at least one stage ran."""
    running: list[str] = []
    total, since, is_told = 0.0, 0.0, False
    for event in events:
        if event.kind == BEGIN:
            since = since if running else event.t
            running.append(event.what)
            is_told = True
        elif event.kind == END:
            if event.what not in running:
                raise EvaluationError(f"{event.what!r} ends before it begins")
            running.remove(event.what)
            total += 0.0 if running else event.t - since
    if running:
        raise EvaluationError(f"{running[0]!r} begins and does not end")
    return total if is_told else None


def _events(text: str) -> list[Event]:
    events: list[Event] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            event = _event(line, number)
            if events and event.t < events[-1].t:
                raise EvaluationError(f"line {number} is before the line above it")
            events.append(event)
    if not events:
        raise EvaluationError("the log is empty")
    return events


def _event(line: str, number: int) -> Event:
    try:
        told = json.loads(line)
        t, kind, what = told["t"], told["event"], told.get("what", "")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise EvaluationError(f'line {number} is not {{"t": s, "event": ...}}') from error
    if not _is_seconds(t):
        raise EvaluationError(f"line {number}: {t!r} is no time in seconds")
    if kind not in (INPUT, FEEDBACK, BEGIN, END) or not isinstance(what, str):
        raise EvaluationError(f"line {number}: {kind!r} is no event of a log")
    return Event(float(t), kind, what)


def _of_report(text: str) -> Recorded:
    try:
        seconds = json.loads(text)["seconds"]
        taken = [seconds[stage] for stage in COMPUTING]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise EvaluationError("it is no report of objectmorpher edit") from error
    if not all(_is_seconds(t) and t >= 0 for t in taken):
        raise EvaluationError("its seconds are none")
    return Recorded((), float(sum(taken)))


def _is_seconds(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and abs(value) < 1e12  # also no nan
