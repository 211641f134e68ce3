"""The photo's objects as things in a list."""

from __future__ import annotations

from typing import TYPE_CHECKING

from objectmorpher_core import edits
from objectmorpher_core.document import Document

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

    def follow(self, before: Document) -> None:
        """After a step back or forth: the tools change the object that the step changed."""
        editor, now = self._editor, self._editor.document
        if now is None:
            return
        pairs = enumerate(zip(before.objects, now.objects, strict=False))
        changed = [k for k, (old, new) in pairs if old is not new]
        if len(now.objects) != len(before.objects):
            changed = [min(len(before.objects), len(now.objects))]
        if changed and editor.current not in changed:
            editor.current = changed[0]

    def toggle_visible(self, k: int) -> None:
        """Shows or hides object `k`."""
        editor = self._editor
        if editor.document is not None:
            is_visible = not editor.document.objects[k].is_visible
            label = t("Show object") if is_visible else t("Hide object")
            editor.apply(label, edits.set_visible(editor.document, k, is_visible))
