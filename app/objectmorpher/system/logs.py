"""The log: what an artist would report, in a file beside the settings."""

from __future__ import annotations

import faulthandler
import logging
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import IO, Any

from ..editor.settings import settings_path

log = logging.getLogger(__name__)

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
NAME = "objectmorpher.log"
CRASHES = "objectmorpher-crashes.log"
SIZE = 1_000_000  # bytes, after which a new file is begun; one old one is kept


def log_path() -> Path:
    return settings_path().parent / NAME


def start_log(folder: Path) -> None:
    """Everything into `folder`/objectmorpher.log, warnings to the terminal too."""
    terminal = logging.StreamHandler()
    terminal.setLevel(logging.WARNING)
    logging.basicConfig(format=FORMAT, level=logging.INFO, handlers=[terminal])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = RotatingFileHandler(folder / NAME, maxBytes=SIZE, backupCount=1)
    except OSError as error:
        log.warning("There is no log file: %s", error)
        return
    file.setFormatter(logging.Formatter(FORMAT))
    logging.getLogger().addHandler(file)
    note_crashes(folder)


def start_command_log(folder: Path) -> None:
    """Libraries' warnings and faults of ours into the same file: the terminal has our own words.

    The file is made when something is written; where it cannot be, nobody is bothered.
    """
    handler = _QuietFile(folder / NAME, maxBytes=SIZE, backupCount=1, delay=True)
    handler.setFormatter(logging.Formatter(FORMAT))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.captureWarnings(True)


def show_log() -> None:
    """Everything goes to the terminal too, as a server's log should."""
    terminal = logging.StreamHandler()
    terminal.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
    logging.getLogger().addHandler(terminal)
    logging.getLogger().setLevel(logging.INFO)


class _QuietFile(RotatingFileHandler):
    """A log file whose folder is made with it."""

    def _open(self) -> Any:
        Path(self.baseFilename).parent.mkdir(parents=True, exist_ok=True)
        return super()._open()

    def handleError(self, record: logging.LogRecord) -> None:
        """A full disk, or a folder that is read-only."""


def note_crashes(folder: Path) -> None:
    """Note what the threads did when native code ends this process by a fault.

    In a file of its own: it stays open, and the log's is replaced when it is full. What an
    environment with PYTHONFAULTHANDLER asked for already is left as it is.
    """
    if faulthandler.is_enabled():
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / CRASHES
        is_full = path.exists() and path.stat().st_size > SIZE
        file = path.open("w" if is_full else "a", encoding="utf-8")
    except OSError as error:
        log.warning("Crashes are not noted: %s", error)
        return
    _noted[folder] = file
    faulthandler.enable(file)


def crash_folder() -> Path | None:
    """Return the folder of this process's crash notes, for its children; None if there is none."""
    return next(iter(_noted), None)


_noted: dict[Path, IO[str]] = {}  # open as long as the process: faulthandler has but its number
