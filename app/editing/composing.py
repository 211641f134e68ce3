"""What is behind the objects, and how they are joined to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..editor import Editor


class Composing:
    """The plate and the joining."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
