"""The photo's objects as things in a list."""

from __future__ import annotations

from typing import TYPE_CHECKING

from objectmorpher_core import edits

from ..texts import t
from ..view import ToolName

if TYPE_CHECKING:
    from ..editor import Editor


class Objects:
    """Adding, choosing and hiding them."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor

    def start_another(self) -> None:
        """The next click selects another object."""
        editor = self._editor
        if editor.document is not None:
            editor.hand.abort(editor)
            editor.current = len(editor.document.objects)
            editor.posing.select(None)
            editor.view.tool = ToolName.SELECT

    def choose(self, k: int) -> None:
        """The tools change object `k` now."""
        editor = self._editor
        editor.hand.abort(editor)
        editor.current = k
        editor.posing.select(None)
        if not editor.is_lifted:
            editor.view.tool = ToolName.SELECT

    def toggle_visible(self, k: int) -> None:
        """Shows or hides object `k`."""
        editor = self._editor
        if editor.document is not None:
            is_visible = not editor.document.objects[k].is_visible
            label = t("Show object") if is_visible else t("Hide object")
            editor.apply(label, edits.set_visible(editor.document, k, is_visible))
