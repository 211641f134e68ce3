"""The key poses of an animation: keeping the pose of now, and going back to one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from objectmorpher_core.document import key_edits

from ...system.texts import t

if TYPE_CHECKING:
    from ..state import EditorState
    from .posing import Posing


class Keying:
    """The timeline: as many poses as were kept, in their order."""

    def __init__(self, editor: EditorState, posing: Posing) -> None:
        self._editor, self._posing = editor, posing
        self._last = 0

    def forget(self) -> None:
        """Another document is shown."""
        self._last = 0

    @property
    def count(self) -> int:
        """How many key poses there are."""
        document = self._editor.committed
        return 0 if document is None else key_edits.count_keys(document)

    @property
    def shown(self) -> int | None:
        """Which of them the objects are in, from 0; None where they are in none."""
        document = self._editor.committed
        if document is None:
            return None
        return next((n for n in range(self.count) if key_edits.is_at_key(document, n)), None)

    @property
    def last(self) -> int:
        """Which of them the objects are in, or were in last, from 0."""
        shown = self.shown
        self._last = min(self._last if shown is None else shown, max(self.count - 1, 0))
        return self._last

    @property
    def why_not_add(self) -> str | None:
        """Why the pose of now cannot be kept, or None."""
        document = self._editor.committed
        if document is None or all(item.lifted is None for item in document.objects):
            return self._editor.why_no_shape
        is_full = self.count >= key_edits.MOST
        return t("There are {count} key poses already", count=self.count) if is_full else None

    def add(self) -> None:
        """Keep the pose of now as the last one."""
        document = self._editor.committed
        if document is not None and self.why_not_add is None:
            self._last = self.count
            self._editor.apply(t("Add key pose"), key_edits.add_key(document))
            self._editor.say(t("Key pose {number} is kept", number=self.count))

    def show(self, number: int) -> None:
        """Put the objects into a key pose, but for those that are locked."""
        document = self._editor.committed
        if document is None or number >= self.count or self.shown == number:
            return
        self._posing.select(None)
        self._last = number
        changed = key_edits.free_at_key(document, number)
        if changed is not document:
            label = t("Go to key pose {number}", number=number + 1)
            self._editor.apply(label, changed)
        if (stays := key_edits.off_key(changed, number)) is not None:
            self._editor.say_locked(stays)

    def step(self, by: int) -> None:
        """Go to the next key pose, or the one before; after the last comes the first."""
        if self.count:
            self.show((self.last + by) % self.count)

    def replace(self) -> None:
        """The pose of now takes the place of the key pose that was shown last."""
        if (document := self._editor.committed) is not None and self.count:
            number = self.last
            label = t("Replace key pose {number}", number=number + 1)
            self._editor.apply(label, key_edits.replace_key(document, number))

    def remove(self) -> None:
        """Forget the key pose that was shown last; the objects stay as they are."""
        if (document := self._editor.committed) is not None and self.count:
            number = self.last
            label = t("Remove key pose {number}", number=number + 1)
            self._editor.apply(label, key_edits.remove_key(document, number))
