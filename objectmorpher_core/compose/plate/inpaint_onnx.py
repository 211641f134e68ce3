"""Fills of holes by LaMa (Suvorov et al. 2021) or MI-GAN (Sargsyan et al. 2023) in onnxruntime.

What a file takes tells which export it is:

- LaMa: `image` (1, 3, h, w) in [0, 1] and `mask` (1, 1, h, w), 1 in the hole; or both in one of
  four channels, the hole of the picture black. What comes out is in [0, 1] or in [0, 255].
- MI-GAN: image (1, 3, h, w) and mask (1, 1, h, w), 0 in the hole and 255 elsewhere, of bytes; or
  one float of four channels: what is known less a half, and the picture in [-1, 1], 0 in the hole.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ... import models
from ...base.arrays import F32, Mask, Pixels
from ...base.progress import Progress
from ...models import ModelError
from ...models.onnx_graphs import FILLERS, filler_inputs, fixed_sides, opened
from .. import InpaintError
from .hole_squares import Filler, fill_squares

SIDE = 512  # px that both were trained with, where a file does not say
BYTES = 16.0  # x the picture's brightness; what comes out brighter is in [0, 255]


class OnnxInpainter:
    """A network on the CPU; its fill depends on nothing but the photo."""

    is_random = False
    context = SIDE  # px around a hole that it looks at where the photo has them

    def __init__(self, name: str) -> None:
        self.name = name

    def missing(self) -> str | None:
        """See `Inpainter`."""
        try:
            is_here = models.place(self.name) is not None
        except ModelError as error:
            return str(error)
        how = f"`objectmorpher models get {self.name}`"
        return None if is_here else f"{FILLERS[self.name]} is not here: {how}"

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """See `Inpainter`. The seed changes nothing."""
        progress(0.0, "opening the model")
        try:
            found = [p for p in models.files(self.name) if p.suffix == ".onnx"]
            if not found:
                raise ModelError(self.missing() or f"{self.name} vanished")
            network = OnnxNetwork(found[0], self.name)
            return fill_squares(rgb, hole, Filler(network.side, network.fill), progress)
        except ModelError as error:
            raise InpaintError(models.unusable(self.name, error)) from error


class OnnxNetwork:
    """The network in a file. Costly to open."""

    def __init__(self, path: Path, family: str) -> None:
        """Raises ModelError: one sentence."""
        self._session: Any = opened(path)
        self._family = family
        self._name = path.name
        self._inputs = filler_inputs(self._session, path.name, family)
        fixed = fixed_sides(self._inputs)
        self.side = fixed[0] if fixed else SIDE

    def fill(self, picture: F32, hole: Mask, progress: Progress, seed: int) -> F32:
        """See `hole_squares.Fill`. Raises ModelError."""
        progress(0.0, "inventing what is behind")
        known = (~hole).astype(np.float32)[None, None]
        image = np.ascontiguousarray(picture.transpose(2, 0, 1)[None])
        try:
            answer = np.asarray(self._session.run(None, self._given(image, known))[0])
        except Exception as error:
            raise ModelError(f"{self._name} cannot look at {self.side} px") from error
        if answer.shape != image.shape or not np.isfinite(answer).all():
            raise ModelError(f"{self._name} gives {answer.shape}, not a picture of its size")
        return np.clip(self._unit(answer, image * known)[0].transpose(1, 2, 0), 0, 1)

    def _given(self, image: F32, known: F32) -> dict[str, np.ndarray]:
        """What the network is shown."""
        if 4 in self._inputs:
            if self._family == "migan":
                both = np.concatenate([known - 0.5, (image * 2 - 1) * known], 1)
            else:
                both = np.concatenate([image * known, 1 - known], 1)
            return {self._inputs[4].name: both.astype(np.float32)}
        names = self._inputs[3].name, self._inputs[1].name
        if self._inputs[3].type == "tensor(uint8)":
            shown = np.rint(image * 255), known * 255
            return {name: a.astype(np.uint8) for name, a in zip(names, shown, strict=True)}
        return dict(zip(names, (image, 1 - known), strict=True))

    def _unit(self, answer: np.ndarray, seen: F32) -> F32:
        """The answer in [0, 1]; it comes in the range of numbers of what is `seen`."""
        if answer.dtype == np.uint8:
            return np.asarray(answer, np.float32) / np.float32(255)
        if self._family == "migan":
            return ((answer + 1) / 2).astype(np.float32)
        is_seen = seen > 0
        bright = float(np.median(answer[is_seen] / seen[is_seen])) if is_seen.any() else 255.0
        return np.asarray(answer / (255 if bright > BYTES else 1), np.float32)


def lama() -> OnnxInpainter:
    """LaMa: large holes, textures that repeat."""
    return OnnxInpainter("lama")


def migan() -> OnnxInpainter:
    """MI-GAN: a thirtieth of LaMa's time."""
    return OnnxInpainter("migan")
