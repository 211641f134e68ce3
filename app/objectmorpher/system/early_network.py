"""Opens DINOv2, and has it look at the photo, while the rest of the program is being imported.

Importing takes two seconds of one core; networks leave the interpreter to others and use all that
is left: together they take hardly more than one of them.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from threading import Thread

log = logging.getLogger(__name__)

LAST_IMPORTED = "objectmorpher_core.pipeline"  # when it is there nothing is left to be imported

BETTER = ("sam2", "sam3", "sam", "sam-onnx")  # which "auto" may take in its place


def open_early(photo: Path | None, segmenter: str | None, is_seen: bool = False) -> Thread | None:
    """The thread that opens it for `segmenter` of a `photo`; None where that would gain nothing.

    `is_seen`: the photo will be encoded, and may be at once. Without the weights, or the photo,
    there is nothing to wait for at the end of the program.
    """
    wants_it = segmenter in (None, "auto", "dino")
    if LAST_IMPORTED in sys.modules or not wants_it or photo is None or not photo.is_file():
        return None
    # Imported before the thread begins: two threads never import modules of ours at a time.
    from objectmorpher_core import models
    from objectmorpher_core.pictures import image  # noqa: F401
    from objectmorpher_core.segment import dino_tokens, salience  # noqa: F401

    if models.path(dino_tokens.WEIGHT) is None:
        return None
    others = segmenter != "dino" and any(map(models.installed, BETTER))
    seen = photo if is_seen and not others else None
    # not a daemon: it ends before the interpreter
    opening = Thread(target=_open, args=(seen,), name="network")
    opening.start()
    return opening


def _open(photo: Path | None) -> None:
    from objectmorpher_core.pictures.image import read_picture, to_u8
    from objectmorpher_core.segment import dino_tokens, salience

    try:
        if photo is None:
            dino_tokens.shared()
            return
        rgb = to_u8(read_picture(photo.read_bytes()).pixels)
        begun = dino_tokens.expect_tokens(rgb), salience.expect_salience(rgb)
        for compute in begun:
            compute()
    except Exception as error:  # whoever needs the network opens it again, and tells
        log.debug("DINOv2 did not begin early: %s", error)
