"""Opening, saving and exporting, and the questions about unsaved changes and unfinished files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Photo

from ..canvas.shape import Shapes, build_ready
from ..system import clipboard
from ..system.texts import t
from ..worker.requests import JobError
from .export_plan import FORMATS
from .opening import PHOTO_ENDINGS, SESSION_ENDING, OpenedFile, is_object, read_document, read_photo
from .settings import pictures_folder
from .tasks import SELECT, WRITE
from .view import ToolName

if TYPE_CHECKING:
    from .history import History
    from .intents.exporting import Exporting
    from .intents.selection import Selection
    from .state import EditorState, Tab
    from .tabs import Tabs
    from .tasks import Tasks

EXPORT_ENDINGS = tuple(
    dict.fromkeys(e for formats in FORMATS.values() for f in formats for e in f.endings)
)
OPEN = "open"  # kind of chores
_WRITING = f"{WRITE} "  # what the kinds of jobs and chores that write a file begin with
NAMED = 3  # files named in a message


class Dialog(Enum):
    """The file dialogs."""

    OPEN = "Open"
    SAVE = "Save session"
    EXPORT = "Export to"
    MASK_OPEN = "Import mask"
    MASK_SAVE = "Export mask"
    SHAPE_OPEN = "Use 3D file"
    VIEW_OPEN = "Add photo"
    MODEL_OPEN = "Use depth model"
    MODEL_FOLDER = "Use the model in a folder"
    PROFILE_OPEN = "Use colour profile"
    PROOF_OPEN = "Proof by colour profile"

    @property
    def is_opening(self) -> bool:
        """Whether it asks for a file that is there."""
        return self not in (Dialog.SAVE, Dialog.EXPORT, Dialog.MASK_SAVE)

    @property
    def is_about_a_photo(self) -> bool:
        """Whether the file is for what a tab shows, and not for the window."""
        files = (Dialog.SHAPE_OPEN, Dialog.VIEW_OPEN, Dialog.MASK_OPEN)
        return self in files or not self.is_opening


Uses = Mapping[Dialog, Callable[[Path], None]]
Opened = tuple[OpenedFile, Path | None]


class Filing:
    """Which file is which, and what waits for an answer about them."""

    def __init__(
        self, editor: EditorState, tasks: Tasks, exporting: Exporting, uses: Uses, tabs: Tabs
    ) -> None:
        """`uses`: what is done with the files of other dialogs."""
        self._editor = editor
        self._tasks, self._exporting, self._uses, self._tabs = tasks, exporting, uses, tabs
        self.fov: float | None = None  # degrees, of photos that are opened
        self.seed = 0  # likewise
        self._wanted: Dialog | None = None
        self._wanted_for: tuple[Dialog, History | None] | None = None  # until it is answered
        self.question: Callable[[], None] | None = None  # goes on when the changes may be lost
        self.asked: tuple[Tab, ...] = ()  # the tabs with the changes that the question is about
        self.leaving: Callable[[], None] | None = None  # goes on when all files are written
        self._after_save: Callable[[], None] | None = None
        self._saves_all = False  # as the answer was

    @property
    def wanted(self) -> Dialog | None:
        """The dialog that the window is to show; its answer is for the tab that asks for it."""
        return self._wanted

    @wanted.setter
    def wanted(self, dialog: Dialog | None) -> None:
        self._wanted = dialog
        if dialog is not None:
            self._wanted_for = dialog, self._editor.history

    @property
    def is_asking(self) -> bool:
        """Whether there is a question or a dialog, or may be one in a moment: keys are for that."""
        waits = (self.wanted, self.question, self.leaving, self._exporting.draft)
        is_at_work = bool(self.writing) or not self._editor.chores.is_idle
        return any(each is not None for each in waits) or (self._saves_all and is_at_work)

    def open(self, path: Path) -> None:
        """Opens a photo or a session in a tab, or goes to the tab that shows it already."""
        if not path.exists():
            self._editor.complain(
                t("{name} cannot be opened: there is no such file", name=path.name)
            )
            return
        shown = self._tab_of(path)
        if shown is None:
            self._open(path, lambda: self._remember(path))
        else:
            self._tabs.go(shown)

    def open_all(self, paths: Sequence[Path]) -> None:
        """Opens files one after another, each in a tab; what cannot be opened is named."""
        if len(paths) == 1:
            self.open(paths[0])
        else:
            self._open_next(list(paths), [], [])

    def drop(self, paths: Sequence[Path]) -> None:
        """Files were dropped on the window: those that can be opened are, each in a tab.

        A 3D object takes the place of what is selected.
        """
        if not paths:
            return
        if self._editor.mask is not None and is_object(paths[0]):
            self._uses[Dialog.SHAPE_OPEN](paths[0])
            return
        kinds = (*PHOTO_ENDINGS, SESSION_ENDING)
        usable = [p for p in paths if p.suffix.lower() in kinds and not p.is_dir()]
        if len(paths) == 1 or not usable:
            self.open(paths[0])
        else:
            self._open_next(usable, [], [p.name for p in paths if p not in usable])

    def _open_next(self, left: list[Path], opened: list[str], others: list[str]) -> None:
        """`opened` and `others`: names of files that are open by now, and that cannot be."""
        if not left:
            if opened and others:
                self._editor.say(t("Opened {name}; not opened: {others}", name=_listed(opened),
                                   others=_listed(others)))  # fmt: skip
            return
        path, *rest = left

        def go_on() -> None:
            self._remember(path)
            self._open_next(rest, [*opened, path.name], others)

        def pass_over() -> None:
            self._open_next(rest, opened, [*others, path.name])

        shown = self._tab_of(path)
        if shown is None:
            self._open(path, go_on, pass_over if rest or opened else None)
        else:
            self._tabs.go(shown, go_on)

    def _tab_of(self, path: Path) -> Tab | None:
        """The tab that shows the file as it is."""
        for tab in self._tabs.all:
            is_photo = tab.source == path and tab.history is not None and tab.history.count == 1
            if tab.path == path or is_photo:
                return tab
        return None

    def open_sample(self, path: Path, then: Callable[[], None] = lambda: None) -> None:
        """Opens a photo that came with the program: it is nobody's file to go back to."""

        def start() -> None:
            self._editor.tab.source = None
            then()

        self._open(path, start)

    def _remember(self, path: Path) -> None:
        self._editor.settings = self._editor.settings.with_recent(path)

    def close(self, tab: Tab) -> None:
        """Closes a tab, after the question about what is unsaved in it."""
        self.guard(lambda: self._tabs.close(tab), (tab,))

    def quit(self, end: Callable[[], None], but: Tab | None = None) -> None:
        """`end`, after one question about all tabs, save `but`, with unsaved changes.

        It waits for files that are being written, which the user may stop. What one of them will
        hold is asked about only if it does not.
        """
        tabs = tuple(tab for tab in self._tabs.all if tab is not but)
        hopeful = tuple(tab for tab in tabs if tab.is_being_saved)

        def leave() -> None:
            if self.writing:
                self._editor.message = None
                self.leaving = lambda: self.guard(end, hopeful)
            else:
                self.guard(end, hopeful)

        self.guard(leave, tuple(tab for tab in tabs if tab not in hopeful))

    @property
    def writing(self) -> tuple[str, ...]:
        """Names of the files that are being written, or will be."""
        kinds = (*self._editor.jobs.kinds, *self._editor.chores.kinds)
        return tuple(Path(kind.removeprefix(_WRITING)).name for kind in kinds
                     if kind.startswith(_WRITING))  # fmt: skip

    def poll(self) -> bool:
        """Leaves when the last file is written, unless that failed; once a frame."""
        then, said = self.leaving, self._editor.message
        if then is None or self.writing:
            return False
        self.leaving = None
        if said is None or not said.is_error:
            then()
        return True

    def answer_stop(self) -> None:
        """What is being written is given up; then it goes on at once."""
        for runs in (self._editor.jobs, self._editor.chores):
            for kind in runs.kinds:
                if kind.startswith(_WRITING):
                    runs.cancel(kind)

    def answer_stay(self) -> None:
        self.leaving = None

    def guard(self, then: Callable[[], None], tabs: tuple[Tab, ...]) -> None:
        """`then`, at once where nothing of `tabs` would be lost, or after the user's answer."""
        self._editor.hand.abort(self._editor)
        asked = tuple(tab for tab in tabs if not tab.is_saved)
        if not asked:
            then()
        elif len(asked) == 1:  # the user sees what it is about
            self._tabs.go(asked[0], lambda: self._ask(then, asked))
        else:
            self._ask(then, asked)

    def _ask(self, then: Callable[[], None], asked: tuple[Tab, ...]) -> None:
        self.question, self.asked = then, asked

    def answer_discard(self) -> None:
        then, self.question = self.question, None
        if then is not None:
            then()

    def answer_save(self) -> None:
        then, self.question = self.question, None
        if then is not None:
            self._save_all(self.asked, then)

    def _save_all(self, tabs: tuple[Tab, ...], then: Callable[[], None]) -> None:
        """Saves one after another; where the user does not name a file, the rest is left."""
        left = tuple(tab for tab in tabs if not tab.is_saved)
        self._saves_all = bool(left)
        if not left:
            then()
            return

        def save() -> None:
            self._after_save = lambda: self._save_all(left[1:], then)
            self.save()

        self._tabs.go(left[0], save)

    def answer_cancel(self) -> None:
        self.question = None

    def choose(self, dialog: Dialog, path: Path) -> None:
        """The user chose a file in a dialog; the tab that asked for it is shown again first."""
        asked, self._wanted_for = self._wanted_for, None
        if asked is None or asked[0] is not dialog or not dialog.is_about_a_photo:
            self._use(dialog, path)
            return
        tab = next((tab for tab in self._tabs.all if tab.history is asked[1]), None)
        if tab is not None:
            self._tabs.go(tab, lambda: self._use(dialog, path))
            return
        self.cancel_dialog()
        self._editor.complain(
            t("The photo that {name} was chosen for is not open any more", name=path.name)
        )

    def _use(self, dialog: Dialog, path: Path) -> None:
        if dialog is Dialog.OPEN:
            self.open(path)
        elif dialog is Dialog.SAVE:
            self.save_as(path if path.suffix else path.with_suffix(SESSION_ENDING))
        elif dialog is Dialog.MASK_SAVE:
            self._uses[dialog](path if path.suffix else path.with_suffix(".png"))
        elif dialog in self._uses:
            self._uses[dialog](path)
        elif self._exporting.draft is not None:
            self._exporting.set_path(path)
        else:
            self._exporting.export_to(path)

    def cancel_dialog(self) -> None:
        """The user closed a dialog without choosing."""
        self.wanted = self._wanted_for = self._after_save = None
        self._saves_all = False

    def save(self) -> None:
        """Save into the session's own file; ask for one where there is none yet."""
        if self._editor.path is None:
            self.wanted = Dialog.SAVE
        else:
            self.save_as(self._editor.path)

    def save_as(self, path: Path) -> None:
        then, self._after_save = self._after_save, None
        if path.suffix.lower() != SESSION_ENDING:
            usual, own = SESSION_ENDING, path.suffix
            sentence = t("a session's name ends in {usual}, not {own}", usual=usual, own=own)
            self._editor.complain(sentence)
            self._end_saving()
            return
        if any(tab.path == path and tab is not self._editor.tab for tab in self._tabs.all):
            sentence = t("{name} is open in another tab; choose another name", name=path.name)
            self._editor.complain(sentence)
            self._end_saving()
            return
        self._tasks.save(path, then, self._end_saving)

    def _end_saving(self) -> None:
        """A file was not saved: the others are not either, and keys are for the photo again."""
        self._saves_all = False

    def suggestion(self, dialog: Dialog) -> Path:
        """The file name a dialog begins with."""
        editor = self._editor
        source = editor.source or editor.path
        folder = source.parent if source else pictures_folder()
        if dialog.is_opening:
            return folder
        name = editor.document.photo.name if editor.document else "photo"
        stem = Path(name).stem
        if dialog is Dialog.SAVE:
            return editor.path or folder / f"{stem}{SESSION_ENDING}"
        if dialog is Dialog.MASK_SAVE:
            return folder / f"{stem}-mask.png"
        if self._exporting.draft is not None:
            return self._exporting.path
        ending = self._exporting.own_format.endings[0]
        return folder / f"{stem}-edited{ending}"

    def paste(self) -> None:
        """Opens the photo in the clipboard, or the file there."""

        def read(progress: Progress) -> Opened:
            pasted = clipboard.paste()
            if pasted.path is not None:
                return read_document(pasted.path, self.fov, self.seed, progress), pasted.path
            return read_photo(pasted.data, pasted.name, self.fov, self.seed), None

        self._begin(t("Pasting"), read, lambda: None)

    def _open(
        self, path: Path, then: Callable[[], None], pass_over: Callable[[], None] | None = None
    ) -> None:
        """Reads the file in a thread; `then` is called when it is shown."""

        def read(progress: Progress) -> Opened:
            return read_document(path, self.fov, self.seed, progress), path

        self._begin(t("Opening {name}", name=path.name), read, then, pass_over)

    def _begin(
        self, title: str, read: Callable[[Progress], Opened], then: Callable[[], None],
        pass_over: Callable[[], None] | None = None,
    ) -> None:  # fmt: skip
        """`pass_over` goes on with others where this cannot be opened; else that is said."""
        editor = self._editor

        def prepared(progress: Progress) -> tuple[OpenedFile, Path | None, Shapes]:
            opened, path = read(progress)
            return opened, path, build_ready(opened.document)

        def accept(answer: tuple[OpenedFile, Path | None, Shapes]) -> None:
            opened, path, shapes = answer
            self._tabs.open(opened.document, shapes)
            editor.tab.path = path if opened.is_session else None
            editor.tab.source = None if opened.is_session else path
            then()

        def fail(error: JobError) -> None:
            if pass_over is None:
                editor.complain_of(replace(error, trace="") if error.is_expected else error)
            else:
                pass_over()

        editor.chores.start(title, prepared, kind=OPEN, done=accept, failed=fail)

    def forget_recent(self, path: str) -> None:
        """A recent file that is not there any more."""
        settings = self._editor.settings
        recent = tuple(r for r in settings.recent if r != path)
        self._editor.settings = replace(settings, recent=recent)


def _listed(names: list[str]) -> str:
    """A few of them, and how many there are besides."""
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (t(" and {count} more", count=more) if more > 0 else "")


# A sample that opens with its thing lifted, so that a newcomer's first act is to drag it.


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
            editor.history.mark_saved()  # the artist has done nothing yet
            self._photo = None
        return False
