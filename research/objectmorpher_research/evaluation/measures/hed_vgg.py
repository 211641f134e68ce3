"""HED-VGG perceptual: how differently a VGG16 sees two pictures, under a name of its own.

The network is that of an edge detector (HED, Xie & Tu, arXiv 1504.06375): a VGG16 of ImageNet whose
convolutions were trained on for edges. It is not LPIPS's VGG16 and has no learned heads: the
figures are no LPIPS.

d(a, b) = mean over 5 layers of the mean over places of |f_a - f_b|^2 / 2, f of unit length:
1 - the cosine of what is seen there, in [0, 1], for features after a rectifier are not negative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher_core.base.arrays import F32, F64, RGB
from objectmorpher_core.models.onnx_session import open_session

from ..error import EvaluationError
from .onnx_build import OnnxGraph
from .regions import Region, check_pair, weighted_mean

WEIGHT = "hed-vgg"
BLOCKS = ((64, 64), (128, 128), (256, 256, 256), (512, 512, 512), (512, 512, 512))  # channels
MEAN_BGR = np.array([104.00699, 116.66877, 122.67892], np.float32)  # of ImageNet, as HED's authors
IMAGES = "images"
TINY = 1e-10  # below the length of a feature: where nothing is seen in either, nothing differs


def read_hed_vgg(path: Path) -> HedVgg:
    """The measure on the weights in a file. Raises EvaluationError."""
    return HedVgg(read_arrays(path))


def read_arrays(path: Path) -> dict[str, F32]:
    """Every array of an HDF5 file by its path, as "block1/vars/0". Raises EvaluationError."""
    import h5py

    found: dict[str, F32] = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = np.asarray(item, np.float32)

    try:
        with h5py.File(path) as file:
            file.visititems(take)
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise EvaluationError(f"{path} is damaged, or no HDF5 file of weights") from error
    return found


class HedVgg:
    """A `Measure`; opens the network."""

    def __init__(self, arrays: Mapping[str, F32]) -> None:
        """`arrays` of Keras's file by their paths. Raises EvaluationError."""
        self._session: Any = open_session(vgg_graph(arrays))

    def __call__(self, a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
        """In [0, 1], zero where they are equal. A region is averaged down to each layer."""
        check_pair(a, b)
        maps = [_difference(x, y) for x, y in zip(self.layers(a), self.layers(b), strict=True)]
        return tuple(
            float(np.mean([weighted_mean(layer, region) for layer in maps])) for region in regions
        )

    def layers(self, rgb: RGB) -> list[F32]:
        """[(channels, h, w)] after the last rectifier of each block, of a picture (H, W, 3)."""
        pixels = rgb[..., ::-1].astype(np.float32) - MEAN_BGR
        found = self._session.run(None, {IMAGES: pixels.transpose(2, 0, 1)[None]})
        return [np.asarray(layer[0], np.float32) for layer in found]


def vgg_graph(arrays: Mapping[str, F32]) -> bytes:
    """Return an ONNX file of the convolutions in Keras's file, with an output after each block.

    The pooling keeps a last odd row and column, as HED's does. Raises EvaluationError.
    """
    graph, x, before, told = OnnxGraph(), IMAGES, 3, []
    for block, widths in enumerate(BLOCKS, 1):
        if block > 1:
            halves = {"kernel_shape": (2, 2), "strides": (2, 2), "ceil_mode": 1}
            x = graph.add("MaxPool", f"pool{block}", [x], halves)
        for k, width in enumerate(widths):
            at = f"block{block}/layers/conv2d{f'_{k}' if k else ''}/vars"
            kernel, bias = arrays.get(f"{at}/0"), arrays.get(f"{at}/1")
            if kernel is None or bias is None or kernel.shape != (3, 3, before, width):
                raise EvaluationError(f"the weights of {WEIGHT} lack {at}")
            weights = graph.constant(f"{at}/w", kernel.transpose(3, 2, 0, 1))
            inputs = [x, weights, graph.constant(f"{at}/b", bias)]
            x = graph.add("Conv", f"{at}/conv", inputs, {"pads": (1, 1, 1, 1)})
            x = graph.add("Relu", f"{at}/relu", [x], {})
            before = width
        told.append(x)
    return graph.model(IMAGES, told)


def _difference(x: F32, y: F32) -> F64:
    """(h, w) of (channels, h, w)."""
    unit = [v / (np.sqrt(np.square(v).sum(0)) + TINY) for v in (x, y)]
    return np.square(unit[0] - unit[1]).sum(0, dtype=np.float64) / 2
