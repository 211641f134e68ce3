"""A loop over pieces in all cores.

Compiled kernels release the interpreter lock and are called from ordinary threads: they compile
in a third of the time that numba's own parallel loops take, and wait for nobody.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

FAST = {"reassoc", "contract", "nsz"}  # of kernels: sums in any order, a * b + c at once
# Of kernels whose results are bytes of a picture. The process that compiles a kernel may run
# another copy of what it calls than one that loads it from the disk: both must round alike.
EXACT = {"nsz"}
LEAST_ROWS = 2048  # of a light kernel, for which a second thread is woken


def in_threads(
    run: Callable[[int, int], object], count: int, parts: int = 1, least: int = 1
) -> None:
    """Calls `run(first, last)` for consecutive pieces of range(count), `parts` per core.

    No piece is shorter than `least`: a few cheap rows are done before a thread wakes up.
    """
    pieces = min(max(core_count() * parts, 1), max(count // least, 1))
    bounds = [count * piece // pieces for piece in range(pieces + 1)]
    left = iter(pairwise(bounds))  # whoever is free takes the next one

    def work() -> None:
        for first, last in left:
            run(first, last)

    helpers = [_pool().submit(work) for _ in range(min(core_count(), pieces) - 1)]
    try:
        work()
    finally:
        for helper in helpers:
            if not helper.cancel():  # others may keep the pool from ever beginning
                helper.result()


@cache
def core_count() -> int:
    """Cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(core_count(), "kernel")
