"""An object of one photo that is copied into another: kept in the program, pasted in any tab."""

from __future__ import annotations

import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.document import edits, visitor_edits
from objectmorpher_core.document.model import Document, EditObject, Photo, Placement

from ...canvas.shape import CanvasShape, build_shape, rehearse
from ...system.texts import t
from ..view import ToolName
from .composing import USUAL_SHADOW

if TYPE_CHECKING:
    from ..state import EditorState
    from ..tab import Tab
    from ..tabs import Tabs
    from .objects import Objects

PASTE = "paste object"  # kind of chores


class Pasting:
    """Copying an object, and pasting it in the photo of another tab."""

    def __init__(self, editor: EditorState, objects: Objects, tabs: Tabs) -> None:
        self._editor, self._objects, self._tabs = editor, objects, tabs
        self._copied: EditObject | None = None
        self._photo: weakref.ref[Photo] | None = None  # it was copied from

    @property
    def has_copied(self) -> bool:
        """Whether there is an object to paste."""
        return self._copied is not None

    def copy(self) -> None:
        """Remembers the current object, if it is lifted, as it is now."""
        from objectmorpher_core.compose.light.lighting import Lighting

        editor, document = self._editor, self._editor.committed
        if document is None or not editor.is_lifted or editor.current >= len(document.objects):
            return
        k = editor.current
        item = document.objects[k]
        puppet = editor.derived.shape(document.photo, item).puppet
        light = Lighting(document).around(puppet.posed(None, Placement()))
        self._copied = visitor_edits.departing(document, k, light)
        self._photo = weakref.ref(document.photo)

    def paste(self) -> None:
        """The copied object in the photo that is shown, as one step, when it can be drawn."""
        editor, document, copied = self._editor, self._editor.committed, self._copied
        if document is None or copied is None or editor.hand.is_busy:
            return
        tab, photo = editor.tab, document.photo
        if self._photo is not None and self._photo() is photo and self._return(document, copied):
            return

        def build() -> tuple[EditObject, CanvasShape]:
            shape = build_shape(photo.camera, copied)
            is_body = shape.puppet.lifted.is_body

            def posed(placement: Placement) -> F64:
                return np.asarray(shape.puppet.posed(copied.pose, placement).means[is_body])

            visitor = visitor_edits.arrived(document, copied, posed)
            rehearse(shape, photo.camera, visitor.placement)
            shape.is_rehearsed = True
            return visitor, shape

        def accept(answer: tuple[EditObject, CanvasShape]) -> None:
            now = editor.committed
            if editor.tab is not tab or now is None or now.photo is not photo:
                return  # another tab was shown since
            visitor, shape = answer
            if visitor.is_grounded:
                visitor = replace(visitor, shadow=replace(visitor.shadow, strength=USUAL_SHADOW))
            editor.hand.abort(editor)
            editor.derived.remember(visitor, shape)
            self._show(visitor_edits.with_visitor(now, visitor), visitor.name)

        editor.chores.start(
            t("Pasting"), lambda progress: build(), kind=PASTE, done=accept,
            failed=editor.complain_of,
        )  # fmt: skip

    def carry(self, tab: Tab) -> None:
        """Copies the current object into another tab, and shows that one."""
        if tab.document is not None and self._editor.is_lifted:
            self.copy()
            self._tabs.go(tab, self.paste)

    def _return(self, document: Document, copied: EditObject) -> bool:
        """In its own photo it is a copy as of Duplicate; False where the original is gone."""
        for k, item in enumerate(document.objects):
            if item.matte is copied.matte and item.lifted is not None:
                twin = edits.duplicate(document, k)
                self._show(twin, twin.objects[-1].name)
                return True
        return False

    def _show(self, changed: Document, name: str) -> None:
        editor = self._editor
        editor.apply(t("Paste object"), changed)
        self._objects.choose(len(changed.objects) - 1)
        editor.view.tool = ToolName.PLACE
        editor.say(t("{name} is in this photo now · Drag it to its place", name=name))
