"""Measures on Inception: features of FID and KID, and SIFID (Shaham et al., SinGAN, arXiv
1905.01164): the Fréchet distance of the features at all places of one picture and of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB

from ..error import EvaluationError
from .frechet import fitted, frechet_distance
from .inception import DEEPEST, Inception, shapes
from .regions import Region, check_pair
from .trunk_files import read

SIDE = 299  # px that FID's Inception sees
SMALLEST = {64: 16, 192: 24, 768: 128}  # px a side; below it there are hardly any places


class Sifid:
    """A `Measure`: SIFID at its own resolution, of places whose middle lies in the region."""

    def __init__(self, weights: Path, channels: int) -> None:
        """`weights` of torchvision's Inception. Raises EvaluationError."""
        self._channels = channels
        self._net = Inception(read(weights, shapes(channels)), channels, is_fid=False)

    def __call__(self, a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
        """Not negative; nan for a region of fewer than two places."""
        check_pair(a, b)
        least = SMALLEST[self._channels]
        if min(a.shape[:2]) < least:
            told = f"SIFID of {self._channels} channels needs {least} px a side"
            raise EvaluationError(f"{told}, the picture has {min(a.shape[:2])}")
        x, y = _places(self._net, a), _places(self._net, b)  # (h, w, channels)
        return tuple(_distance(x, y, region) for region in regions)


class FidFeatures:
    """The 2048 numbers of a picture that FID and KID compare."""

    def __init__(self, weights: Path) -> None:
        """`weights` of FID's Inception. Raises EvaluationError."""
        self._net = Inception(read(weights, shapes(DEEPEST)), DEEPEST, is_fid=True)

    def __call__(self, rgb: RGB) -> F64:
        """(2048,) of (H, W, 3), resized as TensorFlow 1 did, (x - 128) / 128."""
        import torch

        small = resized_as_tensorflow(rgb.astype(np.float32), SIDE)
        with torch.inference_mode():
            pixels = torch.from_numpy((small - 128) / 128).permute(2, 0, 1)[None]
            return self._net(pixels).mean((2, 3))[0].double().numpy()


def resized_as_tensorflow(pixels: np.ndarray, side: int) -> np.ndarray:
    """(side, side, 3) float32 of (H, W, 3): bilinear between pixels, i at i * H / side.

    The resize that FID's numbers have always been computed with; half a pixel off, and it aliases.
    """
    height, width = pixels.shape[:2]
    xs = np.tile((np.arange(side) * (width / side)).astype(np.float32), (side, 1))
    ys = np.tile((np.arange(side) * (height / side)).astype(np.float32)[:, None], (1, side))
    x0, y0 = np.floor(xs).astype(int), np.floor(ys).astype(int)
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    u, v = (xs - x0)[..., None], (ys - y0)[..., None]
    above = pixels[y0, x0] * (1 - u) + pixels[y0, x1] * u
    below = pixels[y1, x0] * (1 - u) + pixels[y1, x1] * u
    return (above * (1 - v) + below * v).astype(np.float32)


def _places(net: Any, rgb: RGB) -> F64:
    import torch

    with torch.inference_mode():
        pixels = torch.from_numpy(rgb.astype(np.float32) / 127.5 - 1).permute(2, 0, 1)[None]
        return net(pixels)[0].permute(1, 2, 0).double().numpy()


def _distance(a: F64, b: F64, region: Region) -> float:
    if region is None:
        taken = np.ones(a.shape[:2], bool)
    else:
        size = (a.shape[1], a.shape[0])
        taken = cv2.resize(region, size, interpolation=cv2.INTER_AREA) >= 0.5
    if taken.sum() < 2:
        return float("nan")
    return frechet_distance(fitted(a[taken]), fitted(b[taken]))
