"""What is told of a file that cannot be read, and what finding that out cost."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from objectmorpher_core.splat_files import SplatFileError, read

MOST_SECONDS = 10.0  # on a busy machine; most take a few milliseconds
MOST_MEMORY = 100 << 20  # bytes; the largest of the files has 40 MB


@contextmanager
def measured() -> Iterator[None]:
    """Holds what is done inside to MOST_SECONDS and MOST_MEMORY."""
    tracemalloc.start()
    start = time.process_time()
    try:
        yield
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert time.process_time() - start < MOST_SECONDS
    assert peak < MOST_MEMORY


def refusal(path: Path) -> str:
    """The sentence with which `read` refuses the file."""
    with measured(), pytest.raises(SplatFileError) as caught:
        read(path)
    told = str(caught.value)
    assert told.startswith(f"{path.name}: ")
    assert "\n" not in told
    assert len(told) < 300
    return told
