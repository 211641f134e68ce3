"""Return freed memory to the system instead of keeping it for this program's next needs."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import sys


def set_aside() -> None:
    """Exempt everything that exists now from garbage collection.

    To be called once, when all modules are there: looking through their 85,000 objects takes longer
    than a frame, here and whenever Python does so by itself.
    """
    gc.freeze()


def give_back() -> None:
    """Some milliseconds after `set_aside`; where a document of gigabytes was closed.

    The C library keeps freed pieces for later: after some openings of a session they were as much
    memory again as what was alive.
    """
    gc.collect()  # parts that know each other would stay for a while
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library than glibc
            ctypes.CDLL("libc.so.6").malloc_trim(0)
