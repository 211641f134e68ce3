"""What a selection left out: pieces beside the object that look like parts of it.

They are found with the background, offered once, and marked while the offer stands; the command
stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F32
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Plate

from ...system.texts import t
from ..view import Action

if TYPE_CHECKING:
    from objectmorpher_core.compose.plate.residue import Ghost

    from ..state import EditorState

MOST_OFFERED = 4  # pieces


class LeavingOut:
    """The pieces beside the document's lifted objects."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self._offered: Action | None = None
        self._seen: Plate | None = None  # the background that was looked at last
        self._found: tuple[Plate | None, tuple[Ghost, ...]] = (None, ())  # of which plate

    @property
    def pieces(self) -> tuple[Ghost, ...]:
        """Those of the current object."""
        document, editor = self._editor.document, self._editor
        if document is None or not editor.is_lifted:
            return ()
        return tuple(piece for piece in self._all(document) if piece.owner == editor.current)

    @property
    def outlines(self) -> tuple[F32, ...]:
        """(N, 2) image px each, around what is offered now."""
        message, document = self._editor.message, self._editor.document
        if self._offered is None or message is None or message.action is not self._offered:
            return ()
        if document is None or document.plate is None:
            return ()
        corner = np.array([document.plate.left, document.plate.top], np.float32)
        contours = self._editor.derived.contours
        return tuple(
            outline + corner + np.array(piece.box[:2], np.float32)
            for piece in self.pieces
            for outline in contours(piece.there)
        )

    def poll(self) -> bool:
        """Offers what a new background shows; once a frame. Whether anything changed."""
        editor, document = self._editor, self._editor.committed
        plate = document.plate if document is not None else None
        if plate is self._seen or editor.hand.is_busy or editor.preview is not None:
            return False
        self._seen = plate
        if not editor.is_saved:  # else it was offered when it was edited
            self._offer()
        return True

    def _offer(self) -> None:
        """Says so where something of the current object was left out.

        Of many pieces most are no part of it: what lies behind spokes or leaves.
        """
        count = len(self.pieces)
        if not 0 < count <= MOST_OFFERED or self._editor.object is None:
            return
        self._offered = Action(t("Add it") if count == 1 else t("Add them"), self.add)
        name = self._editor.object.name
        question = t("Is the dotted piece a part of {name}?", name=name)
        if count > 1:
            question = t("Are the dotted pieces parts of {name}?", name=name)
        self._editor.say(question, self._offered)

    def add(self) -> None:
        """The pieces belong to the object: its outline takes them in, and its shape follows."""
        from objectmorpher_core.compose.plate.plate import hole_margin
        from objectmorpher_core.compose.plate.residue import with_parts

        editor, document, pieces = self._editor, self._editor.document, self.pieces
        thing = editor.object
        if document is None or document.plate is None or thing is None or thing.mask is None:
            return
        margin = hole_margin(*document.photo.size)
        mask = with_parts(thing.mask, document, pieces, margin)
        if thing.coverage is not None:  # soft elsewhere
            mask = np.where(mask & ~thing.mask, np.uint8(255), thing.coverage)
        editor.apply(t("Add what was left out"), edits.change_mask(document, editor.current, mask))

    def _all(self, document: Document) -> tuple[Ghost, ...]:
        from objectmorpher_core.compose.plate.plate import hole_margin
        from objectmorpher_core.compose.plate.residue import left_out

        if self._found[0] is not document.plate:
            margin = hole_margin(*document.photo.size)
            ghosts = self._editor.derived.ghosts(document)
            self._found = document.plate, left_out(document, ghosts, margin)
        return self._found[1]
