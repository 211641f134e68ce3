"""Depth Anything V2 through transformers (Yang et al. 2024): relative inverse depth of a picture.

The pictures are prepared as for the ONNX file (`depth_net.py`), the longer side 518 px; the
published preparation makes the shorter side 518, which takes up to three times as long.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..base.arrays import F32, RGB
from . import device
from .depth_net import prepared, size_in
from .registry import ModelError
from .transformers_net import open_net

WORK = 300 << 20  # bytes at half precision, estimated


class DepthTorch:
    """The network in a folder. Costly to open."""

    def __init__(self, folder: Path) -> None:
        """Raises ModelError: one sentence, where the folder holds no such network."""
        from transformers import AutoModelForDepthEstimation

        self._net = open_net(
            AutoModelForDepthEstimation, folder, "holds no depth network", "its config's",
            trust_remote_code=False,
        )  # fmt: skip
        count = sum(p.numel() for p in self._net.parameters())
        self._tiers = device.plans(device.Need(count, WORK, only_float32=True))

    def inverse_depth(self, rgb: RGB) -> F32:
        """(h', w') relative inverse depth of a picture (h, w, 3). Raises ModelError."""
        pixels = prepared(rgb, size_in(rgb.shape[1], rgb.shape[0]))
        depth = device.run(self._tiers, lambda plan: self._seen(pixels, plan.device))
        if depth.ndim != 2 or not np.isfinite(depth).all():
            raise ModelError("the depth network's output is no depth per pixel")
        return depth

    def _seen(self, pixels: F32, where: device.Device) -> F32:
        import torch

        with torch.inference_mode():
            net = self._net.to(where)
            found = net(pixel_values=torch.from_numpy(pixels).to(where)).predicted_depth
        return np.ascontiguousarray(found[0].float().cpu().numpy(), np.float32)
