"""The soft edge of an object, repaired: found anew under a brush, freed of the background's colour.

Both are seen in the edited picture, on the object where it is now. Strokes of the brush are done by
the worker, one after the other; a lifted object's cut-out and shape follow (`refits`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F32, U8, Mask
from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.document import edge_edits, edits
from objectmorpher_core.document.model import EditObject, Photo
from objectmorpher_core.document.transparency import colours_of

from ...system.texts import t
from ...tools.pointer import Pointer
from ...worker import job_functions
from ...worker.requests import JobError
from ..state import WaitingChanges

if TYPE_CHECKING:
    from ..state import EditorState
    from .landing import Landing
    from .masking import Masking

USUAL = 1.0  # amount of what one press of Decontaminate takes out


@dataclass(frozen=True, eq=False)
class EdgeWish:
    """A stroke that was painted and is not done yet."""

    photo: Photo
    k: int
    painted: Mask  # (H, W)
    is_erasing: bool

    @property
    def label(self) -> str:
        """Of the step that it becomes."""
        return t("Erase edge brush") if self.is_erasing else t("Edge brush")


class Edging(WaitingChanges[EdgeWish]):
    """The current object's soft edge."""

    kind = "brush edge"

    def __init__(self, editor: EditorState, landing: Landing, masking: Masking) -> None:
        super().__init__(editor)
        self._landing, self._masking = landing, masking
        self.stroke: Stroke | None = None  # in progress
        self.is_erasing = False
        self.trail: list[np.ndarray] = []  # where it went, canvas px (2,) each
        self._spill: tuple[F32, F32] | None = None  # of which colours, and what is in them

    def forget(self) -> None:
        """Another document is opened."""
        super().forget()
        self.stroke, self._spill = None, None

    # The brush

    def start_stroke(self, pointer: Pointer, is_erasing: bool) -> bool:
        """The edge brush is put down; False where there is no edge to repair."""
        editor, document = self._editor, self._editor.document
        if document is None or editor.mask is None:
            editor.say(t("Select an object first"))
            return False
        self.stroke = Stroke(document.photo.size, Brush(editor.view.brush.radius, 1.0))
        self.is_erasing, self.trail = is_erasing, [pointer.xy]
        self._paint_at(self._landing.begin(pointer.xy))
        return True

    def move_stroke(self, pointer: Pointer) -> None:
        self.trail.append(pointer.xy)
        self._paint_at(self._landing.go_on(pointer.xy))

    def _paint_at(self, xy: np.ndarray) -> None:
        """The brush moves to image px (2,)."""
        if self.stroke is not None:
            self.stroke.move_to(float(xy[0]), float(xy[1]))

    def drop_stroke(self) -> None:
        """Drop the stroke as if nothing had been painted."""
        self.stroke = None

    def finish_stroke(self) -> None:
        """Have the edge found anew under what was painted."""
        stroke, document = self.stroke, self._editor.committed
        self.stroke = None
        if stroke is None or document is None:
            return
        painted = stroke.coverage >= 0.5
        if self._add(EdgeWish(document.photo, self._editor.current, painted, self.is_erasing)):
            self._do_next()

    def _do_next(self) -> None:
        from objectmorpher_core.segment.matting.repair import EdgeStroke

        editor = self._editor
        wish = self._waiting[0] if self._waiting else None
        thing = None if wish is None else self._thing_of(wish)
        if wish is None or thing is None or thing.selection is None:
            self._waiting.clear()
            return

        def accept(answer: tuple[U8, Mask]) -> None:
            if not self._is_first(wish):
                return
            now = self._thing_of(wish)
            if now is None or now.selection is not thing.selection:
                self._waiting.clear()
                return
            self._take(wish, *answer)
            self._end_first()
            self._do_next()

        def fail(error: JobError) -> None:
            self._waiting.clear()
            editor.complain_of(error)

        editor.jobs.start(
            t("Looking for the edge"), job_functions.brush_edge,
            EdgeStroke(colours_of(wish.photo.picture), thing.selection, thing.mixed, wish.painted),
            wish.is_erasing, done=lambda answer: editor.answers.take(lambda: accept(answer)),
            failed=fail, cancelled=lambda: self._waiting.clear() if self._is_first(wish) else None,
            kind=self.kind,
        )  # fmt: skip

    def _thing_of(self, wish: EdgeWish) -> EditObject | None:
        document = self._editor.committed
        is_there = document is not None and document.photo is wish.photo
        if document is None or not is_there or wish.k >= len(document.objects):
            return None
        return document.objects[wish.k]

    def _take(self, wish: EdgeWish, coverage: U8, mixed: Mask) -> None:
        """What the brush has found is the next step."""
        editor, document = self._editor, self._editor.committed
        assert document is not None
        try:
            changed = edge_edits.set_edge(document, wish.k, coverage, mixed)
        except edits.EditError as error:
            editor.complain(str(error))
            return
        self._masking.take(wish.label, changed, wish.k)

    # The background's colour

    @property
    def decontaminate(self) -> float:
        """Return how far the background's colour is taken out, in [0, 1]."""
        thing = self._editor.object
        return 0.0 if thing is None else thing.decontaminate

    def preview_decontaminate(self, amount: float) -> None:
        """Preview an amount in [0, 1]; `Editor.commit` makes it a step."""
        editor, document = self._editor, self._editor.committed
        if document is None or not editor.is_lifted or editor.hand.is_busy:
            return
        matte = document.objects[editor.current].found_matte
        assert matte is not None, "a lifted object has one"
        if self._spill is None or self._spill[0] is not matte.foreground:
            self._spill = matte.foreground, edge_edits.spill_of(document.photo, matte)
        editor.preview = edge_edits.set_decontaminate(
            document, editor.current, amount, self._spill[1]
        )

    def toggle_decontaminate(self) -> None:
        """Take the background's colour out of the edge, or leave it as it was found."""
        is_new = self.decontaminate == 0
        self.preview_decontaminate(USUAL if is_new else 0.0)
        self._editor.commit(t("Decontaminate edge") if is_new else t("Edge as it was found"))
