"""Which object is meant: clicks, a box, the subject."""

from __future__ import annotations

from typing import TYPE_CHECKING

from objectmorpher_core import edits
from objectmorpher_core.document import Click, Prompt

from ..tasks import SELECT
from ..texts import t
from ..view import ToolName

if TYPE_CHECKING:
    from ..editor import Editor


class Selection:
    """The current object's mask, and what was said to get it."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor

    @property
    def pending(self) -> Prompt | None:
        """What is being segmented now; shown at once, in the document when the mask is there."""
        return self._editor.tasks.prompt

    @property
    def prompt(self) -> Prompt:
        """What the user said about the current object, asked or answered."""
        if self.pending is not None:
            return self.pending
        thing = self._editor.object
        return thing.prompt if thing else Prompt()

    @property
    def share(self) -> float:
        """How much of the photo is selected, in [0, 1]."""
        mask = self._editor.mask
        return 0.0 if mask is None else self._editor.derived.share(mask)

    def add_click(self, x: float, y: float, is_foreground: bool) -> None:
        """A point of the photo, image px, that belongs to the object or does not."""
        editor = self._editor
        size = editor.photo_size
        if size is None or not (0 <= x < size[0] and 0 <= y < size[1]):
            return
        before = self.prompt
        if before.is_empty and not is_foreground:
            editor.say(t("Click the object first; then right-click what does not belong to it"))
            return
        clicks = (*before.clicks, Click(x, y, is_foreground))
        editor.tasks.segment(
            Prompt(clicks, before.box, before.is_subject),
            t("Add to selection") if is_foreground else t("Remove from selection"),
        )

    def set_box(self, box: tuple[float, float, float, float]) -> None:
        """The object is inside a box x0, y0, x1, y1 image px: a selection made anew."""
        self._editor.tasks.segment(Prompt(box=box), t("Select by box"))

    def select_subject(self) -> None:
        """The photo's main subject."""
        self._editor.tasks.segment(Prompt(is_subject=True), t("Select subject"))

    def clear(self) -> None:
        """Nothing is selected of the current object."""
        editor = self._editor
        editor.jobs.cancel(SELECT)
        if editor.document is not None and editor.mask is not None:
            cleared = edits.set_mask(editor.document, editor.current, None, Prompt())
            editor.posing.select(None)
            editor.view.tool = ToolName.SELECT
            editor.apply(t("Clear selection"), cleared)
