"""What an installed depth network sees of an object: a look at it and at what is around it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from threading import Lock

import numpy as np

from .. import models
from ..arrays import F32, RGB, Mask, Pixels
from ..image import to_u8
from ..models.depth_net import DepthNet
from . import LiftError
from .depth_prior import Seen

Look = Callable[[Pixels, Mask], Seen | None]
"""Of a photo (H, W, 3), where a mask (H, W) of it is."""
MARGIN = 0.35  # x the object's longer side: what of the photo around it is looked at, too


def look(pixels: Pixels, mask: Mask) -> Seen | None:
    """What the network sees where `mask` (H, W) of the photo is; None where none is installed.

    Raises LiftError where the network cannot look at that.
    """
    there = models.added("depth")
    if there.state != "ok":
        return None
    box = box_around(mask)
    x0, y0, x1, y1 = box
    rgb = np.ascontiguousarray(to_u8(pixels[y0:y1, x0:x1]))
    try:
        return Seen(_memory.look(there, rgb), box)
    except models.ModelError as error:
        raise LiftError(f"{error}; without the depth model it can be lifted") from error


def box_around(mask: Mask) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1 px of what is looked at."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    longer = max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1
    margin, (height, width) = int(np.ceil(MARGIN * longer)), mask.shape
    return (
        max(int(columns[0]) - margin, 0), max(int(rows[0]) - margin, 0),
        min(int(columns[-1]) + 1 + margin, width), min(int(rows[-1]) + 1 + margin, height),
    )  # fmt: skip


class _Memory:
    """The network that was opened last, and the last look: another thickness looks no second time.

    What was seen is known by the digest of its pixels, so no photo is held on to.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._net: tuple[str, DepthNet] | None = None  # the file's hash
        self._last: tuple[str, bytes, F32] | None = None  # hashes of file and picture

    def look(self, there: models.Added, rgb: RGB) -> F32:
        digest = hashlib.sha256(rgb.data).digest() + bytes(str(rgb.shape), "ascii")
        with self._lock:
            if self._last is not None and self._last[:2] == (there.sha256, digest):
                return self._last[2]
            if self._net is None or self._net[0] != there.sha256:
                self._net = there.sha256, DepthNet(there.path)
            depth = self._net[1].inverse_depth(rgb)
            self._last = there.sha256, digest, depth
            return depth


_memory = _Memory()
