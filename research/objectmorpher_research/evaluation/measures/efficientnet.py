"""EfficientNet-Lite0 (Tan & Le, arXiv 1905.11946; without squeeze-and-excitation, rectifiers that
end at 6): what EfficientNet-KID compares pictures by, under a name of its own.

KID is defined on FID's Inception. The same estimators on this network give other figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB

from .trunk_files import Shapes, read

WEIGHT = "efficientnet-lite0"
SIDE = 224  # px, what it was trained on
MIDDLE, HALF = 127.0, 128.0  # of pixels, as it was trained: (x - 127) / 128
EPSILON = 1e-3  # of the batch normalisation
STEM, HEAD = 32, 1280  # channels
EXPANSION = 6  # of every block but the first
NORM = ("weight", "bias", "running_mean", "running_var")


@dataclass(frozen=True)
class InvertedResidual:
    """An inverted residual: widened, filtered channel by channel, narrowed."""

    before: int  # channels
    after: int
    size: int  # px of the filters
    stride: int
    expansion: int = EXPANSION


def _stage(
    before: int, after: int, size: int, stride: int, count: int
) -> tuple[InvertedResidual, ...]:
    again = (InvertedResidual(after, after, size, 1),) * (count - 1)
    return InvertedResidual(before, after, size, stride), *again


BLOCKS = (
    InvertedResidual(STEM, 16, 3, 1, expansion=1),
    *_stage(16, 24, 3, 2, 2), *_stage(24, 40, 5, 2, 2), *_stage(40, 80, 3, 2, 3),
    *_stage(80, 112, 5, 1, 3), *_stage(112, 192, 5, 2, 4), *_stage(192, 320, 3, 1, 1),
)  # fmt: skip


def shapes() -> Shapes:
    """Return the shapes of the state dict up to the last features, without the classifier."""
    found: dict[str, tuple[int, ...]] = {}

    def convolution(name: str, norm: str, *shape: int) -> None:
        found[f"{name}.weight"] = shape
        found.update({f"{norm}.{of}": shape[:1] for of in NORM})

    convolution("_conv_stem", "_bn0", STEM, 3, 3, 3)
    for k, block in enumerate(BLOCKS):
        at, wide = f"_blocks.{k}", block.before * block.expansion
        if block.expansion > 1:
            convolution(f"{at}._expand_conv", f"{at}._bn0", wide, block.before, 1, 1)
        convolution(f"{at}._depthwise_conv", f"{at}._bn1", wide, 1, block.size, block.size)
        convolution(f"{at}._project_conv", f"{at}._bn2", block.after, wide, 1, 1)
    convolution("_conv_head", "_bn1", HEAD, BLOCKS[-1].after, 1, 1)
    return found


class EfficientNetFeatures:
    """The 1280 numbers of a picture that EfficientNet-KID compares."""

    def __init__(self, path: Path) -> None:
        """`path` of the weights. Raises EvaluationError."""
        self._tensors = read(path, shapes())

    def __call__(self, rgb: RGB) -> F64:
        """(1280,) of (H, W, 3), resized to 224 x 224: what the classifier is given."""
        import torch

        shrinks = min(rgb.shape[:2]) >= SIDE
        how = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
        small = (
            cv2.resize(rgb, (SIDE, SIDE), interpolation=how).astype(np.float32) - MIDDLE
        ) / HALF
        with torch.inference_mode():
            found = self.places(torch.from_numpy(small).permute(2, 0, 1)[None])
            return found.mean((2, 3))[0].double().numpy()

    def places(self, pixels: Any) -> Any:
        """(n, 1280, h, w) of (n, 3, H, W) in about [-1, 1]: just before the last pooling."""
        from torch.nn.functional import relu6

        x = relu6(self._convolution(pixels, "_conv_stem", "_bn0", stride=2))
        for k, block in enumerate(BLOCKS):
            x = self._block(x, block, f"_blocks.{k}")
        return relu6(self._convolution(x, "_conv_head", "_bn1"))

    def _block(self, x: Any, block: InvertedResidual, at: str) -> Any:
        from torch.nn.functional import relu6

        inner = x
        if block.expansion > 1:
            inner = relu6(self._convolution(inner, f"{at}._expand_conv", f"{at}._bn0"))
        depthwise = f"{at}._depthwise_conv"
        groups = inner.shape[1]
        inner = relu6(self._convolution(inner, depthwise, f"{at}._bn1", block.stride, groups))
        inner = self._convolution(inner, f"{at}._project_conv", f"{at}._bn2")
        return x + inner if block.stride == 1 and block.before == block.after else inner

    def _convolution(self, x: Any, name: str, norm: str, stride: int = 1, groups: int = 1) -> Any:
        """With TensorFlow's "same" padding, which puts an odd pixel at the end, and the norm."""
        from torch.nn.functional import batch_norm, conv2d, pad

        weight = self._tensors[f"{name}.weight"]
        size = weight.shape[-1]
        ends = [max(size - 1 - (n - 1) % stride, 0) for n in x.shape[-2:]]  # px of rows, columns
        (above, left), (below, right) = ([n // 2 for n in ends], [n - n // 2 for n in ends])
        x = conv2d(pad(x, (left, right, above, below)), weight, None, stride, groups=groups)
        scale, shift, mean, variance = (self._tensors[f"{norm}.{of}"] for of in NORM)
        return batch_norm(x, mean, variance, scale, shift, eps=EPSILON)
