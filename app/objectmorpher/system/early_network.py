"""Opens DINOv2 while the rest of the program is still being imported.

Both take a second on one core, and reading a network leaves the interpreter to others: together
they take hardly more than one of them.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from threading import Thread

log = logging.getLogger(__name__)

LAST_IMPORTED = "objectmorpher_core.pipeline"  # when it is there nothing is left to be imported


def open_early(photo: Path | None, segmenter: str | None) -> Thread | None:
    """The thread that opens it for `segmenter` of a `photo`; None where that would gain nothing.

    Without the weights, or the photo, there is nothing to wait for at the end of the program.
    """
    wants_it = segmenter in (None, "auto", "dino")
    if LAST_IMPORTED in sys.modules or not wants_it or photo is None or not photo.is_file():
        return None
    # Imported before the thread begins: two threads never import modules of ours at a time.
    from objectmorpher_core import models
    from objectmorpher_core.segment import dino_tokens

    if models.path(dino_tokens.WEIGHT) is None:
        return None
    opening = Thread(target=_open, name="network")  # not a daemon: it ends before the interpreter
    opening.start()
    return opening


def _open() -> None:
    from objectmorpher_core.segment import dino_tokens

    try:
        dino_tokens.shared()
    except Exception as error:  # whoever needs the network opens it again, and tells
        log.debug("DINOv2 was not opened early: %s", error)
