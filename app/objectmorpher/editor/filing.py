"""Opening, saving and exporting, and the one question: what about unsaved changes?"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Document

from ..canvas.shape import Shapes, build_ready
from ..system import clipboard
from ..system.texts import t
from ..worker.requests import JobError
from .export_plan import FORMATS
from .opening import PHOTO_ENDINGS, SESSION_ENDING, OpenedFile, is_object, read_document, read_photo

if TYPE_CHECKING:
    from .intents.exporting import Exporting
    from .state import EditorState
    from .tasks import Tasks

EXPORT_ENDINGS = tuple(
    dict.fromkeys(e for formats in FORMATS.values() for f in formats for e in f.endings)
)
OPEN = "open"  # kind of chores
NAMED = 3  # files named in a message


class Dialog(Enum):
    """The file dialogs."""

    OPEN = "Open"
    SAVE = "Save session"
    EXPORT = "Export to"
    MASK_OPEN = "Import mask"
    MASK_SAVE = "Export mask"
    SHAPE_OPEN = "Use 3D file"
    MODEL_OPEN = "Use depth model"
    MODEL_FOLDER = "Use the model in a folder"
    PROFILE_OPEN = "Use colour profile"

    @property
    def is_opening(self) -> bool:
        """Whether it asks for a file that is there."""
        return self not in (Dialog.SAVE, Dialog.EXPORT, Dialog.MASK_SAVE)


Uses = Mapping[Dialog, Callable[[Path], None]]
Start = Callable[[Document, Shapes], None]


class Filing:
    """Which file is which, and what waits for an answer about them."""

    def __init__(
        self, editor: EditorState, tasks: Tasks, exporting: Exporting, uses: Uses, start: Start
    ) -> None:
        """`uses`: what is done with the files of other dialogs; `start` shows a document."""
        self._editor = editor
        self._tasks, self._exporting, self._uses, self._start = tasks, exporting, uses, start
        self.fov: float | None = None  # degrees, of photos that are opened
        self.seed = 0  # likewise
        self.wanted: Dialog | None = None  # the window shows it
        self.question: Callable[[], None] | None = None  # goes on when the changes may be lost
        self._after_save: Callable[[], None] | None = None

    def open(self, path: Path) -> None:
        """Opens a photo or a session, after the question about unsaved changes."""
        if not path.exists():  # then nothing has to be given up
            self._editor.complain(
                t("{name} cannot be opened: there is no such file", name=path.name)
            )
            return
        self.guard(lambda: self._open(path, lambda: self._remember(path)))

    def drop(self, paths: Sequence[Path]) -> None:
        """Files were dropped on the window: the first that can be opened is.

        A 3D object takes the place of what is selected.
        """
        if not paths:
            return
        if self._editor.mask is not None and is_object(paths[0]):
            self._uses[Dialog.SHAPE_OPEN](paths[0])
            return
        kinds = (*PHOTO_ENDINGS, SESSION_ENDING)
        usable = [p for p in paths if p.suffix.lower() in kinds and not p.is_dir()]
        chosen = usable[0] if usable else paths[0]
        others = [p.name for p in paths if p is not chosen]

        def then() -> None:
            self._remember(chosen)
            if others:
                self._editor.say(t("Opened {name}; not opened: {others}", name=chosen.name,
                                   others=_listed(others)))  # fmt: skip

        self.guard(lambda: self._open(chosen, then))

    def open_sample(self, path: Path, then: Callable[[], None] = lambda: None) -> None:
        """Opens a photo that came with the program: it is nobody's file to go back to."""

        def start() -> None:
            self._editor.source = None
            then()

        self.guard(lambda: self._open(path, start))

    def _remember(self, path: Path) -> None:
        self._editor.settings = self._editor.settings.with_recent(path)

    def guard(self, then: Callable[[], None]) -> None:
        """`then`, at once where nothing would be lost, or after the user's answer."""
        self._editor.hand.abort(self._editor)
        if self._editor.is_saved:
            then()
        else:
            self.question = then

    def answer_discard(self) -> None:
        then, self.question = self.question, None
        if then is not None:
            then()

    def answer_save(self) -> None:
        self._after_save, self.question = self.question, None
        self.save()

    def answer_cancel(self) -> None:
        self.question = None

    def choose(self, dialog: Dialog, path: Path) -> None:
        """The user chose a file in a dialog."""
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
        self.wanted = self._after_save = None

    def save(self) -> None:
        """Save into the session's own file; ask for one where there is none yet."""
        if self._editor.path is None:
            self.wanted = Dialog.SAVE
        else:
            self.save_as(self._editor.path)

    def save_as(self, path: Path) -> None:
        if path.suffix.lower() != SESSION_ENDING:
            usual, own = SESSION_ENDING, path.suffix
            sentence = t("a session's name ends in {usual}, not {own}", usual=usual, own=own)
            self._editor.complain(sentence)
            return
        then, self._after_save = self._after_save, None
        self._tasks.save(path, then)

    def suggestion(self, dialog: Dialog) -> Path:
        """The file name a dialog begins with."""
        editor = self._editor
        source = editor.source or editor.path
        folder = source.parent if source else Path.home()
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
        """Opens the photo in the clipboard, or the file there, after the usual question."""

        def read(progress: Progress) -> tuple[OpenedFile, Path | None]:
            pasted = clipboard.paste()
            if pasted.path is not None:
                return read_document(pasted.path, self.fov, self.seed, progress), pasted.path
            return read_photo(pasted.data, pasted.name, self.fov, self.seed), None

        self.guard(lambda: self._begin(t("Pasting"), read, lambda: None))

    def _open(self, path: Path, then: Callable[[], None]) -> None:
        """Reads the file in a thread; `then` is called when it is shown."""

        def read(progress: Progress) -> tuple[OpenedFile, Path | None]:
            return read_document(path, self.fov, self.seed, progress), path

        self._begin(t("Opening {name}", name=path.name), read, then)

    def _begin(
        self, title: str, read: Callable[[Progress], tuple[OpenedFile, Path | None]],
        then: Callable[[], None],
    ) -> None:  # fmt: skip
        """What is open now may be lost: that was asked. What is done to it meanwhile may not."""
        editor, given_up = self._editor, self._editor.committed

        def prepared(progress: Progress) -> tuple[OpenedFile, Path | None, Shapes]:
            opened, path = read(progress)
            return opened, path, build_ready(opened.document)

        def show(opened: OpenedFile, path: Path | None, shapes: Shapes) -> None:
            self._start(opened.document, shapes)
            editor.path = path if opened.is_session else None
            editor.source = None if opened.is_session else path
            then()

        def accept(answer: tuple[OpenedFile, Path | None, Shapes]) -> None:
            if editor.committed is given_up or editor.is_saved:
                show(*answer)
            else:
                self.guard(lambda: show(*answer))

        def fail(error: JobError) -> None:
            editor.complain_of(replace(error, trace="") if error.is_expected else error)

        editor.chores.start(
            title, prepared, kind=OPEN, done=accept, failed=fail,
        )  # fmt: skip

    def forget_recent(self, path: str) -> None:
        """A recent file that is not there any more."""
        settings = self._editor.settings
        recent = tuple(r for r in settings.recent if r != path)
        self._editor.settings = replace(settings, recent=recent)


def _listed(names: list[str]) -> str:
    """A few of them, and how many there are besides."""
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (t(" and {count} more", count=more) if more > 0 else "")
