"""The place in the photo that a press on the canvas means while the canvas shows the edit.

What is seen is what is meant. On the current object, wherever it was moved, a press lands where
that piece of it is in the photo. On another object that was moved it lands on that object.
Everywhere else, and everywhere while the photo is shown (X is held), it lands on the photo.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.document.model import Document

from ..view import Shown, ToolName

if TYPE_CHECKING:
    from ..state import EditorState
    from .objects import Objects

OF_THE_PHOTO = (ToolName.SELECT, ToolName.MASK)  # tools that work on the photo as it was


class Of(Enum):
    """Parts of the edited picture that belong to no object."""

    PHOTO = "photo"
    BACKGROUND = "background"  # filled in where an object was


class Landing:
    """A map from canvas px to the place that they mean."""

    def __init__(self, editor: EditorState, objects: Objects) -> None:
        self._editor = editor
        self._objects = objects
        self._offset = np.zeros(2)  # image px, of the stroke in progress, beside its object
        self._is_carried = False  # whether that stroke began on an object that was moved

    @property
    def is_edit_shown(self) -> bool:
        """Whether the canvas shows an edit that differs from the photo."""
        editor = self._editor
        document, view = editor.document, editor.view
        if document is None or view.is_before or view.shown is not Shown.COMPOSITE:
            return False
        return any(o.is_moved for o in document.objects)

    @property
    def is_current_moved(self) -> bool:
        """Whether the current object is seen elsewhere than in the photo."""
        thing = self._editor.object
        if thing is None or thing.is_visitor:
            return False
        return thing.is_moved and thing.is_visible and self.is_edit_shown

    @property
    def is_current_gone(self) -> bool:
        """Whether the picture that is shown is without the current object."""
        thing = self._editor.object
        is_hidden = thing is not None and thing.lifted is not None and not thing.is_visible
        return is_hidden and self.is_edit_shown

    def moved_at(self, canvas_xy: np.ndarray) -> int | None:
        """Index of the moved object that is seen at canvas px (2,); None where none is."""
        document = self._editor.document
        if document is None or not self.is_edit_shown:
            return None
        k = self._seen_at(document, canvas_xy)
        return k if k is not None and document.objects[k].is_moved else None

    def left_at(self, canvas_xy: np.ndarray) -> int | None:
        """Index of the object that was at canvas px (2,) and has left; None where anything is."""
        from objectmorpher_core.compose.order import leaves_a_hole

        editor, document = self._editor, self._editor.document
        if document is None or not self.is_edit_shown or not editor.is_on_photo(canvas_xy):
            return None
        column, row = np.floor(editor.view.image_from_canvas(canvas_xy)).astype(int)
        objects = document.objects
        there = [k for k, o in enumerate(objects) if o.mask is not None and o.mask[row, column]]
        if not there or not all(objects[k].is_moved and leaves_a_hole(objects, k) for k in there):
            return None
        return there[0] if self._seen_at(document, canvas_xy) is None else None

    def _seen_at(self, document: Document, canvas_xy: np.ndarray) -> int | None:
        """Index of the lifted object that is in front of all others at canvas px (2,)."""
        editor = self._editor
        for k in reversed(self._objects.order()):
            item = document.objects[k]
            is_seen = item.lifted is not None and item.is_visible
            if is_seen and editor.derived.surface_at(document, k, editor.view, canvas_xy):
                return k
        return None

    def owner_at(self, canvas_xy: np.ndarray) -> int | Of | None:
        """Return the owner of canvas px (2,) of the edit: an object's index, or `Of`.

        None beside the photo, and where something else than the edit is shown.
        """
        editor = self._editor
        document = editor.document
        is_shown = self.is_edit_shown and editor.is_on_photo(canvas_xy)
        if document is None or not is_shown:
            return None
        if (k := self._seen_at(document, canvas_xy)) is not None:
            return k
        plate = editor.derived.plate(document)
        if plate is None:
            return Of.PHOTO
        column, row = np.floor(editor.view.image_from_canvas(canvas_xy)).astype(int)
        x0, y0, x1, y1 = plate.box
        is_inside = x0 <= column < x1 and y0 <= row < y1
        is_filled = is_inside and plate.hole[row - y0, column - x0]
        return Of.BACKGROUND if is_filled else Of.PHOTO

    def in_photo(self, canvas_xy: np.ndarray) -> F64:
        """Image px (2,) that is meant by canvas px (2,)."""
        found = self._on_current(canvas_xy)
        return self._editor.view.image_from_canvas(canvas_xy) if found is None else found

    def begin(self, canvas_xy: np.ndarray) -> F64:
        """Return the landing of a stroke's beginning, which stays on the object or on the photo."""
        found = self._on_current(canvas_xy)
        plain = self._editor.view.image_from_canvas(canvas_xy)
        self._is_carried = found is not None
        self._offset = np.zeros(2) if found is None else found - plain
        return plain + self._offset

    def go_on(self, canvas_xy: np.ndarray) -> F64:
        """Return the landing of a stroke's next point; off the object it keeps its distance."""
        plain = self._editor.view.image_from_canvas(canvas_xy)
        if self._is_carried and (found := self._on_current(canvas_xy)) is not None:
            self._offset = found - plain
        return plain + self._offset

    def _on_current(self, canvas_xy: np.ndarray) -> F64 | None:
        """Image px (2,) where the photo has what the current object shows at canvas px."""
        editor = self._editor
        document, k = editor.document, editor.current
        if document is None or not self.is_current_moved or self.moved_at(canvas_xy) != k:
            return None
        seen = editor.derived.surface_at(document, k, editor.view, canvas_xy)
        lifted = document.objects[k].lifted
        if seen is None or lifted is None:
            return None
        return document.photo.camera.project(lifted.world_points(seen.rest))
