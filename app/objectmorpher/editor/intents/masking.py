"""The selection changed by hand: painted, its edge moved or softened, inverted, from a file.

A lifted object whose mask is refined keeps all that was done to it, and its shape follows
(`refits`). Where the mask would become that of another thing, that is said first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import U8, Selection
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Photo, Prompt
from objectmorpher_core.segment import mask_edit
from objectmorpher_core.segment.mask_edit import MaskPainting

from ...canvas.layer import CanvasLayer
from ...canvas.memo import same
from ...system.texts import folder_of, t
from ...tools.pointer import Pointer
from ...worker import job_functions
from ...worker.requests import JobError
from ..state import WaitingChanges
from ..tasks import READ_MASK, SELECT, WRITE
from ..view import Action, ToolName
from .composing import on_canvas, tint

if TYPE_CHECKING:
    from ..state import EditorState
    from .landing import Landing
    from .posing import Posing


@dataclass(frozen=True)
class MaskChange:
    """A change of the whole selection, which the worker makes."""

    label: str
    function: Callable[[Selection], Selection]


class Masking(WaitingChanges[MaskChange]):
    """The current object's mask, as something to work on."""

    kind = "change mask"

    def __init__(self, editor: EditorState, landing: Landing, posing: Posing) -> None:
        super().__init__(editor)
        self._landing, self._posing, self.mirroring = landing, posing, posing.mirroring
        self.painting: MaskPainting | None = None  # the stroke in progress
        self.trail: list[np.ndarray] = []  # where it went, canvas px (2,) each
        self._last: tuple[Photo, np.ndarray] | None = None  # where the last stroke ended, image px
        self._veil: tuple[tuple[object, ...], CanvasLayer] | None = None  # of what it was made

    @property
    def shown(self) -> Selection | None:
        """Return the selection with the stroke in progress, which changes it in place."""
        if self.painting is not None:
            return self.painting.shown
        return self._editor.object.selection if self._editor.object else None

    def veil_layer(self, share: float) -> CanvasLayer | None:
        """Return so much black over the canvas beside what is selected, over an edit.

        None where nothing is selected, or the selection's object is seen elsewhere.
        """
        item, view = self._editor.object, self._editor.view
        if item is None or item.selection is None or item.is_moved:
            return None
        key = (item.selection, share, *view.place)
        if self._veil is None or not same(self._veil[0], key):
            alpha = share * on_canvas(view, 255 - mask_edit.as_coverage(item.selection))
            self._veil = key, tint(np.zeros((*alpha.shape, 3)), alpha)
        return self._veil[1]

    @property
    def is_soft(self) -> bool:
        """Whether the artist drew any of the edge soft."""
        thing = self._editor.object
        return thing is not None and thing.coverage is not None

    # Strokes

    def start_stroke(self, pointer: Pointer, is_erasing: bool) -> None:
        """The brush is put down; with Shift it comes from where it was last."""
        editor, document = self._editor, self._editor.document
        if document is None:
            return
        selection = editor.object.selection if editor.object else None
        brush = editor.view.brush
        self.painting = MaskPainting(document.photo.size, selection, brush, is_erasing)
        if pointer.shift and self._last is not None and self._last[0] is document.photo:
            self.painting.move_to(*map(float, self._last[1]))
        self.trail = [pointer.xy]
        self._paint_at(self._landing.begin(pointer.xy))

    def move_stroke(self, pointer: Pointer) -> None:
        if self.painting is not None:
            self.trail.append(pointer.xy)
            self._paint_at(self._landing.go_on(pointer.xy))

    def _paint_at(self, xy: np.ndarray) -> None:
        """The brush moves to image px (2,)."""
        document = self._editor.document
        if self.painting is not None and document is not None:
            self.painting.move_to(float(xy[0]), float(xy[1]))
            self._last = document.photo, xy

    def finish_stroke(self, label: str) -> None:
        """Turn what was painted into one step."""
        painting, self.painting = self.painting, None
        if painting is not None and painting.touched:
            self._apply(label, painting.selection())

    def drop_stroke(self) -> None:
        """Drop the stroke as if nothing had been painted."""
        self.painting = None

    # Changes of the whole

    def grow(self) -> None:
        """The selection with what is near it."""
        self._change(t("Grow selection"), mask_edit.grow)

    def shrink(self) -> None:
        """The selection without its rim."""
        self._change(t("Shrink selection"), mask_edit.shrink)

    def smooth(self) -> None:
        """An edge without teeth."""
        self._change(t("Smooth selection"), mask_edit.smooth)

    def feather(self) -> None:
        """A soft edge, which the lifted object keeps."""
        self._change(t("Feather selection"), mask_edit.feather)

    def fill_holes(self) -> None:
        """A selection without holes."""
        self._enqueue(MaskChange(t("Fill holes"), mask_edit.fill_holes))

    def remove_islands(self) -> None:
        """A selection without small pieces beside the large one."""
        self._enqueue(MaskChange(t("Remove islands"), mask_edit.remove_islands))

    def invert(self) -> None:
        """Invert the selection. No click asked for the result, so its prompt is dropped."""
        selection = self.shown
        if selection is not None:
            self._apply(t("Invert selection"), mask_edit.invert(selection), Prompt())

    def harden(self) -> None:
        """The edge is found in the photo again, wherever it was drawn soft."""
        mask = self._editor.mask
        if mask is not None and self.is_soft:
            self._apply(t("Edge from the photo"), mask)

    def _change(self, label: str, function: Callable[..., Selection]) -> None:
        reach = self._editor.view.selecting.reach
        self._enqueue(MaskChange(label, partial(function, px=reach)))

    def _enqueue(self, change: MaskChange) -> None:
        """One after the other: three presses grow the selection three times."""
        if self._add(change):
            self._make_next()

    def _make_next(self) -> None:
        editor, thing = self._editor, self._editor.object
        if not self._waiting:
            return
        if thing is None or thing.selection is None:
            self.forget()
            return
        change, k = self._waiting[0], editor.current

        def accept(changed: Selection) -> None:
            if not self._is_first(change):
                return
            now = editor.object.selection if editor.object else None
            if now is not thing.selection or editor.current != k:
                self.forget()
                return
            self._apply(change.label, changed)
            self._end_first()
            self._make_next()

        editor.jobs.start(
            t("Changing the selection"), job_functions.change_mask,
            thing.selection, change.function,
            done=lambda changed: editor.answers.take(lambda: accept(changed)),
            failed=lambda error: self._fail(error, change),
            cancelled=lambda: self.forget() if self._is_first(change) else None, kind=self.kind,
        )  # fmt: skip

    def _fail(self, error: JobError, change: MaskChange) -> None:
        self.forget()
        self._editor.complain_of(error.retried_by(lambda: self._enqueue(change)))

    # Files

    def open_file(self, path: Path) -> None:
        """The picture of a mask, of the photo's size, is the selection: bright is selected."""
        editor, document = self._editor, self._editor.document
        if document is None:
            return
        photo, k = document.photo, editor.current

        def accept(coverage: U8) -> None:
            if editor.document is not None and editor.document.photo is photo:
                editor.current = min(k, len(editor.document.objects))
                self._apply(t("Import mask"), coverage, Prompt())

        editor.jobs.start(
            t("Reading {name}", name=path.name), job_functions.read_coverage, path, photo.size,
            done=lambda coverage: editor.answers.take(lambda: accept(coverage)),
            failed=editor.complain_of, kind=READ_MASK,
        )  # fmt: skip

    def write_file(self, path: Path) -> None:
        """Writes the selection as a grey picture, soft where it is soft."""
        editor, selection = self._editor, self.shown
        if path.suffix.lower() != ".png":
            editor.complain(t("A mask is written as .png, not as {ending}", ending=path.suffix))
        elif editor.is_opened(path):
            editor.complain(t("The export would overwrite the opened photo; choose another name"))
        elif selection is not None:
            editor.jobs.start(
                t("Exporting {name}", name=path.name), job_functions.write_coverage,
                selection, path, failed=editor.complain_of, kind=f"{WRITE} {path}",
                done=lambda _: editor.say(t("Exported {name} to {folder}", name=path.name,
                                            folder=folder_of(path))),
            )  # fmt: skip

    # Steps

    def _apply(self, label: str, selection: Selection, prompt: Prompt | None = None) -> None:
        """The selection, changed by hand, is the next step; with a prompt, it is a new one."""
        editor, document = self._editor, self._editor.document
        if document is None:
            return
        if prompt is not None:  # else the answer that comes keeps what was changed meanwhile
            editor.jobs.cancel(SELECT)
        try:
            changed = self._changed(document, selection, prompt)
        except ValueError as error:
            editor.complain(str(error))
            return
        self.take(label, changed, editor.current)

    def take(self, label: str, changed: Document, k: int) -> None:
        """A document in which object `k` has another mask is the next step.

        Where that would throw away what was done to a lifted object, it is only offered.
        """
        editor, before = self._editor, self._editor.committed
        is_empty = changed.objects[k].mask is None

        def apply() -> None:
            self._posing.select(None)
            if editor.view.tool is not ToolName.MASK or is_empty:
                editor.view.tool = ToolName.SELECT
            if before is not None:
                self.mirroring.carry(before, changed)
            editor.apply(label, changed)

        def start_over() -> None:
            if editor.committed is before and not editor.hand.is_busy:
                apply()

        if before is None or not loses_work(before, changed, k):
            apply()
            return
        name = before.objects[k].name
        warning = (
            t("Without a selection {name} loses its shape, its pose and its place", name=name)
            if is_empty
            else t("That is not {name}, whose shape, pose and place would go", name=name)
        )
        editor.say(warning, Action(t("Start over"), start_over))

    def _changed(self, document: Document, selection: Selection, prompt: Prompt | None) -> Document:
        k = self._editor.current
        if k == len(document.objects):
            document = edits.add_object(document)
        if prompt is None:
            return edits.change_mask(document, k, selection)
        return edits.set_mask(document, k, selection, prompt)


def loses_work(before: Document, changed: Document, k: int) -> bool:
    """Whether what was done to object `k`, which is lifted, would be gone."""
    if k >= len(before.objects) or changed.objects[k].lifted is not None:
        return False
    item = before.objects[k]
    return item.lifted is not None and (item.is_moved or bool(item.handles))
