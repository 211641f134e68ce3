"""Keeps what is not saved on the disk, so that a crash costs seconds of work and no more.

Each tab of a running editor has a folder of its own in the user's data folder, as long as it holds
something unsaved, and a lock on it. A folder whose lock nobody holds was left by an editor
that crashed; `recovery.py` offers it. A thread writes; the main thread compares two references.
"""

from __future__ import annotations

import logging
import os
import queue
import shutil
import sys
import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import IO, TYPE_CHECKING

import platformdirs

from objectmorpher_core.document.model import Document
from objectmorpher_core.session.journal import DOCUMENT, Journal
from objectmorpher_core.session.tree import SessionError

from ..system.texts import t

if TYPE_CHECKING:
    from .state import Tab


class FileLock:
    """A lock on a file, from `take` to `release`, or until its process ends, however it does."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    @classmethod
    def take(cls, path: Path) -> FileLock | None:
        """The lock, or None where another process or editor holds it. Raises OSError."""
        file = path.open("ab")
        try:
            _lock(file)
        except OSError:
            file.close()
            return None
        file.truncate(0)
        file.write(f"{os.getpid()}\n".encode())  # for people who look into the folder
        file.flush()
        return cls(file)

    def release(self) -> None:
        self._file.close()


if sys.platform == "win32":
    import msvcrt

    FAR = 1 << 30  # a byte beyond the file's end, so that others can still read what it holds

    def _lock(file: IO[bytes]) -> None:
        file.seek(FAR)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        file.seek(0)

else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


log = logging.getLogger(__name__)

INTERVAL = 3.0  # s between two writes while the user keeps working
FAREWELL = 30.0  # s that closing waits for the last write
LOCK = "lock"


def recovery_root() -> Path:
    """Return the folder of the journals; OBJECTMORPHER_DATA overrides the user's data folder."""
    named = os.environ.get("OBJECTMORPHER_DATA")
    base = Path(named) if named else platformdirs.user_data_path("objectmorpher", appauthor=False)
    return base / "recovery"


@dataclass(frozen=True)
class About:
    """A journal's summary of its document."""

    name: str  # of the session, or of the photo where it was never saved
    edited: str  # local time, ISO 8601
    objects: int
    path: str | None  # of the session, where it was saved once
    source: str | None  # of the photo's file


@dataclass(frozen=True, eq=False)
class HeldJournal:
    """A journal's folder and its lock."""

    journal: Journal
    lock: FileLock

    def remove(self) -> None:
        """Its document goes first: without one a folder is nothing to recover."""
        (self.journal.folder / DOCUMENT).unlink(missing_ok=True)
        self.lock.release()
        shutil.rmtree(self.journal.folder, ignore_errors=True)


class Autosave:
    """Looks each frame whether there is something new, and has it written."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        self._asked: Document | None = None  # last one given to the thread
        self._asked_at = -INTERVAL  # s, monotonic
        self._is_kept = False  # the folder holds something, or soon will
        self._held: HeldJournal | None = None  # the thread's own
        self._orders: queue.SimpleQueue[tuple[Document, About] | HeldJournal | str | None]
        self._orders = queue.SimpleQueue()
        self._problem: str | None = None  # why the last write failed
        self._is_told = False
        self._given = self._done = 0  # orders; the one counted here, the other in the thread
        self._thread: threading.Thread | None = None

    def poll(self, complain: Callable[[str], None] = lambda sentence: None) -> bool:
        """Once a frame, on the main thread. Whether anything changed: a complaint, at most."""
        document = self._tab.document
        if self._problem is not None:
            self._tell(self._problem, complain)
        if document is None or self._tab.is_saved:
            if self._is_kept:
                self._asked, self._is_kept = None, False
                self._order(None)
            return False
        now = time.monotonic()
        is_early = now - self._asked_at < INTERVAL
        if document is self._asked or self._given > self._done or is_early:
            return False
        self._asked, self._asked_at, self._is_kept = document, now, True
        self._order((document, self._about(document)))
        return False

    @property
    def is_up_to_date(self) -> bool:
        """Whether the disk holds what is unsaved, and nothing else of this tab."""
        is_asked = not self._is_kept if self._tab.is_saved else self._asked is self._tab.document
        return is_asked and self._given == self._done

    def adopt(self, held: HeldJournal) -> None:
        """Goes on in the folder of an editor that crashed, whose document is open now."""
        self._is_kept = True
        self._order(held)

    def end(self) -> None:
        """The tab is closed, or the editor ends.

        What is unsaved even now, after an error, stays to be recovered.
        """
        document = self._tab.document
        if document is not None and not self._tab.is_saved and document is not self._asked:
            self._order((document, self._about(document)))
        elif document is None or self._tab.is_saved:
            self._order(None)
        self._orders.put("end")

    def join(self) -> None:
        """Wait until it has ended."""
        if self._thread is not None:
            self._thread.join(FAREWELL)

    def _about(self, document: Document) -> About:
        path, source = self._tab.path, self._tab.source
        return About(
            self._tab.name, datetime.now().isoformat(timespec="seconds"),
            sum(thing.mask is not None for thing in document.objects),
            str(path) if path else None, str(source) if source else None,
        )  # fmt: skip

    def _tell(self, problem: str, complain: Callable[[str], None]) -> None:
        """Once: the work goes on, and so does trying."""
        self._problem, self._asked = None, None
        if not self._is_told:
            self._is_told = True
            complain(t("Unsaved work cannot be kept safe: {reason}", reason=problem))

    # In the thread

    def _order(self, order: tuple[Document, About] | HeldJournal | None) -> None:
        self._given += 1
        self._orders.put(order)
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, daemon=True, name="autosave")
            self._thread.start()

    def _work(self) -> None:
        while (order := self._orders.get()) != "end":
            try:
                self._carry_out(order)
            except (OSError, SessionError) as error:
                log.warning("Unsaved work cannot be kept safe: %s", error)
                self._problem = getattr(error, "strerror", None) or str(error)
            except Exception as error:  # our mistake: the editor must outlive it
                log.exception("Unsaved work cannot be kept safe")
                self._problem = str(error) or type(error).__name__
            finally:
                self._done += 1
        if self._held is not None:
            self._held.lock.release()

    def _carry_out(self, order: tuple[Document, About] | HeldJournal | str | None) -> None:
        if isinstance(order, tuple):
            started = time.monotonic()
            self._held = self._held or _new_folder()
            self._held.journal.write(order[0], asdict(order[1]))
            log.debug("Kept safe in %.2f s", time.monotonic() - started)
        else:
            if self._held is not None:
                self._held.remove()
            self._held = order if isinstance(order, HeldJournal) else None


def _new_folder() -> HeldJournal:
    folder = recovery_root() / uuid.uuid4().hex
    folder.mkdir(parents=True)
    lock = FileLock.take(folder / LOCK)
    if lock is None:
        raise OSError(f"{folder} is locked")
    return HeldJournal(Journal(folder), lock)
