"""The photo's objects as things in a list."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.document import edits, visitor_edits
from objectmorpher_core.document.model import Document, EditObject, Photo, Placement

from ...canvas.shape import CanvasShape, build_shape, rehearse
from ...system import clipboard
from ...system.texts import t
from ...worker.requests import LIFT, JobError
from ..tasks import READ_MASK, SELECT
from ..view import USUAL_LEVEL, Action, StatusMessage, ToolName
from .composing import USUAL_SHADOW

if TYPE_CHECKING:
    from ..state import EditorState, Tab
    from ..tabs import Tabs
    from .posing import Posing


class Objects:
    """Adding, choosing, naming, hiding and ordering them."""

    def __init__(self, editor: EditorState, posing: Posing) -> None:
        self._editor = editor
        self._posing = posing
        self.renaming: int | None = None  # whose name is being typed
        self.carried: int | None = None  # whose row is being dragged up or down the list
        self._hidden: StatusMessage | None = None  # that one is hidden, as it was said last
        self._copied: StatusMessage | None = None  # that the current object is a copy

    def start_another(self) -> None:
        """The next click selects another object."""
        editor = self._editor
        if editor.document is not None:
            editor.hand.abort(editor)
            editor.current = len(editor.document.objects)
            self._posing.select(None)
            editor.view.tool, editor.view.selecting.level = ToolName.SELECT, USUAL_LEVEL

    def choose(self, k: int) -> None:
        """The tools change object `k` now."""
        self._editor.hand.abort(self._editor)
        self.take(k)

    def take_up(self, k: int) -> None:
        """Choose object `k`, which was clicked at its current place."""
        editor = self._editor
        self.take(k)
        if editor.object is not None:
            editor.say(t("{name} is chosen · Click it again to change its outline",
                         name=editor.object.name))  # fmt: skip

    def take(self, k: int) -> Callable[[], None]:
        """Choose an object for a stroke in progress; the result takes the choice back."""
        editor = self._editor
        before, selected = editor.current, self._posing.selected

        def restore() -> None:
            editor.current = before
            self._posing.select(*selected)

        editor.current = k
        self._posing.select(None)
        if not editor.is_lifted:
            editor.view.tool = ToolName.SELECT
        return restore

    def follow(self, before: Document, is_forth: bool) -> None:
        """After a step back or forth: the tools change the object that the step changed.

        Where objects are gone that is the one that they changed, or what is in its place now.
        """
        editor, now = self._editor, self._editor.document
        if now is None:
            return
        changed, gone = _others(now, before), _others(before, now)
        if len(now.objects) < len(before.objects):
            editor.current -= sum(k < editor.current for k in gone)
            if is_forth:  # else what is selected next takes the place of what was selected there
                editor.current = max(min(editor.current, len(now.objects) - 1), 0)
        elif changed and editor.current not in changed:
            editor.current = changed[0]

    def toggle_visible(self, k: int) -> None:
        """Shows or hides object `k`."""
        editor = self._editor
        if (document := editor.committed) is not None:
            is_visible = not document.objects[k].is_visible
            label = t("Show object") if is_visible else t("Hide object")
            editor.apply(label, edits.set_visible(document, k, is_visible))
            if editor.message is self._hidden:
                editor.message = None

    def take_out(self) -> None:
        """The current object is gone from the picture, and what is behind it shows."""
        editor, k = self._editor, self._editor.current
        document = editor.committed
        if document is None or not editor.is_lifted or editor.hand.is_busy:
            return
        editor.apply(t("Take out of the photo"), edits.set_visible(document, k, False))
        name = document.objects[k].name
        self._say_unseen(t("{name} is taken out of the photo", name=name), k)

    def say_hidden(self, k: int) -> None:
        """That object `k` is hidden, with a button that shows it."""
        name = self._editor.opened.objects[k].name
        self._say_unseen(t("{name} is hidden", name=name), k)

    def _say_unseen(self, text: str, k: int) -> None:
        action = Action(t("Show object"), lambda: self.toggle_visible(k))
        self._editor.say(text, action)
        self._hidden = self._editor.message

    def forget_lost(self) -> None:
        """After a step back: another object is current where the current one is not there."""
        editor = self._editor
        self.renaming = self.carried = None
        is_selecting = editor.view.tool in (ToolName.SELECT, ToolName.MASK)
        if editor.document is not None and not is_selecting:
            editor.current = max(min(editor.current, len(editor.document.objects) - 1), 0)

    def rename(self, k: int, name: str) -> None:
        """Gives object `k` another name; an empty one changes nothing."""
        editor = self._editor
        self.renaming = None
        document = editor.committed
        if document is None or not name.strip() or name.strip() == document.objects[k].name:
            return
        editor.apply(t("Rename object"), edits.rename(document, k, name))

    def duplicate(self) -> None:
        """A copy of the current object, which the tools change from now on."""
        editor = self._editor
        document = editor.committed
        if document is None or not editor.is_lifted or editor.hand.is_busy:
            return
        copied = edits.duplicate(document, editor.current)
        editor.apply(t("Duplicate object"), copied)
        self.choose(len(copied.objects) - 1)
        if editor.view.tool is ToolName.SELECT:  # a click would change the outline of both
            editor.view.tool = ToolName.PLACE
        self.say_copied()

    def say_copied(self) -> None:
        """Say that the current object is a copy, which nobody sees yet."""
        if (twin := self._editor.object) is not None:
            self._editor.say(
                t("{name} lies exactly over the original · Drag it away", name=twin.name)
            )
            self._copied = self._editor.message

    @property
    def is_copy_announced(self) -> bool:
        """Whether it is said that a copy is to be dragged away, for which a tool may be chosen."""
        return self._copied is not None and self._editor.message is self._copied

    @property
    def _is_in_photo(self) -> bool:
        """Whether the photo shows the current object where it is edited no more: it is neither
        another photo's nor a copy."""
        item, k = self._editor.object, self._editor.current
        if item is None:
            return True
        others = (o for i, o in enumerate(self._editor.opened.objects) if i != k)
        return not item.is_visitor and all(o.mask is not item.mask for o in others)

    @property
    def removing(self) -> str:
        """What removing the current object is called."""
        return t("Put back into the photo") if self._is_in_photo else t("Discard object")

    @property
    def is_to_be_taken_out(self) -> bool:
        """Whether a bin takes the current object out of the picture: it is lifted off the photo.

        What is no part of the photo, or only selected, is dropped from the list instead.
        """
        return self._editor.is_lifted and self._is_in_photo

    def remove(self) -> None:
        """The current object is not edited any more: the photo shows it as it was."""
        editor = self._editor
        document = editor.committed
        if document is None or editor.object is None or editor.hand.is_busy:
            return
        name, k, is_in_photo = editor.object.name, editor.current, self._is_in_photo
        if editor.object.is_locked:
            editor.say_locked(k)
            return
        # What these would bring is for an object by its number.
        for job in (SELECT, LIFT, READ_MASK):
            editor.jobs.cancel(job)
        left = edits.remove_object(document, k)
        editor.apply(self.removing, left)
        self.choose(max(min(k, len(left.objects) - 1), 0))
        if is_in_photo:
            editor.say(t("{name} is as it was in the photo · Ctrl+Z undoes that", name=name))
        else:
            editor.say(t("{name} is removed · Ctrl+Z brings it back", name=name))

    def other_at(self, canvas_xy: np.ndarray) -> int | None:
        """Another lifted object that is in front of all at canvas px; None where the current is."""
        editor, document = self._editor, self._editor.document
        order = self.order()
        if document is None or len(order) < 2:
            return None
        for k in reversed(order):
            if document.objects[k].lifted is None:  # it stays in front, and is nobody's to drag
                continue
            is_free = k == editor.current or not document.objects[k].is_locked
            is_there = is_free and document.objects[k].is_visible
            if is_there and editor.derived.surface_at(document, k, editor.view, canvas_xy):
                return None if k == editor.current or self.is_over_current(k) else k
        return None

    def is_over_current(self, k: int) -> bool:
        """Whether object `k` is a copy exactly where the current one is: nobody sees which."""
        editor = self._editor
        other, own = editor.opened.objects[k], editor.object
        return own is not None and all(
            (other.lifted is own.lifted, other.pose is own.pose, other.placement == own.placement)
        )

    def toggle_front(self) -> None:
        """Keeps the current object in front of what is edited, as it is in the photo, or not."""
        editor, k = self._editor, self._editor.current
        document, item = editor.committed, editor.object
        if document is None or item is None or editor.hand.is_busy:
            return
        if item.is_locked:
            editor.say_locked(k)
            return
        if item.stays_in_front:
            editor.apply(t("Do not keep in front"), edits.stop_keeping_in_front(document, k))
            return
        editor.jobs.cancel(LIFT)  # what it would bring is to be edited
        try:
            editor.apply(t("Keep in front"), edits.keep_in_front(document, k))
        except edits.EditError as error:
            editor.complain(str(error))
            return
        self._say_front(k)

    def _say_front(self, k: int) -> None:
        """What staying in front means, or that it is hardly what was meant; one click undoes it."""
        editor, document = self._editor, self._editor.committed
        assert document is not None
        from objectmorpher_core.compose.order import doubt_about_front

        name, posed = document.objects[k].name, partial(self._editor.derived.posed, document)
        if doubt_about_front(document, k, posed) is None:
            editor.say(t("{name} covers what moves behind it", name=name))
            return
        editor.say(
            t("{name} covers most of the picture or of what you moved: is it the background?",
              name=name),
            Action(t("Do not keep in front"), self.toggle_front),
        )  # fmt: skip

    # Which covers which

    def order(self) -> list[int]:
        """The lifted objects and what stays in front, back to front."""
        document = self._editor.committed
        return [] if document is None else self._editor.derived.order(document)

    def listed(self) -> list[int]:
        """Return all selected objects in a list's order: the front one first."""
        document = self._editor.document
        objects = document.objects if document else ()
        order = [k for k in self.order() if k < len(objects)]
        others = [k for k, o in enumerate(objects) if o.mask is not None and k not in order]
        return [*reversed(others), *reversed(order)]

    def why_not_raise(self, steps: int) -> str | None:
        """Why the current object cannot go so many places to the front, or (negative) back."""
        order = self.order()
        if self._editor.current not in order:
            is_lifting, why = self._editor.is_lifting, self._editor.why_no_shape
            return why if is_lifting else t("Lift an object first, or keep it in front")
        if len(order) < 2:
            return t("There is no other object")
        place = order.index(self._editor.current)
        if steps > 0:
            return t("It is in front of all others") if place == len(order) - 1 else None
        return t("It is behind all others") if place == 0 else None

    def raise_by(self, steps: int, label: str) -> None:
        """Takes the current object past so many others, to the front or (negative) to the back."""
        order, k = self.order(), self._editor.current
        self._put(k, min(max(order.index(k) + steps, 0), len(order) - 1), label)

    def _put(self, k: int, place: int, label: str) -> None:
        """Object `k` to a place of `order`."""
        from objectmorpher_core.compose.order import reordered

        editor, document = self._editor, self._editor.committed
        if document is None or editor.hand.is_busy:
            return
        order = self.order()
        order.remove(k)
        order.insert(place, k)
        posed = partial(editor.derived.posed, document)
        editor.apply(label, reordered(document, k, order, posed))

    # A row of the list that is dragged

    def carry(self, k: int, has_tabs: bool = False) -> bool:
        """Takes up object `k`'s row; whether it has a place among others, or in another tab."""
        order = self.order()
        if k in order and (len(order) > 1 or has_tabs) and not self._editor.hand.is_busy:
            self.carried = k
        return self.carried is not None

    def landing(self, gap: int) -> int | None:
        """Above which row of the list the carried one would land, let go nearest above row `gap`.

        None where nothing is carried, or it would stay where it is.
        """
        shown, order = self.listed(), self.order()
        if self.carried not in order:
            return None
        gap = min(max(gap, len(shown) - len(order)), len(shown))  # what has no shape is above
        return None if gap - shown.index(self.carried) in (0, 1) else gap

    def drop(self, gap: int) -> None:
        """Lets the carried row go: its object, now the current one, is before those below it."""
        k, landing = self.carried, self.landing(gap)
        self.carried = None
        if k is None:
            return
        self.choose(k)
        if landing is not None:
            below = [other for other in self.listed()[landing:] if other != k]
            self._put(k, len(below), t("Change the order"))


def _others(document: Document, but: Document) -> list[int]:
    """The objects of one document that are not in the other as they are."""
    return [k for k, o in enumerate(document.objects) if all(o is not one for one in but.objects)]


# An object of one photo that is copied into another: kept in the program, pasted in any tab.

PASTE = "paste object"  # kind of chores
T = TypeVar("T")


class Pasting:
    """Copying an object, and pasting it in the photo of another tab."""

    def __init__(self, editor: EditorState, objects: Objects, tabs: Tabs) -> None:
        self._editor, self._objects, self._tabs = editor, objects, tabs
        self._copied: EditObject | None = None
        self._original: EditObject | None = None  # the same as it was in its own photo
        self._photo: weakref.ref[Photo] | None = None  # it was copied from
        self._picture: bytes | None = b""  # PNG of it in the clipboard; None: not there yet
        self._waiting: list[tuple[Tab, Callable[[], None]]] = []  # asked for while one is pasted

    @property
    def has_copied(self) -> bool:
        """Whether there is an object to paste."""
        return self._copied is not None

    def copy(self) -> None:
        """Remembers the current object, if it is lifted, as it is now; else nothing is copied."""
        from objectmorpher_core.compose.light.lighting import Lighting

        self._copied = self._original = self._picture = None
        editor, document = self._editor, self._editor.committed
        if document is None or not editor.is_lifted or editor.current >= len(document.objects):
            return
        k = editor.current
        item = document.objects[k]
        puppet = editor.derived.shape(document.photo, item).puppet
        light = Lighting(document).around(puppet.posed(None, Placement()))
        self._copied = visitor_edits.departing(document, k, light)
        self._original = item
        self._photo = weakref.ref(document.photo)

    def offered(self, png: bytes) -> None:
        """This picture of the copied object is for other programs."""
        self._picture = png

    def paste_newest(self, paste_photo: Callable[[], None]) -> None:
        """Pastes the copied object, unless something else was copied since: then that."""

        def look() -> None:
            picture = self._picture
            self._start(
                lambda: picture is None or clipboard.holds(picture),
                lambda is_own: self._paste() if is_own else paste_photo(),
            )

        self._in_turn(look)

    def paste(self) -> None:
        """The copied object in the photo that is shown, as one step, when it can be drawn."""
        self._in_turn(self._paste)

    def _in_turn(self, paste: Callable[[], None]) -> None:
        """Calls it now, or after what is being pasted: Ctrl+V twice in a moment pastes twice."""
        self._waiting.append((self._editor.tab, paste))
        self._go_on()

    def _go_on(self) -> None:
        while self._waiting and not self._editor.chores.is_busy(PASTE):
            tab, paste = self._waiting.pop(0)
            if tab is self._editor.tab:
                paste()

    def _start(self, find: Callable[[], T], take: Callable[[T], None]) -> None:
        """Finds in a thread what `take` takes. If that fails, what waits would fail, too."""

        def accept(found: T) -> None:
            take(found)
            self._go_on()

        def fail(error: JobError) -> None:
            self._waiting.clear()
            self._editor.complain_of(error)

        self._editor.chores.start(
            t("Pasting"), lambda progress: find(), kind=PASTE, done=accept, failed=fail,
            cancelled=self._waiting.clear,
        )  # fmt: skip

    def _paste(self) -> None:
        from objectmorpher_core.compose.order import brought_into_sight

        editor, document, copied = self._editor, self._editor.committed, self._copied
        if document is None or copied is None or editor.hand.is_busy:
            return
        tab, photo = editor.tab, document.photo
        if self._return(document):
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
            there = visitor_edits.with_visitor(now, visitor)
            posed = partial(editor.derived.posed, there)
            there = brought_into_sight(there, len(now.objects), posed)
            self._show(there)
            self._say_there()

        self._start(build, accept)

    def carry(self, tab: Tab) -> None:
        """Copies the current object, or that of the carried row, into another tab; shows that.

        Into one without a photo nothing can be copied, which is said.
        """
        k, self._objects.carried = self._objects.carried, None
        if k is not None:
            self._objects.choose(k)
        if tab.document is None:
            self._editor.say(t("No photo is open in that tab · Open one there first"))
        elif self._editor.is_lifted:
            self.copy()
            self._picture = b""
            self._tabs.go(tab, self.paste)

    def _return(self, document: Document) -> bool:
        """In its own photo it is a copy as of Duplicate, as it was when it was copied.

        False in another one, and where the original is gone.
        """
        original = self._original
        if original is None or self._photo is None or self._photo() is not document.photo:
            return False
        alike = [k for k, item in enumerate(document.objects) if item.mask is original.mask]
        if not alike:
            return False
        k = alike[0]
        there = edits.duplicate(document.with_object(k, original), k)
        self._show(there.with_object(k, document.objects[k]))
        if any(map(self._objects.is_over_current, alike)):
            self._objects.say_copied()
        else:
            self._say_there()
        return True

    def _say_there(self) -> None:
        name = self._editor.chosen.name
        self._editor.say(t("{name} is in this photo now · Drag it to its place", name=name))

    def _show(self, changed: Document) -> None:
        editor = self._editor
        editor.apply(t("Paste object"), changed)
        self._objects.choose(len(changed.objects) - 1)
        editor.view.tool = ToolName.PLACE
