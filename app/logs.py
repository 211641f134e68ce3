"""The log: what an artist would report, in a file beside the settings."""

from __future__ import annotations

import logging
from logging.handlers import RotatingFileHandler
from pathlib import Path

NAME = "objectmorpher.log"
SIZE = 1_000_000  # bytes, after which a new file is begun; one old one is kept


def start_log(folder: Path) -> None:
    """Everything into `folder`/objectmorpher.log, warnings to the terminal too."""
    terminal = logging.StreamHandler()
    terminal.setLevel(logging.WARNING)
    handlers: list[logging.Handler] = [terminal]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handlers.append(RotatingFileHandler(folder / NAME, maxBytes=SIZE, backupCount=1))
    except OSError as error:
        terminal.handle(logging.makeLogRecord({"msg": f"There is no log: {error}"}))
    logging.basicConfig(
        format="%(asctime)s %(levelname)s %(name)s: %(message)s", level=logging.INFO,
        handlers=handlers, force=True,
    )  # fmt: skip
