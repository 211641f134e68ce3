"""Undo: a list of documents and a cursor (ARCHITECTURE section 4).

Documents share what did not change, so a step costs what is new in it: kilobytes for a drag,
hundreds of megabytes for the lift of a large object. The oldest steps go when there are too many
of them, or when what they alone hold is too large.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

from objectmorpher_core.document import Document

DEPTH = 500  # steps
LIMIT = 1 << 30  # bytes that old steps may hold beside what the shown document holds


@dataclass(frozen=True, eq=False)
class Step:
    """A document, and what was done to get it."""

    label: str  # "Move handle"
    document: Document
    memory: Mapping[int, int] = field(default_factory=dict)  # id of a block of memory -> bytes


class History:
    """The documents since the file was opened, and which of them is shown."""

    def __init__(self, document: Document, limit: int = LIMIT) -> None:
        """`limit`: bytes."""
        self._steps: list[Step] = []
        self._memory: dict[int, int] = {}  # bytes of every block that a step holds
        self._holders: Counter[int] = Counter()  # how many steps hold it
        self._limit = limit
        self._cursor = 0
        self._saved: Document | None = document
        self._append("Open", document)

    @property
    def document(self) -> Document:
        return self._steps[self._cursor].document

    @property
    def steps(self) -> tuple[str, ...]:
        """What was done, oldest first; the first is what undoing everything leaves."""
        return tuple(step.label for step in self._steps)

    @property
    def cursor(self) -> int:
        """Which of the steps is shown."""
        return self._cursor

    @property
    def is_saved(self) -> bool:
        """Whether what is shown is what the file holds."""
        return self.document is self._saved

    def mark_saved(self, document: Document) -> None:
        """`document`, which may be an older one by now, is what the file holds."""
        self._saved = document

    def mark_unsaved(self) -> None:
        """No file holds any of this."""
        self._saved = None

    def apply(self, label: str, document: Document) -> None:
        """`document` is the next step; steps that were undone are forgotten."""
        if document is self.document:
            return
        for step in self._steps[self._cursor + 1 :]:
            self._let_go(step)
        del self._steps[self._cursor + 1 :]
        self._append(label, document)
        self._cursor = len(self._steps) - 1
        self._forget_oldest()

    def amend(self, document: Document) -> None:
        """`document` replaces the current one without a step: computed additions to it."""
        step = self._steps[self._cursor]
        if step.document is self._saved:
            self._saved = document
        self._let_go(step)
        self._steps[self._cursor] = self._taken(step.label, document)
        self._forget_oldest()

    @property
    def undo_label(self) -> str | None:
        """What `undo` would take back, or None."""
        return self._steps[self._cursor].label if self._cursor > 0 else None

    @property
    def redo_label(self) -> str | None:
        """What `redo` would do again, or None."""
        following = self._cursor + 1
        return self._steps[following].label if following < len(self._steps) else None

    def undo(self) -> None:
        self.jump(self._cursor - 1)

    def redo(self) -> None:
        self.jump(self._cursor + 1)

    def jump(self, index: int) -> None:
        """Shows the step at `index`, the nearest one where there is none."""
        self._cursor = min(max(index, 0), len(self._steps) - 1)

    # Memory

    @property
    def old_bytes(self) -> int:
        """What the steps hold beside what the shown document holds."""
        shown = self._steps[self._cursor].memory
        return sum(self._memory.values()) - sum(shown.values())

    def _forget_oldest(self) -> None:
        while self._cursor > 0 and (len(self._steps) > DEPTH or self.old_bytes > self._limit):
            self._let_go(self._steps.pop(0))
            self._cursor -= 1

    def _append(self, label: str, document: Document) -> None:
        self._steps.append(self._taken(label, document))

    def _taken(self, label: str, document: Document) -> Step:
        memory = dict(_blocks(document))
        self._memory |= memory
        self._holders.update(memory.keys())
        return Step(label, document, memory)

    def _let_go(self, step: Step) -> None:
        for key in step.memory:
            self._holders[key] -= 1
            if self._holders[key] == 0:
                del self._holders[key], self._memory[key]


def _blocks(value: Any) -> Iterator[tuple[int, int]]:
    """(id, bytes) of the memory behind every array and the file's bytes in a document."""
    if isinstance(value, np.ndarray):
        while isinstance(value.base, np.ndarray):  # views share the memory of another array
            value = value.base
        yield id(value), value.nbytes
    elif isinstance(value, bytes):
        yield id(value), len(value)
    elif is_dataclass(value):
        for f in fields(value):
            yield from _blocks(getattr(value, f.name))
    elif isinstance(value, tuple):
        for part in value:
            yield from _blocks(part)
