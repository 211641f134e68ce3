"""A monocular depth network in one ONNX file, as exports of Depth Anything are.

One input, pictures (n, 3, h, w) float32, ImageNet-normalised, sides that 14 divides; one output
that is relative inverse depth, larger for what is nearer: (n, h, w), (n, 1, h, w) or (h, w).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..base.arrays import F32, RGB
from .onnx_session import open_session
from .registry import ModelError

SIDE = 518  # px, longer side of what the network sees: what Depth Anything was trained with
PATCH = 14  # px: sides are multiples of it
MEAN = np.array([0.485, 0.456, 0.406], np.float32)  # ImageNet's, of RGB in [0, 1]
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)
TRIAL = (70, 98)  # px, height and width of the made picture with which a file is tried


class DepthNet:
    """The network in a file. Costly to open."""

    def __init__(self, path: Path) -> None:
        """Raises ModelError: one sentence, where the file is no such network."""
        try:
            self._session: Any = open_session(path, is_foreign=True)
        except Exception as error:  # onnxruntime has a type of its own for everything
            raise ModelError(
                f"{path.name} is not an ONNX network, all in one file, that can be opened"
            ) from error
        self._name, self._fixed = self._checked_input(path.name)

    def _checked_input(self, name: str) -> tuple[str, tuple[int | None, int | None]]:
        """The input's name, and its height and width where the file says them."""
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        if len(inputs) != 1:
            raise ModelError(f"{name} has {len(inputs)} inputs, a depth network has one")
        if not outputs:
            raise ModelError(f"{name} has no output")
        shape, kind = list(inputs[0].shape), inputs[0].type
        if len(shape) != 4 or (shape[1] not in (3, None) and not isinstance(shape[1], str)):
            raise ModelError(f"{name} takes {shape}, a depth network takes pictures (n, 3, h, w)")
        if kind != "tensor(float)":
            raise ModelError(f"{name} takes {kind}, a depth network takes float32")
        height, width = (n if isinstance(n, int) and n > 0 else None for n in shape[2:])
        return inputs[0].name, (height, width)

    def check(self) -> None:
        """Looks at a made picture. Raises ModelError where no depth comes out."""
        height, width = TRIAL
        ramp = np.linspace(0, 255, width)[None, :, None] * np.ones((height, 1, 3))
        self.inverse_depth(ramp.astype(np.uint8))

    def inverse_depth(self, rgb: RGB) -> F32:
        """(h', w') relative inverse depth of a picture (h, w, 3), in the network's own size.

        Raises ModelError.
        """
        width, height = self.size_for(rgb.shape[1], rgb.shape[0])
        pixels = prepared(rgb, (width, height))
        try:
            found = np.asarray(self._session.run(None, {self._name: pixels})[0])
        except Exception as error:
            sentence = f"the depth network cannot look at {width} x {height} px"
            raise ModelError(sentence) from error
        if found.size == 0 or found.squeeze().ndim != 2:
            raise ModelError(f"the depth network's output is {found.shape}, not a depth per pixel")
        depth = np.ascontiguousarray(found.squeeze(), np.float32)
        if not np.isfinite(depth).all():
            raise ModelError("the depth network's output is not finite")
        return depth

    def size_for(self, width: int, height: int) -> tuple[int, int]:
        """Width and height px in which the network sees a picture of these."""
        own_width, own_height = size_in(width, height)
        return self._fixed[1] or own_width, self._fixed[0] or own_height


def size_in(width: int, height: int) -> tuple[int, int]:
    """Width and height px in which a network of any size sees a picture of these."""
    scale = SIDE / max(width, height)
    own_width, own_height = (max(PATCH, round(n * scale / PATCH) * PATCH) for n in (width, height))
    return own_width, own_height


def prepared(rgb: RGB, size: tuple[int, int]) -> F32:
    """(1, 3, h', w') what a network gets of a picture (h, w, 3); `size`: width and height px."""
    kind = cv2.INTER_AREA if size[0] < rgb.shape[1] else cv2.INTER_CUBIC
    small = cv2.resize(rgb, size, interpolation=kind)
    pixels = (small.astype(np.float32) / 255 - MEAN) / DEVIATION
    return np.ascontiguousarray(pixels.transpose(2, 0, 1)[None], np.float32)
