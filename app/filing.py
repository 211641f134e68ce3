"""Opening, saving and exporting, and the one question: what about unsaved changes?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.document import Document

if TYPE_CHECKING:
    from .editor import Editor

SESSION_ENDING = ".omorph"
PHOTO_ENDINGS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp")
EXPORT_ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
ZIP_MAGIC = b"PK\x03\x04"


class Dialog(Enum):
    """The file dialogs."""

    OPEN = "Open"
    SAVE = "Save session"
    EXPORT = "Export photo"
    MASK_OPEN = "Import mask"
    MASK_SAVE = "Export mask"

    @property
    def is_opening(self) -> bool:
        """Whether it asks for a file that is there."""
        return self in (Dialog.OPEN, Dialog.MASK_OPEN)


class Filing:
    """Which file is which, and what waits for an answer about them."""

    def __init__(self, editor: Editor, fov: float | None = None, seed: int = 0) -> None:
        """`fov` (degrees) and `seed` are for photos that are opened."""
        self._editor = editor
        self._fov, self._seed = fov, seed
        self.wanted: Dialog | None = None  # the window shows it
        self.question: Callable[[], None] | None = None  # goes on when the changes may be lost
        self._after_save: Callable[[], None] | None = None

    def open(self, path: Path) -> None:
        """Opens a photo or a session, after the question about unsaved changes."""
        self.guard(lambda: self._open(path))

    def open_sample(self, path: Path) -> None:
        """Opens a photo that came with the program: it is nobody's file to go back to."""

        def go_on() -> None:
            settings = self._editor.settings
            self._open(path)
            self._editor.source = None
            self._editor.settings = settings

        self.guard(go_on)

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
        elif dialog is Dialog.MASK_OPEN:
            self._editor.masking.open_file(path)
        elif dialog is Dialog.MASK_SAVE:
            self._editor.masking.write_file(path if path.suffix else path.with_suffix(".png"))
        else:
            self.export(path if path.suffix else path.with_suffix(".png"))

    def cancel_dialog(self) -> None:
        """The user closed a dialog without choosing."""
        self.wanted = self._after_save = None

    def save(self) -> None:
        """Into the session's own file; asks for one where there is none yet."""
        if self._editor.path is None:
            self.wanted = Dialog.SAVE
        else:
            self.save_as(self._editor.path)

    def save_as(self, path: Path) -> None:
        if path.suffix.lower() != SESSION_ENDING:
            self._editor.complain(f"a session's name ends in {SESSION_ENDING}, not {path.suffix}")
            return
        then, self._after_save = self._after_save, None
        self._editor.tasks.save(path, then)

    def export(self, path: Path) -> None:
        if path.suffix.lower() not in EXPORT_ENDINGS:
            known = ", ".join(e[1:].upper() for e in (".png", ".jpg", ".tif", ".webp"))
            self._editor.complain(f"a photo cannot be written as {path.suffix}; choose {known}")
            return
        self._editor.tasks.export(path)

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
        return folder / f"{stem}-edited.png"

    def _open(self, path: Path) -> None:
        editor = self._editor
        try:
            data = path.read_bytes()
        except OSError as error:
            editor.complain(f"{path.name} cannot be opened: {error.strerror or error}")
            return
        is_session = data[:4] == ZIP_MAGIC
        try:
            document = self._decode(data, path.name, is_session)
        except (ValueError, OSError, MemoryError) as error:
            editor.complain(f"{path.name} cannot be opened: {error}")
            return
        editor.start(document)
        editor.path = path if is_session else None
        editor.source = None if is_session else path
        editor.settings = editor.settings.with_recent(path)

    def _decode(self, data: bytes, name: str, is_session: bool) -> Document:
        if is_session:
            from objectmorpher_core.session_file import decode_session

            return decode_session(data)
        from objectmorpher_core.pipeline import open_photo

        return open_photo(data, name, fov=self._fov, seed=self._seed)

    def forget_recent(self, path: str) -> None:
        """A recent file that is not there any more."""
        settings = self._editor.settings
        recent = tuple(r for r in settings.recent if r != path)
        self._editor.settings = replace(settings, recent=recent)
