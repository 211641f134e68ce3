"""Output that libraries print about a file, sent to the log and not to the user.

libtiff and OpenCV write to the file descriptor itself, past `sys.stderr`. It is redirected for as
long as something is read, for all threads: their output is logged, too.
"""

from __future__ import annotations

import logging
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock
from typing import IO

log = logging.getLogger(__name__)

STDERR = 2
MOST = 4000  # characters of it that are logged


@contextmanager
def logged_output(what: str) -> Iterator[None]:
    """Logs what is printed on stderr inside, as about `what`; nothing of it is shown."""
    _capture.begin(what)
    try:
        yield
    finally:
        _capture.end()


class _Capture:
    """The redirected descriptor; the first that reads begins it, and the last one ends it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._readers, self._what = 0, ""
        self._saved: int | None = None
        self._file: IO[bytes] | None = None

    def begin(self, what: str) -> None:
        with self._lock:
            self._readers += 1
            if self._readers == 1:
                self._what = what
                self._redirect()

    def end(self) -> None:
        with self._lock:
            self._readers -= 1
            text = self._restored() if self._readers == 0 else ""
        if text:
            log.info("About %s: %s", self._what, text[:MOST])

    def _redirect(self) -> None:
        """Where there is no room for a file, or no stderr, everything stays as it is."""
        with suppress(OSError):
            file = tempfile.TemporaryFile()  # noqa: SIM115  closed when it was read
            try:
                _flush()
                self._saved = os.dup(STDERR)
                os.dup2(file.fileno(), STDERR)
            except OSError:
                file.close()
                raise
            self._file = file

    def _restored(self) -> str:
        """What was printed."""
        file, saved, self._file, self._saved = self._file, self._saved, None, None
        if saved is not None:
            _flush()
            os.dup2(saved, STDERR)
            os.close(saved)
        if file is None:
            return ""
        with file:
            file.seek(0)
            return file.read(MOST).decode(errors="replace").strip()


def _flush() -> None:
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.flush()


_capture = _Capture()
