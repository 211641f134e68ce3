"""Progress of a long computation, and its cancellation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

Progress = Callable[[float, str], None]
"""progress(fraction in [0, 1], note). It may raise `Cancelled`, which computations let pass."""


class Cancelled(Exception):
    """The user asked for the running computation to stop."""


def silent(fraction: float, note: str) -> None:
    """The Progress of a caller that does not want to know."""


def part(progress: Progress, start: float, end: float) -> Progress:
    """`progress` for a step that fills only the range start..end of the whole."""
    return lambda fraction, note: progress(start + (end - start) * fraction, note)


class Bar(Protocol):
    """A progress bar with the attributes of tqdm's: how much is done, and of how much."""

    n: Any
    total: Any

    def update(self, n: float | None = 1) -> object:
        """Count `n` more as done."""

    def set_description(self, desc: str | None = None, refresh: bool | None = True) -> None:
        """Name what is done now."""


PERCENT = 100  # the total of a bar that was given none


def as_progress(told: Progress | Bar | None) -> Progress:
    """The Progress that calls a function, moves a bar, or with None does nothing."""
    if told is None:
        return silent
    if callable(told):
        return told
    bar, total = told, told.total or PERCENT
    bar.total = total

    def move(fraction: float, note: str) -> None:
        bar.set_description(note, refresh=False)
        bar.update(round(fraction * total, 2) - bar.n)

    return move
