"""The log: what an artist would report, in a file beside the settings."""

from __future__ import annotations

import logging
from logging.handlers import RotatingFileHandler
from pathlib import Path

from .settings import settings_path

log = logging.getLogger(__name__)

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
NAME = "objectmorpher.log"
SIZE = 1_000_000  # bytes, after which a new file is begun; one old one is kept


def log_path() -> Path:
    """Where the log is."""
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
