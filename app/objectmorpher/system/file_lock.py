"""A lock on a file that the system gives up with the process, however that ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import IO


class FileLock:
    """Held from `take` to `release`, or to the process's end."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    @classmethod
    def take(cls, path: Path) -> FileLock | None:
        """The lock, or None where another process or editor holds it. Raises OSError."""
        file = path.open("ab")
        try:
            _lock(file)
        except OSError:
            file.close()
            return None
        file.truncate(0)
        file.write(f"{os.getpid()}\n".encode())  # for people who look into the folder
        file.flush()
        return cls(file)

    def release(self) -> None:
        self._file.close()


if sys.platform == "win32":
    import msvcrt

    FAR = 1 << 30  # a byte beyond the file's end, so that others can still read what it holds

    def _lock(file: IO[bytes]) -> None:
        file.seek(FAR)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        file.seek(0)

else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
