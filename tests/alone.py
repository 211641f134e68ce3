"""One process of a run at a time, where several would do the same work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:
    fcntl = None  # Windows has none: there, two processes may do the same


@contextmanager
def alone(lock: Path) -> Iterator[None]:
    """Only one process at a time is here; a process that ends lets the next one in."""
    with lock.open("w") as file:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
