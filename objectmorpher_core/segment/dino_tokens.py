"""DINOv2's patch tokens of a picture: selection walks over them, the shape network reads them."""

from __future__ import annotations

from functools import cache
from threading import Lock
from typing import Any

import numpy as np

from .. import models
from ..arrays import F32, RGB
from .subject import DEVIATION, MEAN

WEIGHT = "dinov2-vits14"
IMAGES = "input_image"
TOKENS = "/backbone/layernorm/Add_1_output_0"  # (1, 1 + patches, 384), the class token first
PATCH = 14  # px


class TokenNet:
    """DINOv2 ViT-S/14 (Oquab et al., arXiv 2304.07193), opened so that it takes any size."""

    def __init__(self, threads: int = 0) -> None:
        """`threads` of one run; 0: one a core. Raises ModelError without the weights."""
        import onnxruntime

        from ..models.onnx_graph import with_interface

        path = models.path(WEIGHT)
        if path is None:
            raise models.ModelError(f"the model {WEIGHT} is not here: `objectmorpher models get`")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        graph = with_interface(path.read_bytes(), IMAGES, TOKENS)
        self._session: Any = onnxruntime.InferenceSession(
            graph, options, providers=["CPUExecutionProvider"]
        )

    def tokens(self, rgb: RGB) -> F32:
        """(h, w, 384) of a picture of h x w patches."""
        height, width = (n // PATCH for n in rgb.shape[:2])
        pixels = ((rgb.astype(np.float32) / 255 - MEAN) / DEVIATION).transpose(2, 0, 1)[None]
        found = self._session.run([TOKENS], {IMAGES: pixels})[0][0, 1:]
        return np.asarray(found.reshape(height, width, -1), np.float32)


_opening = Lock()


def shared() -> TokenNet:
    """The network, opened once for selecting and lifting; raises ModelError without weights."""
    with _opening:
        return _opened()


@cache
def _opened() -> TokenNet:
    return TokenNet()
