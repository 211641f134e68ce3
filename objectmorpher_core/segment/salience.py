"""The network that finds what a photo shows: U^2-Net-p (Qin et al. 2020, arXiv 2005.09007).

Imports little, so that it can be opened while the rest of the program is still being imported.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import cv2
import numpy as np

from .. import models
from ..base.arrays import F32, RGB
from ..models.onnx_session import EarlyAnswers, open_session

WEIGHT = "u2netp"
INPUT_SIDE = 320  # px, as it was trained
KEPT = 8  # of the last pictures' subject maps; each takes 0.4 MB
MEAN = np.array([0.485, 0.456, 0.406], np.float32)  # ImageNet's RGB, as it was trained
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)


class SubjectNet:
    """The network, opened at its first use and once for all who use it."""

    def missing(self) -> str | None:
        """Why it cannot run, or None."""
        if models.path(WEIGHT) is None:
            return f"the model {WEIGHT} is not here: `objectmorpher models get {WEIGHT}`"
        return None

    def salience(self, rgb: RGB) -> F32:
        """(320, 320) in [0, 1] for a photo (H, W, 3)."""
        small = _reduced(rgb)
        return _early.answer(small, lambda: _seen(small), lambda: None)


def expect_salience(rgb: RGB) -> Callable[[], None]:
    """Who asks for the salience of a photo waits for what is returned, which computes it."""
    small = _reduced(rgb)
    return _early.expect(small, lambda: _seen(small))


_early = EarlyAnswers(KEPT)
_opening = Lock()


def _reduced(rgb: RGB) -> RGB:
    small = cv2.resize(rgb, (INPUT_SIDE, INPUT_SIDE), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def _seen(small: RGB) -> F32:
    with _opening:
        session = _opened()
    scaled = small.astype(np.float32) / max(int(small.max()), 1)  # as it was trained
    pixels = ((scaled - MEAN) / DEVIATION).transpose(2, 0, 1)[None]
    first = session.run([session.get_outputs()[0].name], {session.get_inputs()[0].name: pixels})
    return np.ascontiguousarray(first[0][0, 0], np.float32)


@cache
def _opened() -> Any:
    path = models.path(WEIGHT)
    if path is None:
        raise models.ModelError(f"the model {WEIGHT} is not here: `objectmorpher models get`")
    return open_session(path)
