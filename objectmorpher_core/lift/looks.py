"""The last looks of a network: to lift the same thing with another thickness needs no new one."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

import numpy as np

Answer = TypeVar("Answer")


class Looks(Generic[Answer]):
    """What was seen last. It is known by the digest of the pixels, so no photo is held on to."""

    def __init__(self, kept: int = 1) -> None:
        self._lock, self._kept = Lock(), kept
        self._answers: OrderedDict[bytes, Answer] = OrderedDict()

    def get(self, look: Callable[[], Answer], *seen: np.ndarray, about: str = "") -> Answer:
        """Return the answer to what is `seen` and to `about`; `look` gives one that is new."""
        known = hashlib.sha256(f"{about} {[part.shape for part in seen]}".encode())
        for part in seen:
            known.update(np.ascontiguousarray(part).data)
        digest = known.digest()
        with self._lock:
            if digest not in self._answers:
                self._answers[digest] = look()
            while len(self._answers) > self._kept:
                self._answers.popitem(last=False)
            return self._answers[digest]
