"""LPIPS v0.1 (Zhang et al., arXiv 1801.03924, eq. 1) on AlexNet's or VGG16's convolutions.

d(a, b) = sum over layers of the mean over places of w . (f_a - f_b)^2, f of unit length.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher_core.base.arrays import RGB

from ..error import EvaluationError
from .plain_convolutions import ALEX_LAYERS, VGG_LAYERS, Convolution, features, shapes
from .regions import Region, check_pair, weighted_mean
from .trunk_files import read

# Of pixels in [-1, 1]: ImageNet's means and deviations of the reference's scaling layer.
SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
TINY = 1e-10  # the reference's, below the length of a feature
SMALLEST = {"alex": 31, "vgg": 16}  # px a side that leave something to the last layer


class Lpips:
    """A `Measure`: `Lpips("alex", trunk, heads)(a, b, regions)`."""

    def __init__(self, net: str, trunk: Path, heads: Path) -> None:
        """`net` "alex" or "vgg". Raises EvaluationError where a file does not fit."""
        self._smallest = SMALLEST[net]
        self._layers: tuple[Convolution, ...] = {"alex": ALEX_LAYERS, "vgg": VGG_LAYERS}[net]
        self._tensors = read(trunk, shapes(self._layers))
        told = [layer for layer in self._layers if layer.is_told]
        names = {f"lin{k}.model.1.weight": (1, t.channels[1], 1, 1) for k, t in enumerate(told)}
        self._heads = [tensor.reshape(1, -1, 1, 1) for tensor in read(heads, names).values()]

    def __call__(self, a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
        """Not negative, zero where they are equal. A region is averaged down to each layer."""
        check_pair(a, b)
        if min(a.shape[:2]) < self._smallest:
            least = f"{self._smallest} px a side"
            raise EvaluationError(f"LPIPS needs {least}, the picture has {min(a.shape[:2])}")
        maps = self._maps(a, b)
        return tuple(sum(weighted_mean(layer, region) for layer in maps) for region in regions)

    def _maps(self, a: RGB, b: RGB) -> list[Any]:
        """[(h, w)] of each layer."""
        import torch

        with torch.inference_mode():
            both = torch.from_numpy(np.stack([a, b]).astype(np.float32)).permute(0, 3, 1, 2)
            shift, scale = (torch.tensor(v).reshape(1, 3, 1, 1) for v in (SHIFT, SCALE))
            found = features(self._layers, self._tensors, (both / 127.5 - 1 - shift) / scale)
            maps = []
            for layer, head in zip(found, self._heads, strict=True):
                unit = layer / (layer.square().sum(1, keepdim=True).sqrt() + TINY)
                weighed = ((unit[:1] - unit[1:]).square() * head).sum(1)[0]
                maps.append(weighed.double().numpy())
        return maps
