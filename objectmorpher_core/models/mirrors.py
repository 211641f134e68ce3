"""Where else a weight can be had: folders on the web that hold the files by their names.

A mirror is asked before the Python package that carries a weight. What it answers is believed only
where it has the size and the hash of the registry, so that a mirror needs no trust.
"""

from __future__ import annotations

import logging
import os
from pathlib import Path

from ..base.progress import Progress
from .registry import ModelError, Weight, mirrors

VARIABLE = "OBJECTMORPHER_MIRROR"  # environment variable: a mirror that is asked first
WAIT = 20.0  # s for an answer, and between two blocks
BLOCK = 1 << 18  # bytes read at a time
SCHEMES = ("https://", "http://")

log = logging.getLogger(__name__)


def addresses() -> tuple[str, ...]:
    """The mirrors in the order in which they are asked. Raises ModelError for what is none."""
    own = os.environ.get(VARIABLE, "")
    if own and not own.startswith(SCHEMES):
        raise ModelError(f"{VARIABLE} is {own!r}, which is no address of the web")
    return tuple(address.rstrip("/") for address in (own, *mirrors()) if address)


def fetch_mirrored(wanted: Weight, target: Path, progress: Progress) -> bool:
    """Whether a mirror had the file, which is `target` then, of the right size.

    Its hash is for the caller to check. Raises OSError where the disk is full. `Cancelled` passes.
    """
    from http.client import HTTPException
    from urllib.error import URLError

    for address in addresses():
        try:
            if _copy(f"{address}/{wanted.file}", wanted, target, progress):
                return True
            reason = "it has another size"
        except (URLError, HTTPException, TimeoutError) as error:
            reason = str(error)
        log.info("%s does not come from %s: %s", wanted.id, address, reason)
    return False


def _copy(address: str, wanted: Weight, target: Path, progress: Progress) -> bool:
    """Write what `address` answers to `target`; no more of it than the weight has."""
    count = 0
    from urllib.request import urlopen

    with urlopen(address, timeout=WAIT) as answer, target.open("wb") as file:
        while count <= wanted.size and (block := answer.read(BLOCK)):
            file.write(block)
            count += len(block)
            note = f"downloading {wanted.id}: {count >> 20} of {wanted.size >> 20} MB"
            progress(min(count / wanted.size, 1.0), note)
    return count == wanted.size
