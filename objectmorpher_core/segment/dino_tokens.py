"""DINOv2's patch tokens of a picture: selection walks over them, the shape network reads them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import cv2
import numpy as np

from .. import models
from ..base.arrays import F32, RGB
from ..base.progress import Progress, silent
from ..models.onnx_session import EarlyAnswers, open_session, run_session
from .salience import DEVIATION, MEAN

WEIGHT = "dinov2-vits14"
IMAGES = "input_image"
TOKENS = "/backbone/layernorm/Add_1_output_0"  # (1, 1 + patches, 384), the class token first
# A layer about half way still shows where surfaces face (R^2 of normals by ridge regression from
# one layer: 2 0.31, 5 0.44, 8 0.46, 10 0.40, the last 0.37); the last shows what things are.
INNER = tuple(f"/backbone/encoder/layer.{k}/Add_1_output_0" for k in (5, 8))
PATCH = 14  # px
PATCHES = 1850  # of a photo: about 700 x 520 px, any aspect
USUAL_TIME = 4.0  # s of a run on two cores
KEPT = 4  # of the last photos' tokens; each takes 3 MB
SMALLEST_PATCH = 4  # px of the photo; finer ones would only see the enlargement's blur


class TokenNet:
    """DINOv2 ViT-S/14 (Oquab et al., arXiv 2304.07193), opened so that it takes any size."""

    def __init__(self, threads: int = 0) -> None:
        """`threads` of one run; 0: one a core. Raises ModelError without the weights."""
        from ..models.onnx_session import with_interface

        path = models.path(WEIGHT)
        if path is None:
            raise models.ModelError(f"the model {WEIGHT} is not here: `objectmorpher models get`")
        graph = with_interface(path.read_bytes(), IMAGES, TOKENS, *INNER)
        self._session: Any = open_session(graph, threads)

    def tokens(self, rgb: RGB, progress: Progress = silent) -> F32:
        """(h, w, 384) of a picture of h x w patches. What `progress` raises ends it soon."""
        return self._run(rgb, progress, TOKENS)[0]

    def inner_tokens(self, rgb: RGB) -> F32:
        """(h, w, 768) of two inner layers, each token of mean 0 and deviation 1."""
        layers = self._run(rgb, silent, *INNER)
        centred = [layer - layer.mean(-1, keepdims=True) for layer in layers]
        return np.concatenate([c / (c.std(-1, keepdims=True) + 1e-6) for c in centred], -1)

    def _run(self, rgb: RGB, progress: Progress, *outputs: str) -> list[F32]:
        height, width = (n // PATCH for n in rgb.shape[:2])
        pixels = ((rgb.astype(np.float32) / 255 - MEAN) / DEVIATION).transpose(2, 0, 1)[None]
        inputs = {IMAGES: pixels}
        found = run_session(self._session, list(outputs), inputs, _watching(progress))
        return [np.asarray(f[0, 1:].reshape(height, width, -1), np.float32) for f in found]


def _watching(progress: Progress) -> Callable[[], None]:
    """To be called again and again while the network runs: it goes on, ever slower."""
    began = time.monotonic()
    return lambda: progress(
        1 - math.exp((began - time.monotonic()) / USUAL_TIME), "recognising its parts"
    )


def photo_tokens(rgb: RGB, patches: int, progress: Progress = silent) -> F32:
    """(h, w, 384) of about so many patches of a photo (H, W, 3)."""
    small = _reduced(rgb, patches)
    compute = lambda: shared().tokens(small, progress)  # noqa: E731
    return _early.answer(small, compute, _watching(progress))


def expect_tokens(rgb: RGB) -> Callable[[], None]:
    """Who asks for the tokens of a whole photo waits for what is returned, which computes them."""
    small = _reduced(rgb, PATCHES)
    return _early.expect(small, lambda: shared().tokens(small))


def _reduced(rgb: RGB, patches: int) -> RGB:
    """The photo at the size at which it has so many patches."""
    height, width = rgb.shape[:2]
    scale = min((patches / (height * width)) ** 0.5, 1 / SMALLEST_PATCH)
    h, w = max(1, round(height * scale)), max(1, round(width * scale))
    how = cv2.INTER_AREA if h * PATCH < height else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(rgb, (w * PATCH, h * PATCH), interpolation=how), np.uint8)


_early = EarlyAnswers(KEPT)
_opening = Lock()


def shared() -> TokenNet:
    """The network, opened once for selecting and lifting; raises ModelError without weights."""
    with _opening:
        return _opened()


@cache
def _opened() -> TokenNet:
    return TokenNet()
