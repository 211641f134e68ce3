"""Answers of networks about pictures: begun before they are asked for, and kept for the next time.

They are begun while modules are imported. Of the same photo they are asked for again by the next
edit of a batch, by a photo that is opened twice, or where a fill is computed anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import Future, wait
from threading import Lock
from typing import Any

import numpy as np

Answer = np.ndarray[Any, np.dtype[np.float32]]
WATCH_EVERY = 0.02  # s


class EarlyAnswers:
    """The last answers about pictures, and those that were begun; no picture is held on to."""

    def __init__(self, kept: int) -> None:
        """So many of them are `kept`."""
        self._kept, self._lock = kept, Lock()
        self._known: dict[bytes, Future[Answer]] = {}  # by the picture's digest, the oldest first

    def expect(self, picture: np.ndarray, compute: Callable[[], Answer]) -> Callable[[], None]:
        """From now on who asks about the picture waits until what is returned has been called."""
        begun: Future[Answer] = Future()
        self._keep(_digest(picture), begun)

        def run() -> None:
            try:
                begun.set_result(compute())
            except BaseException as error:
                begun.set_exception(error)

        return run

    def answer(
        self, picture: np.ndarray, compute: Callable[[], Answer], watch: Callable[[], None]
    ) -> Answer:
        """What is known or begun, or else what `compute` gives; the array is the caller's own.

        `watch` is called while one waits, at least once, and may end that by raising. What was
        begun and failed is computed anew, which tells whoever wants it the reason.
        """
        watch()
        key = _digest(picture)
        with self._lock:
            known = self._known.get(key)
        if known is not None:
            while not wait((known,), WATCH_EVERY).done:
                watch()
        if known is None or known.exception():
            known = Future()
            known.set_result(compute())
        self._keep(key, known)
        return known.result().copy()

    def _keep(self, key: bytes, answer: Future[Answer]) -> None:
        """It is the newest; the oldest one goes."""
        with self._lock:
            self._known.pop(key, None)
            self._known[key] = answer
            if len(self._known) > self._kept:
                del self._known[next(iter(self._known))]


def _digest(picture: np.ndarray) -> bytes:
    return hashlib.sha256(repr(picture.shape).encode() + picture.tobytes()).digest()
