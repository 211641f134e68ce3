"""Large arrays that were sent to a server, by their SHA-256; the least recently used go first."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterable


class Blobs:
    """A bounded memory, for many threads."""

    def __init__(self, most: int) -> None:
        """`most`: bytes in all."""
        self._most = most
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._size = 0
        self._lock = threading.Lock()

    def add(self, name: str, body: bytes) -> None:
        """Keeps `body`; what was not used for longest is dropped where it does not fit."""
        with self._lock:
            if name not in self._kept:
                self._size += len(body)
            self._kept[name] = body
            self._kept.move_to_end(name)
            while self._size > self._most and len(self._kept) > 1:
                self._size -= len(self._kept.popitem(last=False)[1])

    def found(self, names: Iterable[str]) -> dict[str, bytes]:
        """Those of `names` that are here."""
        with self._lock:
            here = [name for name in names if name in self._kept]
            for name in here:
                self._kept.move_to_end(name)
            return {name: self._kept[name] for name in here}

    @property
    def size(self) -> int:
        """Bytes."""
        return self._size
