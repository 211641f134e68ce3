"""Several photos open at once: their tabs, in the order of the bar."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.document.model import Document
from objectmorpher_core.document.transparency import colours_of

from ..canvas.shape import Shapes, build_ready
from ..system.texts import t
from .state import Tab

if TYPE_CHECKING:
    from objectmorpher_core.lift.registration.other_photo import OtherPhoto

    from .autosave import Autosave
    from .intents.posing import Posing
    from .state import EditorState
    from .tasks import Tasks

SHOW = "show"  # kind of chores


class Tabs:
    """All tabs, of which `editor.tab` is shown. Each has its document, history, files and view.

    A tab that is not shown keeps these, and the last one left what drawing its objects takes; all
    else is computed again. Together their histories hold as much as one alone may.
    """

    def __init__(
        self, editor: EditorState, posing: Posing, tasks: Tasks,
        start: Callable[[Document, Shapes], None], leave: Callable[[], None],
    ) -> None:  # fmt: skip
        """`start` shows a new document in the tab that is shown; `leave` stops what runs for it."""
        self._editor, self._posing, self._tasks = editor, posing, tasks
        self._start, self._leave = start, leave
        self.aimed: Tab | None = None  # an object that is dragged would be let go on it
        self._ended: list[Autosave] = []  # of tabs that were closed

    @property
    def all(self) -> tuple[Tab, ...]:
        return self._editor.all_tabs

    def open(self, document: Document, shapes: Shapes = ()) -> None:
        """Shows a document that was read: in a new tab, or in the place of the start screen."""
        if self._editor.committed is not None:
            self.add()
        self._start(document, shapes)
        self._share_memory()

    def selected(self, path: Path) -> OtherPhoto | None:
        """A photo's file as a tab shows it, with the last object that is selected there."""
        from objectmorpher_core.lift.registration.other_photo import OtherPhoto

        for tab in self.all:
            if (document := tab.document) is None or tab.source != path:
                continue
            chosen = [item for item in document.objects if item.selection is not None]
            if chosen and (mask := chosen[-1].selection) is not None:
                photo = document.photo
                return OtherPhoto(photo.name, colours_of(photo.picture), photo.camera, mask)
        return None

    def add(self) -> None:
        """The start screen in a new tab, beside the one that is shown."""
        tab, at = Tab(), self.all.index(self._editor.tab) + 1
        self._editor.all_tabs = (*self.all[:at], tab, *self.all[at:])
        self._show(tab)

    def go(self, tab: Tab, then: Callable[[], None] = lambda: None) -> None:
        """Shows a tab, as soon as its objects can be drawn; `then` is called after that."""
        editor, document = self._editor, tab.document
        if tab is editor.tab:
            then()
            return

        def accept(shapes: Shapes) -> None:
            if tab in self.all and tab is not editor.tab:
                tab.shapes = shapes
                self._show(tab)
            then()

        known = {id(thing) for thing, _ in tab.shapes}
        objects = () if document is None else document.objects
        if document is None or all(o.lifted is None or id(o) in known for o in objects):
            accept(tab.shapes)
            return
        editor.chores.start(
            t("Opening {name}", name=tab.name), lambda progress: build_ready(document), kind=SHOW,
            done=accept, failed=editor.complain_of,
        )  # fmt: skip

    def step(self, by: int) -> None:
        """Shows the next tab, or the one before; after the last comes the first."""
        at = self.all.index(self._editor.tab)
        self.go(self.all[(at + by) % len(self.all)])

    def move(self, tab: Tab, at: int) -> None:
        """Puts a tab at another place of the bar."""
        others = [other for other in self.all if other is not tab]
        self._editor.all_tabs = (*others[:at], tab, *others[at:])

    def close(self, tab: Tab) -> None:
        """Closes a tab for good; nothing is asked here. The last one becomes the start screen."""
        if len(self.all) == 1:
            self._leave()
            self._editor.forget_document()
        elif tab is self._editor.tab:
            at = self.all.index(tab)
            self.go(self.all[at + 1 if at == 0 else at - 1], lambda: self._drop(tab))
        else:
            self._drop(tab)

    def _drop(self, tab: Tab) -> None:
        if tab is self._editor.tab or tab not in self.all:
            return
        self._editor.all_tabs = tuple(other for other in self.all if other is not tab)
        tab.history, tab.shapes = None, ()
        tab.autosave.end()
        self._ended.append(tab.autosave)
        self._share_memory()

    def _show(self, tab: Tab) -> None:
        editor, left = self._editor, self._editor.tab
        editor.hand.abort(editor)
        left.selected, left.wishes = self._posing.selected, dict(self._tasks.wishes)
        left.keep_view(editor.view)
        shapes, document = tab.shapes, left.document
        for other in self.all:
            other.shapes = ()
        if document is not None:
            things = [thing for thing in document.objects if thing.lifted is not None]
            left.shapes = [(o, editor.derived.shape(document.photo, o)) for o in things]
        self._leave()
        editor.tab = tab
        editor.derived.adopt(shapes)
        tab.restore_view(editor.view)
        if tab.document is not None:
            editor.view.suit_brush(tab.document.photo.size)
        self._posing.select(*tab.selected)
        if not editor.is_lifted:
            self._tasks.read_photo()
        self._tasks.resume(tab.wishes)

    def _share_memory(self) -> None:
        shared = (self._editor.settings.history_mb << 20) // len(self.all)
        for tab in self.all:
            if tab.history is not None:
                tab.history.limit_to(shared)

    def keep_safe(self) -> bool:
        """Once a frame: has unsaved work of every tab written. Whether there is a new complaint."""
        return any([tab.autosave.poll(self._editor.complain) for tab in self.all])

    def forget_all(self) -> None:
        """The program is closed: no tab holds anything that would be recovered."""
        for tab in self.all:
            tab.history = None

    def end(self) -> None:
        """Waits until what is to be recovered, and only that, is on the disk."""
        for tab in self.all:
            tab.autosave.end()
        for autosave in (*self._ended, *(tab.autosave for tab in self.all)):
            autosave.join()
