"""DINOv2's patch tokens of a crop, as the shape network takes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import models
from ..arrays import F32, RGB
from ..segment.dino_walk import IMAGES, PATCH, TOKENS, WEIGHT
from ..segment.subject import DEVIATION, MEAN


class TokenNet:
    """DINOv2 ViT-S/14 (Oquab et al., arXiv 2304.07193), opened once."""

    def __init__(self, threads: int = 0) -> None:
        """`threads` of one run; 0: as many as there are cores."""
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
        """(384, g, g) for a crop (s, s, 3) whose side is g patches long."""
        grid = rgb.shape[0] // PATCH
        pixels = ((rgb.astype(np.float32) / 255 - MEAN) / DEVIATION).transpose(2, 0, 1)[None]
        found = self._session.run([TOKENS], {IMAGES: pixels.astype(np.float32)})[0][0, 1:]
        return np.ascontiguousarray(found.reshape(grid, grid, -1).transpose(2, 0, 1))
