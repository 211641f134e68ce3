"""The window's title: the file, and what the edit has changed of it."""

from __future__ import annotations

from objectmorpher_core.document import Document

from ..editor import Editor
from ..texts import t


class Title:
    """As it was written last."""

    def __init__(self) -> None:
        self._text = ""
        self._changed: tuple[Document | None, int] = (None, 0)  # px that a document changes

    def changed(self, editor: Editor, is_quiet: bool) -> str | None:
        """Once a frame: the new one, or None; `is_quiet`: nothing has happened for a moment."""
        if is_quiet and editor.preview is None and editor.committed is not self._changed[0]:
            document = editor.committed
            count = 0 if document is None else editor.derived.painter.count_changed(document)
            self._changed = (document, count)
        before, self._text = self._text, self._text_for(editor)
        return self._text if self._text != before else None

    def _text_for(self, editor: Editor) -> str:
        document = editor.committed
        if document is None:
            return "ObjectMorpher"
        name = editor.path.name if editor.path else document.photo.name
        state = "" if editor.is_saved else f" — {self._edited(document)}"
        return f"{name}{state} · ObjectMorpher"

    def _edited(self, document: Document) -> str:
        counted, count = self._changed
        if counted is not document or count == 0:
            return t("edited")
        width, height = document.photo.size
        share = 100 * count / (width * height)
        if share < 1:
            return t("edited, less than 1 % of the photo")
        return t("edited, {share} % of the photo", share=round(share))
