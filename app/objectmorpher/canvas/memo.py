"""Results remembered by the identity of what they came from."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

PLAIN = (int, float, str, bool)
KEPT = 6  # results remembered of each kind, usually


class Memo:
    """The last few results of one function, by the identity of what they came from."""

    def __init__(self, kept: int = KEPT) -> None:
        self._least = self._kept = kept
        self._results: OrderedDict[tuple[int, ...], tuple[tuple[Any, ...], Any]] = OrderedDict()

    def __call__(self, build: Callable[[], T], *sources: Any) -> T:
        key = tuple(id(s) for s in sources)
        if key not in self._results:
            # The sources are held, so that no other object can get their ids.
            self._results[key] = (sources, build())
            while len(self._results) > self._kept:
                self._results.popitem(last=False)
        self._results.move_to_end(key)
        return self._results[key][1]

    def make_room(self, count: int) -> None:
        """So many are asked for in turns: fewer that are kept would all be computed each time."""
        self._kept = max(self._least, count)


def same(a: Any, b: Any) -> bool:
    """Whether two values are the same: plain ones by what they are, the document's by identity."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return isinstance(a, PLAIN) and a == b
