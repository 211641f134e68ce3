"""What nobody needs any more goes back to the system, not only to this program's next needs."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import sys


def give_back() -> None:
    """A tenth of a second; where a document of gigabytes was closed.

    The C library keeps freed pieces for later: after some openings of a session they were as much
    memory again as what was alive.
    """
    gc.collect()  # parts that know each other would stay for a while
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library than glibc
            ctypes.CDLL("libc.so.6").malloc_trim(0)
