"""Inception-v3 (Szegedy et al., arXiv 1512.00567) with the names of torchvision's state dict.

Two of them exist: torchvision's, which SIFID is defined on, and the one of FID, whose weights came
from TensorFlow: its averages leave the rim out, and its last block takes the largest instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .trunk_files import Shapes, Tensors

EPSILON = 1e-3  # of the batch normalisation
DEEPEST = 2048  # channels after the last block


@dataclass(frozen=True)
class Conv:
    """Convolution without bias, batch normalisation, rectifier."""

    before: int  # channels
    after: int
    size: tuple[int, int] = (1, 1)  # px, rows and columns
    stride: int = 1
    padding: tuple[int, int] = (0, 0)


def _across(before: int, after: int, length: int) -> Conv:
    return Conv(before, after, (1, length), padding=(0, length // 2))


def _along(before: int, after: int, length: int) -> Conv:
    return Conv(before, after, (length, 1), padding=(length // 2, 0))


def _square(before: int, after: int, size: int) -> Conv:
    return Conv(before, after, (size, size), padding=(size // 2, size // 2))


def _halving(before: int, after: int) -> Conv:
    return Conv(before, after, (3, 3), stride=2)


STEM: Mapping[str, Conv] = {
    "Conv2d_1a_3x3": _halving(3, 32),
    "Conv2d_2a_3x3": Conv(32, 32, (3, 3)),
    "Conv2d_2b_3x3": _square(32, 64, 3),
    "Conv2d_3b_1x1": Conv(64, 80),
    "Conv2d_4a_3x3": Conv(80, 192, (3, 3)),
}


def _a(name: str, before: int, pooled: int) -> dict[str, Conv]:
    return {
        f"{name}.branch1x1": Conv(before, 64),
        f"{name}.branch5x5_1": Conv(before, 48),
        f"{name}.branch5x5_2": _square(48, 64, 5),
        f"{name}.branch3x3dbl_1": Conv(before, 64),
        f"{name}.branch3x3dbl_2": _square(64, 96, 3),
        f"{name}.branch3x3dbl_3": _square(96, 96, 3),
        f"{name}.branch_pool": Conv(before, pooled),
    }


def _c(name: str, inner: int) -> dict[str, Conv]:
    return {
        f"{name}.branch1x1": Conv(768, 192),
        f"{name}.branch7x7_1": Conv(768, inner),
        f"{name}.branch7x7_2": _across(inner, inner, 7),
        f"{name}.branch7x7_3": _along(inner, 192, 7),
        f"{name}.branch7x7dbl_1": Conv(768, inner),
        f"{name}.branch7x7dbl_2": _along(inner, inner, 7),
        f"{name}.branch7x7dbl_3": _across(inner, inner, 7),
        f"{name}.branch7x7dbl_4": _along(inner, inner, 7),
        f"{name}.branch7x7dbl_5": _across(inner, 192, 7),
        f"{name}.branch_pool": Conv(768, 192),
    }


def _e(name: str, before: int) -> dict[str, Conv]:
    return {
        f"{name}.branch1x1": Conv(before, 320),
        f"{name}.branch3x3_1": Conv(before, 384),
        f"{name}.branch3x3_2a": _across(384, 384, 3),
        f"{name}.branch3x3_2b": _along(384, 384, 3),
        f"{name}.branch3x3dbl_1": Conv(before, 448),
        f"{name}.branch3x3dbl_2": _square(448, 384, 3),
        f"{name}.branch3x3dbl_3a": _across(384, 384, 3),
        f"{name}.branch3x3dbl_3b": _along(384, 384, 3),
        f"{name}.branch_pool": Conv(before, 192),
    }


MIDDLE: Mapping[str, Conv] = {
    **_a("Mixed_5b", 192, 32), **_a("Mixed_5c", 256, 64), **_a("Mixed_5d", 288, 64),
    "Mixed_6a.branch3x3": _halving(288, 384),
    "Mixed_6a.branch3x3dbl_1": Conv(288, 64),
    "Mixed_6a.branch3x3dbl_2": _square(64, 96, 3),
    "Mixed_6a.branch3x3dbl_3": _halving(96, 96),
    **_c("Mixed_6b", 128), **_c("Mixed_6c", 160), **_c("Mixed_6d", 160), **_c("Mixed_6e", 192),
}  # fmt: skip
END: Mapping[str, Conv] = {
    "Mixed_7a.branch3x3_1": Conv(768, 192),
    "Mixed_7a.branch3x3_2": _halving(192, 320),
    "Mixed_7a.branch7x7x3_1": Conv(768, 192),
    "Mixed_7a.branch7x7x3_2": _across(192, 192, 7),
    "Mixed_7a.branch7x7x3_3": _along(192, 192, 7),
    "Mixed_7a.branch7x7x3_4": _halving(192, 192),
    **_e("Mixed_7b", 1280),
    **_e("Mixed_7c", 2048),
}
PARTS = {64: STEM, 192: STEM, 768: {**STEM, **MIDDLE}, DEEPEST: {**STEM, **MIDDLE, **END}}


def shapes(channels: int) -> Shapes:
    """Return the shapes of the state dict up to so many channels: 64, 192, 768 or 2048."""
    found: dict[str, tuple[int, ...]] = {}
    for name, conv in PARTS[channels].items():
        found[f"{name}.conv.weight"] = (conv.after, conv.before, *conv.size)
        for of_norm in ("weight", "bias", "running_mean", "running_var"):
            found[f"{name}.bn.{of_norm}"] = (conv.after,)
    return found


class Inception:
    """The network up to a block, on tensors of `shapes(channels)`."""

    def __init__(self, tensors: Tensors, channels: int, is_fid: bool) -> None:
        self._tensors, self._channels, self._is_fid = tensors, channels, is_fid

    def __call__(self, pixels: Any) -> Any:
        """(n, channels, h, w) of (n, 3, H, W) in [-1, 1]: just before what pools them."""
        from torch.nn.functional import max_pool2d

        x = self._stem(pixels, ("Conv2d_1a_3x3", "Conv2d_2a_3x3", "Conv2d_2b_3x3"))
        if self._channels == 64:
            return x
        x = self._stem(max_pool2d(x, 3, 2), ("Conv2d_3b_1x1", "Conv2d_4a_3x3"))
        if self._channels == 192:
            return x
        x = max_pool2d(x, 3, 2)
        for name in ("Mixed_5b", "Mixed_5c", "Mixed_5d"):
            x = self._block_a(x, name)
        x = self._reduced(x, "Mixed_6a", ("branch3x3",), ("branch3x3dbl_1", *_of("3x3dbl", 2, 3)))
        for name in ("Mixed_6b", "Mixed_6c", "Mixed_6d", "Mixed_6e"):
            x = self._block_c(x, name)
        if self._channels == 768:
            return x
        x = self._reduced(x, "Mixed_7a", _of("3x3", 1, 2), _of("7x7x3", 1, 2, 3, 4))
        return self._block_e(self._block_e(x, "Mixed_7b"), "Mixed_7c")

    def _conv(self, x: Any, name: str) -> Any:
        from torch.nn.functional import batch_norm, conv2d, relu

        conv = PARTS[self._channels][name]
        x = conv2d(x, self._tensors[f"{name}.conv.weight"], None, conv.stride, conv.padding)
        mean, variance, weight, bias = (
            self._tensors[f"{name}.bn.{n}"]
            for n in ("running_mean", "running_var", "weight", "bias")
        )
        return relu(batch_norm(x, mean, variance, weight, bias, eps=EPSILON))

    def _stem(self, x: Any, names: tuple[str, ...]) -> Any:
        for name in names:
            x = self._conv(x, name)
        return x

    def _branch(self, x: Any, block: str, names: tuple[str, ...]) -> Any:
        return self._stem(x, tuple(f"{block}.{name}" for name in names))

    def _pooled(self, x: Any, block: str) -> Any:
        from torch.nn.functional import avg_pool2d, max_pool2d

        if self._is_fid and block == "Mixed_7c":
            x = max_pool2d(x, 3, 1, 1)
        else:
            x = avg_pool2d(x, 3, 1, 1, count_include_pad=not self._is_fid)
        return self._branch(x, block, ("branch_pool",))

    def _block_a(self, x: Any, block: str) -> Any:
        import torch

        branches = (("branch1x1",), _of("5x5", 1, 2), _of("3x3dbl", 1, 2, 3))
        found = [self._branch(x, block, names) for names in branches]
        return torch.cat([*found, self._pooled(x, block)], 1)

    def _reduced(self, x: Any, block: str, *branches: tuple[str, ...]) -> Any:
        import torch
        from torch.nn.functional import max_pool2d

        found = [self._branch(x, block, names) for names in branches]
        return torch.cat([*found, max_pool2d(x, 3, 2)], 1)

    def _block_c(self, x: Any, block: str) -> Any:
        import torch

        branches = (("branch1x1",), _of("7x7", 1, 2, 3), _of("7x7dbl", 1, 2, 3, 4, 5))
        found = [self._branch(x, block, names) for names in branches]
        return torch.cat([*found, self._pooled(x, block)], 1)

    def _block_e(self, x: Any, block: str) -> Any:
        import torch

        found = [self._branch(x, block, ("branch1x1",))]
        for name, inner in (("3x3", _of("3x3", 1)), ("3x3dbl", _of("3x3dbl", 1, 2))):
            stem, last = self._branch(x, block, inner), 2 if name == "3x3" else 3
            found += [self._branch(stem, block, (f"branch{name}_{last}{s}",)) for s in "ab"]
        return torch.cat([*found, self._pooled(x, block)], 1)


def _of(branch: str, *numbers: int) -> tuple[str, ...]:
    return tuple(f"branch{branch}_{k}" for k in numbers)
