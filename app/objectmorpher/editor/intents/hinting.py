"""Telling where the background is to be taken from: a drag from there to where it is wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.document.settings import Hint

from ...system.texts import t

if TYPE_CHECKING:
    from ..state import EditorState
    from .composing import Composing

XY = tuple[float, float]
LEAST_WAY = 4.0  # canvas px: a click is no drag


class Hinting:
    """The document's hints, and the one that is being dragged."""

    def __init__(self, editor: EditorState, composing: Composing) -> None:
        self._editor = editor
        self._composing = composing
        self.dragged: Hint | None = None
        self._asked: tuple[Hint, ...] | None = None  # the background for these is being made

    def forget(self) -> None:
        """Another document is opened."""
        self.dragged = self._asked = None

    @property
    def shown(self) -> tuple[Hint, ...]:
        """Return all hints that hold now or will hold once the background is there."""
        document = self._editor.document
        if document is None:
            return ()
        return document.hints if self._asked is None else self._asked

    def start(self, canvas_xy: np.ndarray) -> bool:
        """A drag begins at what is to be taken; False where there is nothing to fill in."""
        editor = self._editor
        if editor.document is None or editor.document.plate is None:
            editor.say(self._composing.trouble or t("Open a photo first"))
            return False
        if not editor.is_on_photo(canvas_xy):
            return False
        here = self._place(canvas_xy)
        self.dragged = Hint(here, here, editor.view.brush.radius)
        return True

    def move_to(self, canvas_xy: np.ndarray) -> None:
        if self.dragged is not None:
            self.dragged = Hint(self.dragged.source, self._place(canvas_xy), self.dragged.radius)

    def drop(self) -> None:
        self.dragged = None

    def finish(self) -> None:
        """The background is filled in with it: one step, once it is there."""
        hint, self.dragged = self.dragged, None
        editor, document = self._editor, self._editor.committed
        if hint is None or document is None or document.plate is None:
            return
        way = np.hypot(hint.to[0] - hint.source[0], hint.to[1] - hint.source[1])
        if way * editor.view.zoom < LEAST_WAY:
            return
        if not self._is_hidden(hint):
            editor.say(t("Drag to a place that is filled in: the photo stays as it is"))
            return
        self._ask((*self.shown, hint), t("Fill from a spot"))

    def remove_at(self, canvas_xy: np.ndarray) -> bool:
        """Forgets the uppermost hint with an end here; False where there is none."""
        x, y = self._place(canvas_xy)
        for hint in reversed(self.shown):
            if any(np.hypot(x - a, y - b) <= hint.radius for a, b in (hint.source, hint.to)):
                self._ask(tuple(h for h in self.shown if h is not hint), t("Remove fill source"))
                return True
        return False

    def remove_all(self) -> None:
        """Remove all hints about the source of the background."""
        if self.shown:
            self._ask((), t("Clear fill sources"))

    def _ask(self, hints: tuple[Hint, ...], label: str) -> None:
        self._asked = hints
        self._composing.fill_from(hints, label, lambda: self._end(hints))

    def _end(self, hints: tuple[Hint, ...]) -> None:
        """The background for these is there, or is not to be; others may be asked for by now."""
        if self._asked is hints:
            self._asked = None

    def _is_hidden(self, hint: Hint) -> bool:
        """Whether anything is invented where the hint leads to."""
        document = self._editor.committed
        assert document is not None and document.plate is not None
        rows, columns = np.nonzero(document.plate.hole)
        x, y = columns + document.plate.left, rows + document.plate.top
        return bool((np.hypot(x - hint.to[0], y - hint.to[1]) <= hint.radius).any())

    def _place(self, canvas_xy: np.ndarray) -> XY:
        """Image px, on the photo."""
        size = self._editor.photo_size
        assert size is not None
        x, y = np.clip(self._editor.view.image_from_canvas(canvas_xy), 0, np.array(size) - 1)
        return float(x), float(y)
