"""Undo: a list of documents and a cursor.

Documents share what did not change, so a step costs what is new in it: kilobytes for a drag,
hundreds of megabytes for the lift of a large object. The oldest steps go when there are too many
of them, or when what they alone hold is too large. What a step costs in time does not grow with
the steps before it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from objectmorpher_core.document.model import Document

DEPTH = 10_001  # steps: a day's ten thousand edits, and the one that undoing them all leaves
LIMIT = 1 << 30  # bytes that old steps may hold beside what the shown document holds
CLOCK = count()  # what was done later has a higher number: steps, and strokes that are none yet


@dataclass(eq=False)
class Step:
    """A document, and what was done to get it; `History.amend` adds to the document."""

    label: str  # "Move handle"
    document: Document
    number: int = field(default_factory=lambda: next(CLOCK))


class History:
    """The documents since the file was opened, and which of them is shown."""

    def __init__(self, document: Document, limit: int = LIMIT) -> None:
        """`limit`: bytes."""
        self._steps: list[Step] = []
        self._memory = _Memory()
        self._limit = limit
        self._cursor = 0
        self._saved: Document | None = document
        self.snapshots: tuple[Step, ...] = ()  # by their names; no limit lets one go
        self._append("Open", document)

    @property
    def document(self) -> Document:
        return self.step.document

    @property
    def step(self) -> Step:
        """The step that is shown."""
        return self._steps[self._cursor]

    @property
    def steps(self) -> tuple[str, ...]:
        """Return the labels of all steps, oldest first; in the first everything is undone."""
        return tuple(step.label for step in self._steps)

    @property
    def cursor(self) -> int:
        """Which of the steps is shown."""
        return self._cursor

    @property
    def is_saved(self) -> bool:
        """Whether what is shown is what the file holds."""
        return self.document is self._saved

    def mark_saved(self, step: Step | None = None) -> None:
        """The file holds `step`, as it was when it was shown; None: the one that is shown.

        It may have been amended while the file was written: that comes back when it is opened.
        """
        self._saved = (step or self.step).document

    def mark_unsaved(self) -> None:
        """No file holds any of this."""
        self._saved = None

    def apply(self, label: str, document: Document) -> None:
        """`document` is the next step; steps that were undone are forgotten."""
        if document is self.document:
            return
        for step in self._steps[self._cursor + 1 :]:
            self._memory.let_go(step.document)
        del self._steps[self._cursor + 1 :]
        self._append(label, document)
        self._cursor = len(self._steps) - 1
        self._forget_oldest()

    def amend(self, document: Document, is_repeatable: bool = True) -> None:
        """`document` replaces the current one without a step: computed additions to it.

        `is_repeatable`: a file without them gets them when it is opened, so that what is saved
        stays saved. Else what is shown is not what the file holds.
        """
        step = self.step
        self._memory.let_go(step.document)
        if is_repeatable:
            self._saved = document if step.document is self._saved else self._saved
            step.document = document
        else:
            self._steps[self._cursor] = replace(step, document=document)
        self._memory.take(document)
        self._forget_oldest()

    @property
    def undo_label(self) -> str | None:
        """Return the label of the step that `undo` would take back, or None."""
        return self.step.label if self._cursor > 0 else None

    @property
    def redo_label(self) -> str | None:
        """Return the label of the step that `redo` would do again, or None."""
        following = self._cursor + 1
        return self._steps[following].label if following < len(self._steps) else None

    def undo(self) -> None:
        self.jump(self._cursor - 1)

    def redo(self) -> None:
        self.jump(self._cursor + 1)

    def jump(self, index: int) -> None:
        """Shows the step at `index`, the nearest one where there is none."""
        self._cursor = min(max(index, 0), len(self._steps) - 1)

    @property
    def count(self) -> int:
        """Return the number of steps, undone ones included."""
        return len(self._steps)

    def label(self, index: int) -> str:
        return self._steps[index].label

    # Snapshots

    def keep(self, name: str) -> None:
        """Keep the shown document as a snapshot; one of the same name is replaced."""
        self.drop(name)
        self.snapshots = (*self.snapshots, Step(name, self.document))
        self._memory.take(self.document)

    def drop(self, name: str) -> None:
        """Forget the snapshot of this name."""
        for step in self.snapshots:
            if step.label == name:
                self._memory.let_go(step.document)
        self.snapshots = tuple(step for step in self.snapshots if step.label != name)

    # Memory

    def limit_to(self, limit: int) -> None:
        """Old steps may hold so many bytes from now on."""
        self._limit = limit
        self._forget_oldest()

    @property
    def old_bytes(self) -> int:
        """Return the bytes that the steps hold beyond those of the shown document."""
        return self._memory.bytes - self._memory.bytes_of(self.document)

    def _forget_oldest(self) -> None:
        while self._cursor > 0 and (
            len(self._steps) > DEPTH
            or (self._memory.bytes > self._limit and self.old_bytes > self._limit)
        ):
            self._memory.let_go(self._steps.pop(0).document)
            self._cursor -= 1

    def _append(self, label: str, document: Document) -> None:
        self._steps.append(Step(label, document))
        self._memory.take(document)


class _Memory:
    """The bytes behind some documents, those that several of them share counted once.

    It counts parts (the photo, an object, the plate ...), which documents share as they are: an
    edit of one object of twenty costs the look at that one. Whoever asks keeps the documents
    alive, so that no part's `id` becomes another's.
    """

    def __init__(self) -> None:
        self.bytes = 0
        self._blocks: dict[int, Mapping[int, int]] = {}  # part -> its blocks of memory -> bytes
        self._documents: Counter[int] = Counter()  # part -> how many documents hold it
        self._parts: Counter[int] = Counter()  # block -> how many parts hold it

    def take(self, document: Document) -> None:
        for part in _parts(document):
            key = id(part)
            self._documents[key] += 1
            if key in self._blocks:
                continue
            self._blocks[key] = blocks = dict(_blocks(part))
            for block, size in blocks.items():
                self.bytes += size if self._parts[block] == 0 else 0
                self._parts[block] += 1

    def let_go(self, document: Document) -> None:
        for part in _parts(document):
            key = id(part)
            self._documents[key] -= 1
            if self._documents[key] > 0:
                continue
            del self._documents[key]
            for block, size in self._blocks.pop(key).items():
                self._parts[block] -= 1
                if self._parts[block] == 0:
                    del self._parts[block]
                    self.bytes -= size

    def bytes_of(self, document: Document) -> int:
        """Return the bytes that one of the documents holds by itself."""
        blocks: dict[int, int] = {}
        for part in _parts(document):
            blocks |= self._blocks[id(part)]
        return sum(blocks.values())


def _parts(document: Document) -> Iterator[Any]:
    """What documents share as a whole; a part may be there twice."""
    for f in fields(document):
        value = getattr(document, f.name)
        for part in value if isinstance(value, tuple) else (value,):
            if is_dataclass(part):
                yield part


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
