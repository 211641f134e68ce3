"""Shapes that follow their masks: a lifted object whose mask was refined is refitted in the worker.

Until then the older shape is shown. The answer is an addition to the step that refined the mask:
one undo takes back both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import Mask, Selection
from objectmorpher_core.document import edge_edits, edits
from objectmorpher_core.document.model import Document, LiftedObject, Plate
from objectmorpher_core.document.transparency import colours_of
from objectmorpher_core.segment.mask_edit import as_coverage

from ..system.texts import t
from ..worker import job_functions
from ..worker.requests import JobError

if TYPE_CHECKING:
    from objectmorpher_core.lift.refitting import Refitted

    from .intents.posing import Posing
    from .state import EditorState
    from .tasks import Tasks

REFIT = "refit"  # kind of job
FARTHEST = 6.0  # x the matte's band, from a changed outline to what is drawn otherwise
STRIDE = 3  # px between places that tell where a part of the photo is shown now


@dataclass(frozen=True, eq=False)
class RefitRequest:
    """The request behind an answer, which is dropped when the request has changed since."""

    k: int
    outline: Selection
    lifted: LiftedObject
    plate: Plate | None

    def is_of(self, document: Document) -> bool:
        if self.k >= len(document.objects) or document.plate is not self.plate:
            return False
        item = document.objects[self.k]
        return item.selection is self.outline and item.lifted is self.lifted


class Refits:
    """Refits that the worker makes, one object at a time, and their answers."""

    def __init__(self, editor: EditorState, posing: Posing, tasks: Tasks) -> None:
        self._editor = editor
        self._posing, self._tasks = posing, tasks
        self._asked: RefitRequest | None = None  # or failed for, or cancelled
        self._answer: Refitted | None = None  # that is not shown yet

    def forget(self) -> None:
        """Another document is opened."""
        self._asked = self._answer = None

    @property
    def is_busy(self) -> bool:
        """Whether a shape is on its way that is not shown yet."""
        document, asked = self._editor.committed, self._asked
        if document is None or asked is None or not asked.is_of(document):
            return False
        return self._answer is not None or self._editor.jobs.is_busy(REFIT)

    def ensure(self) -> bool:
        """Sees to it that shapes follow their masks; each frame. Whether anything changed."""
        editor, document = self._editor, self._editor.committed
        if document is None:
            return False
        outdated = (k for k, o in enumerate(document.objects) if o.lifted and o.shaped is not None)
        k = next(outdated, None)
        if k is None:
            if editor.jobs.is_busy(REFIT):  # it was undone
                self.forget()
                editor.jobs.cancel(REFIT)
            return False
        if self._asked is None or not self._asked.is_of(document):
            self._ask(document, k)
            return True
        if self._answer is None or editor.hand.is_busy or editor.preview is not None:
            return False
        self._show(self._asked, self._answer)
        return True

    def _ask(self, document: Document, k: int) -> None:
        from objectmorpher_core.lift.refitting import Lifted, background_of
        from objectmorpher_core.lift.registration.imported import ImportTarget

        editor, item, photo = self._editor, document.objects[k], document.photo
        matte, outline, lifted = item.found_matte, item.selection, item.lifted
        assert item.shaped is not None and matte is not None
        assert outline is not None and lifted is not None
        wanted = RefitRequest(k, outline, lifted, document.plate)
        self._asked, self._answer = wanted, None

        def accept(answer: Refitted) -> None:
            if self._asked is wanted:
                self._answer = answer

        def fail(error: JobError) -> None:
            editor.complain_of(error.retried_by(self.forget))

        editor.jobs.start(
            t("Fitting {name} to its new outline", name=item.name), job_functions.refit,
            Lifted(item.shaped, matte, lifted, item.shape),
            ImportTarget(colours_of(photo.picture), photo.camera, outline, mixed=item.mixed),
            background_of(document, k, editor.settings.backends.inpaint), document.seed,
            done=accept, failed=fail, kind=REFIT,
        )  # fmt: skip

    def _show(self, wanted: RefitRequest, answer: Refitted) -> None:
        """What drawing it takes is made in a thread first."""
        editor, k = self._editor, wanted.k
        self._answer = None

        def keep() -> None:
            if self._asked is wanted:
                self._answer = answer

        def change(document: Document) -> Document | None:
            if not wanted.is_of(document):
                keep()  # it was undone, and may be done again
                return None
            fitted = edits.refit(document, k, answer.matte, answer.lifted, answer.plate)
            if document.refined is None:
                return fitted
            disturbed = _disturbed(editor, document, fitted, k)
            return edge_edits.keep_refined(fitted, document.refined, disturbed)

        def show(changed: Document) -> None:
            assert editor.history is not None and editor.committed is not None
            self._asked = None  # a later step may ask for the same
            changed = _held(editor, changed, k)
            lost = len(editor.committed.objects[k].handles) - len(changed.objects[k].handles)
            editor.history.amend(changed)
            self._posing.forget_lost()
            if lost:
                editor.say(_farewell(lost))

        title = t("Fitting {name} to its new outline", name=_name(editor, k))
        self._tasks.make_ready(k, change, title, show)


def _held(editor: EditorState, changed: Document, k: int) -> Document:
    """Object `k` and its copies hold their pose in the new shape: the next drag begins there."""
    lifted = changed.objects[k].lifted
    for j, own in enumerate(changed.objects):
        if own.lifted is lifted and own.pose is not None and own.handles:
            changed = editor.derived.held(changed, j)
    return changed


def _disturbed(editor: EditorState, before: Document, after: Document, k: int) -> Mask:
    """(H, W) where the edited picture changes when object `k` is refitted.

    That is where its outline changed in the photo, and where the object shows that part of it now.
    """
    from objectmorpher_core.segment.matting.matte import band_width

    item = before.objects[k]
    assert item.shaped is not None and item.selection is not None
    width, height = before.photo.size
    reach = int(np.ceil(FARTHEST * band_width(width, height)))
    changed = as_coverage(item.shaped) != as_coverage(item.selection)
    near = np.asarray(cv2.boxFilter(changed.astype(np.float32), -1, (2 * reach + 1,) * 2) > 0)
    rows, columns = np.nonzero(near[::STRIDE, ::STRIDE])
    if len(rows) == 0:
        return near
    at = np.column_stack([columns, rows]) * STRIDE + 0.5
    shown = np.zeros((height, width), np.uint8)
    for j, other in enumerate(before.objects):
        if other.mask is not item.mask or not other.is_moved or not other.is_visible:
            continue
        for document in (before, after):
            x, y = np.floor(editor.derived.carried(document, j, at)).astype(int).T
            inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
            shown[y[inside], x[inside]] = 1
    return near | (cv2.dilate(shown, np.ones((4 * STRIDE + 1,) * 2, np.uint8)) > 0)


def _name(editor: EditorState, k: int) -> str:
    document = editor.committed
    return document.objects[k].name if document and k < len(document.objects) else ""


def _farewell(lost: int) -> str:
    if lost == 1:
        return t("A handle went with the part it was on · Ctrl+Z brings both back")
    return t("{count} handles went with the part they were on · Ctrl+Z brings them back",
             count=lost)  # fmt: skip
