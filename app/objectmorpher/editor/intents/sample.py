"""A sample that opens with its thing lifted, so that a newcomer's first act is to drag it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.document.model import Photo

from ..tasks import SELECT
from ..view import ToolName

if TYPE_CHECKING:
    from ..filing import Filing
    from ..state import EditorState
    from ..tasks import Tasks
    from .selection import Selection


class SampleOpening:
    """Opens, selects and lifts; the artist may go on at any time, and then it does no more."""

    def __init__(
        self, editor: EditorState, filing: Filing, selection: Selection, tasks: Tasks
    ) -> None:
        self._editor, self._filing = editor, filing
        self._selection, self._tasks = selection, tasks
        self._photo: Photo | None = None  # the sample's, until its thing is lifted
        self._is_asked = False  # what its thing is

    def open(self, path: Path, thing: tuple[float, float]) -> None:
        """Opens a photo that came with the program, whose `thing` is at image px (x, y)."""

        def select() -> None:
            document = self._editor.committed
            self._photo, self._is_asked = document.photo if document else None, True
            self._selection.add_click(*thing, is_foreground=True)

        self._filing.open_sample(path, select)

    def poll(self) -> bool:
        """Goes on with what was opened; once a frame. Whether anything changed."""
        editor, document, photo = self._editor, self._editor.committed, self._photo
        if photo is None or self._tasks.question or editor.jobs.is_busy(SELECT):
            return False
        if document is None or document.photo is not photo:
            self._photo = None
        elif self._is_asked:
            self._is_asked = False
            if editor.mask is None or editor.view.tool is not ToolName.SELECT:
                self._photo = None
            elif not editor.is_lifted:
                self._tasks.lift()
            return True
        elif editor.is_lifted:
            assert editor.history is not None
            editor.history.mark_saved(document)  # the artist has done nothing yet
            self._photo = None
        return False
