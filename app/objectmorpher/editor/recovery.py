"""Sessions left by editors that crashed: the list, and opening or discarding its entries."""

from __future__ import annotations

import logging
import shutil
import time
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Document
from objectmorpher_core.session.journal import DOCUMENT, Journal, read_about, read_journal
from objectmorpher_core.session.tree import SessionError

from ..canvas.shape import Shapes, build_ready
from ..system.texts import t
from ..worker.requests import JobError
from .autosave import LOCK, FileLock, HeldJournal, recovery_root
from .view import Action, StatusMessage

if TYPE_CHECKING:
    from .state import EditorState
    from .tabs import Tabs

log = logging.getLogger(__name__)

STALE = 24 * 3600  # s; a folder without a document that is older holds nothing and never will
RECOVER = "recover"  # kind of chores


@dataclass(frozen=True)
class Left:
    """Unsaved work of an editor that crashed."""

    folder: Path
    name: str = ""  # as its tab's
    edited: datetime | None = None
    objects: int = 0
    path: Path | None = None  # of the session
    source: Path | None = None  # of the photo's file
    problem: str = ""  # why it cannot be recovered, one sentence


class Recovery:
    """The sessions that can be recovered."""

    def __init__(self, editor: EditorState, tabs: Tabs) -> None:
        self._editor, self._tabs = editor, tabs
        self.left: tuple[Left, ...] = ()  # newest first
        self.doubted: Left | None = None  # asked whether it may be discarded
        self._is_unseen = False
        self._offer: StatusMessage | None = None

    def look(self, is_shown: bool = True) -> None:
        """Reads the list anew; cheap, the documents are not read.

        `is_shown`: the start screen shows it. Otherwise it is offered when a file has opened.
        """
        self._is_unseen = not is_shown
        found = []
        root = recovery_root()
        for folder in sorted(root.iterdir()) if root.is_dir() else ():
            try:
                left = _left_in(folder)
            except OSError as error:
                log.warning("%s cannot be looked into: %s", folder, error)
                continue
            found += [left] if left is not None else []
        found.sort(key=lambda left: left.edited or datetime.min, reverse=True)
        self.left = tuple(found)

    def offer(self) -> None:
        """Says what was left, once, where the start screen never came up."""
        editor = self._editor
        if not self._is_unseen or not self.left:
            return
        self._is_unseen, newest = False, self.left[0]
        if len(self.left) == 1 and not newest.problem:
            text = t("{name} has unsaved work from {time}", name=newest.name,
                     time=when(newest.edited))  # fmt: skip
            editor.say(text, Action(t("Recover"), lambda: self.recover(newest)))
        else:
            text = t("Unsaved work of {count} earlier sessions is still here",
                     count=len(self.left))  # fmt: skip
            editor.say(text, Action(t("Show"), self._tabs.add))
        self._offer = editor.message

    def recover_left(self) -> None:
        """Recovers what was left; where there is more of it, the start screen lists it."""
        if len(self.left) == 1 and not self.left[0].problem:
            self.recover(self.left[0])
        elif self._editor.document is not None:
            self._tabs.add()
        else:
            self._editor.say(t("Choose in the list what to recover"))

    def put_off(self) -> None:
        """The tab is left: what is still offered there is offered again when a file has opened."""
        if self._offer is not None and self._editor.message is self._offer:
            self._is_unseen = True

    def ask_to_discard(self, left: Left) -> None:
        """The first time it is only asked whether that is meant: nothing brings it back."""
        if self.doubted is left:
            self.discard(left)
        else:
            self.doubted = left

    def discard(self, left: Left) -> None:
        """Deletes it for good."""
        self._forget(left)
        lock = FileLock.take(left.folder / LOCK) if left.folder.is_dir() else None
        if lock is not None:
            HeldJournal(Journal(left.folder), lock).remove()

    def recover(self, left: Left) -> None:
        """Opens it, unsaved as it was; its folder is its tab's from then on."""
        editor = self._editor
        lock = FileLock.take(left.folder / LOCK) if left.folder.is_dir() else None
        if lock is None:
            self._forget(left)
            editor.complain(t("{name} was recovered elsewhere already", name=left.name))
            return

        def read(progress: Progress) -> tuple[Document, Shapes]:
            progress(0.2, "")
            document = read_journal(left.folder)
            return document, build_ready(document)

        def accept(answer: tuple[Document, Shapes]) -> None:
            document, shapes = answer
            self._forget(left)
            self._tabs.open(document, shapes)
            editor.tab.path, editor.tab.source = left.path, left.source
            assert editor.history is not None
            editor.history.mark_unsaved()
            editor.autosave.adopt(HeldJournal(Journal(left.folder), lock))
            editor.say(t("Recovered {name} as it was at {time}", name=left.name,
                         time=when(left.edited)))  # fmt: skip
            self._is_unseen = bool(self.left)  # the start screen is gone, which listed the others
            self.offer()

        def fail(error: JobError) -> None:
            lock.release()
            sentence = t("{name} cannot be recovered: {reason}", name=left.name,
                         reason=error.sentence)  # fmt: skip
            broken = Left(left.folder, left.name, left.edited, left.objects, problem=sentence)
            self.left = tuple(broken if other is left else other for other in self.left)
            editor.complain(sentence, error.trace)

        editor.chores.start(
            t("Recovering {name}", name=left.name), read, kind=RECOVER,
            done=accept, failed=fail, cancelled=lock.release,
        )  # fmt: skip

    def _forget(self, left: Left) -> None:
        self.left = tuple(other for other in self.left if other.folder != left.folder)


def _left_in(folder: Path) -> Left | None:
    """What a crashed editor left in its folder; None where there is nothing, or one runs."""
    is_stale = time.time() - folder.stat().st_mtime > STALE  # also where the clock was put forward
    lock = FileLock.take(folder / LOCK)
    if lock is None:
        return None
    lock.release()
    if not (folder / DOCUMENT).exists():
        if is_stale:
            shutil.rmtree(folder, ignore_errors=True)
        return None
    try:
        about = read_about(folder)
        path, source = about.get("path"), about.get("source")
        return Left(
            folder, str(about["name"]), _local(datetime.fromisoformat(about["edited"])),
            int(about["objects"]), Path(path) if path else None, Path(source) if source else None,
        )  # fmt: skip
    except (SessionError, KeyError, TypeError, ValueError) as error:
        log.warning("%s cannot be recovered: %s", folder, error)
        return Left(folder, problem=t("It is damaged and cannot be recovered"))


def _local(time: datetime) -> datetime:
    """The same time without a zone: times of this machine are compared."""
    return time if time.tzinfo is None else time.astimezone().replace(tzinfo=None)


def when(edited: datetime | None) -> str:
    """The time of today, or day and time of earlier."""
    if edited is None:
        return ""
    if abs(datetime.now() - edited) < timedelta(hours=18):  # a clock may have jumped back
        return f"{edited:%H:%M}"
    return f"{edited:%d %b %Y, %H:%M}"
