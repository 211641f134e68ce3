"""The convolutions of AlexNet (Krizhevsky, arXiv 1404.5997) and VGG16 (Simonyan & Zisserman, arXiv
1409.1556), with the names of torchvision's state dicts, and their outputs after some rectifiers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .trunk_files import Shapes, Tensors


@dataclass(frozen=True)
class Convolution:
    """A convolution and its rectifier; the pooling before it, if any."""

    index: int  # in torchvision's `features`
    channels: tuple[int, int]  # in, out
    size: int = 3  # px
    stride: int = 1
    padding: int = 1
    pool: int = 0  # px of the largest-of pooling of stride 2 before it; 0: none
    is_told: bool = False  # whether LPIPS looks here

    @property
    def name(self) -> str:
        return f"features.{self.index}"


ALEX_LAYERS = (
    Convolution(0, (3, 64), size=11, stride=4, padding=2, is_told=True),
    Convolution(3, (64, 192), size=5, padding=2, pool=3, is_told=True),
    Convolution(6, (192, 384), pool=3, is_told=True),
    Convolution(8, (384, 256), is_told=True),
    Convolution(10, (256, 256), is_told=True),
)
VGG_LAYERS = (
    Convolution(0, (3, 64)), Convolution(2, (64, 64), is_told=True),
    Convolution(5, (64, 128), pool=2), Convolution(7, (128, 128), is_told=True),
    Convolution(10, (128, 256), pool=2), Convolution(12, (256, 256)),
    Convolution(14, (256, 256), is_told=True),
    Convolution(17, (256, 512), pool=2), Convolution(19, (512, 512)),
    Convolution(21, (512, 512), is_told=True),
    Convolution(24, (512, 512), pool=2), Convolution(26, (512, 512)),
    Convolution(28, (512, 512), is_told=True),
)  # fmt: skip


def shapes(layers: Sequence[Convolution]) -> Shapes:
    """Return the shapes of the state dict."""
    found: dict[str, tuple[int, ...]] = {}
    for layer in layers:
        before, after = layer.channels
        found[f"{layer.name}.weight"] = (after, before, layer.size, layer.size)
        found[f"{layer.name}.bias"] = (after,)
    return found


def features(layers: Sequence[Convolution], tensors: Tensors, pixels: Any) -> list[Any]:
    """Return [(n, channels, h, w)] of the named layers, for (n, 3, H, W)."""
    from torch.nn.functional import conv2d, max_pool2d, relu

    found, x = [], pixels
    for layer in layers:
        if layer.pool:
            x = max_pool2d(x, layer.pool, 2)
        weight, bias = tensors[f"{layer.name}.weight"], tensors[f"{layer.name}.bias"]
        x = relu(conv2d(x, weight, bias, layer.stride, layer.padding))
        if layer.is_told:
            found.append(x)
    return found
