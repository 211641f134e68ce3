"""The whole object somewhere else in the photo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from objectmorpher_core import edits
from objectmorpher_core.document import Placement

from ..derived import ObjectFrame
from ..texts import t

if TYPE_CHECKING:
    from ..editor import Editor


class Placing:
    """The current object's placement."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor

    @property
    def placement(self) -> Placement | None:
        editor = self._editor
        return editor.object.placement if editor.is_lifted and editor.object else None

    def frame(self) -> ObjectFrame | None:
        """The object's outline box in the picture."""
        editor = self._editor
        if editor.document is None or not editor.is_lifted:
            return None
        return editor.derived.frame(editor.document, editor.current)

    def move_to(self, placement: Placement) -> None:
        """Previews the whole object elsewhere."""
        editor = self._editor
        if editor.committed is None or not editor.is_lifted:
            return
        try:
            editor.preview = edits.set_placement(editor.committed, editor.current, placement)
        except ValueError as error:
            editor.preview = None
            editor.complain(str(error))

    def reset(self) -> None:
        """Back to where it was in the photo."""
        if self.placement is not None and not self.placement.is_identity:
            self.move_to(Placement())
            self._editor.commit(t("Reset placement"))
