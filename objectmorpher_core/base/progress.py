"""How a long computation tells how far it is, and how it is told to stop."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""progress(fraction in [0, 1], note). It may raise `Cancelled`, which computations let pass."""


class Cancelled(Exception):
    """The user asked for the running computation to stop."""


def silent(fraction: float, note: str) -> None:
    """The Progress of a caller that does not want to know."""


def part(progress: Progress, start: float, end: float) -> Progress:
    """`progress` for a step that fills only the range start..end of the whole."""
    return lambda fraction, note: progress(start + (end - start) * fraction, note)
