"""Undo: a list of documents and a cursor (ARCHITECTURE section 4)."""

from __future__ import annotations

from dataclasses import dataclass

from objectmorpher_core.document import Document

DEPTH = 500  # steps; documents share their arrays, so most steps cost kilobytes
MASKS = 1 << 30  # bytes of all steps' masks: each step of a brush has one, 24 MB of a large photo


@dataclass(frozen=True, eq=False)
class Step:
    """A document, and what was done to get it."""

    label: str  # "Move handle"
    document: Document


class History:
    """The documents since the file was opened, and which of them is shown."""

    def __init__(self, document: Document, label: str = "Open") -> None:
        self._steps = [Step(label, document)]
        self._cursor = 0
        self._saved: Document | None = document

    @property
    def document(self) -> Document:
        return self._steps[self._cursor].document

    @property
    def is_saved(self) -> bool:
        """Whether what is shown is what the file holds."""
        return self.document is self._saved

    def mark_saved(self, document: Document) -> None:
        """`document`, which may be an older one by now, is what the file holds."""
        self._saved = document

    def apply(self, label: str, document: Document) -> None:
        """`document` is the next step; steps that were undone are forgotten."""
        if document is self.document:
            return
        self._steps = [*self._steps[: self._cursor + 1], Step(label, document)][-DEPTH:]
        self._steps = self._steps[-_affordable(self._steps) :]
        self._cursor = len(self._steps) - 1

    def amend(self, document: Document) -> None:
        """`document` replaces the current one without a step: computed additions to it."""
        step = self._steps[self._cursor]
        if step.document is self._saved:
            self._saved = document
        self._steps[self._cursor] = Step(step.label, document)

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
        self._cursor = max(self._cursor - 1, 0)

    def redo(self) -> None:
        self._cursor = min(self._cursor + 1, len(self._steps) - 1)


def _affordable(steps: list[Step]) -> int:
    """How many of the last steps, at least two, have masks that are not too much together."""
    seen: set[int] = set()
    total = 0
    for count, step in enumerate(reversed(steps)):
        for thing in step.document.objects:
            for mask in (thing.mask, thing.coverage, thing.found):
                owner = mask if mask is None or mask.base is None else mask.base  # views share it
                if owner is not None and id(owner) not in seen:
                    seen.add(id(owner))
                    total += mask.nbytes if mask is not None else 0
        if total > MASKS and count >= 2:
            return count
    return len(steps)
