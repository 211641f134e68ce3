"""The common part of every SAM: a picture encoded once, and masks decoded for each prompt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...base.arrays import F32, F64, RGB, Mask

OBJECT, GROUND, CORNER, OTHER_CORNER, NOTHING = 1, 0, 2, 3, -1  # labels of SAM's points
MEAN = np.array([0.485, 0.456, 0.406], np.float32)  # ImageNet's, of RGB in [0, 1]
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)


@dataclass(frozen=True, eq=False)
class Asked:
    """A prompt in px of the network's square; a pixel's centre is at its number + 0.5."""

    points: F64  # (n, 2)
    is_object: Mask  # (n,) else it is what is not the object
    box: F64 | None = None  # (4,) x0, y0, x1, y1
    logits: F32 | None = None  # (low, low) the answer before this, to be told better


@dataclass(frozen=True, eq=False)
class Masks:
    """The candidates for a prompt."""

    logits: F32  # (k, low, low), positive inside
    scores: F32  # (k,) overlap (IoU) with the right mask that the network expects


class SamNetwork(Protocol):
    """A model. Opening it is costly, so that happens at the first picture."""

    side: int  # px of the square that it sees
    low: int  # px of the square of logits
    is_padded: bool

    def encode(self, picture: RGB) -> tuple[F32, ...]:
        """Features of a picture (h, w, 3), at most `side` px each way. Raises ModelError."""
        ...

    def decode(self, features: tuple[F32, ...], asked: Asked, is_several: bool) -> Masks:
        """Three masks, or the one where the prompt leaves no choice. Raises ModelError."""
        ...


def normalized(picture: RGB, side: int, mean: F32 = MEAN, deviation: F32 = DEVIATION) -> F32:
    """(1, 3, side, side) of a picture (h, w, 3); what it leaves empty is 0."""
    pixels = np.zeros((1, 3, side, side), np.float32)
    height, width = picture.shape[:2]
    scaled = (picture.astype(np.float32) / 255 - mean) / deviation
    pixels[0, :, :height, :width] = scaled.transpose(2, 0, 1)
    return pixels
