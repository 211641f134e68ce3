"""Depth Anything V2 through transformers (Yang et al. 2024): relative inverse depth of a picture.

The pictures are prepared as for the ONNX file (`depth_net.py`), the longer side 518 px; the
published preparation makes the shorter side 518, which takes up to three times as long.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import F32, RGB
from . import ledger
from .depth_net import prepared, size_in
from .plans import Need, Plan
from .registry import ModelError
from .weight_folder import count_parameters, stamp

# A network of the transformers package, from a folder: nothing fetched, nothing pickled.


def open_net(kind: Any, folder: Path, absent: str, whose: str, **options: Any) -> Any:
    """The network of class `kind` in `folder`, ready to be asked; `options` as its own has them.

    Raises ModelError: "`folder` `absent`: why", or that the weights are not `whose`.
    """
    from transformers.utils import logging

    logging.disable_progress_bar()
    try:
        net, said = kind.from_pretrained(
            folder, local_files_only=True, use_safetensors=True, output_loading_info=True, **options
        )
    except Exception as error:  # of many kinds: of json, safetensors, the hub, and its own
        reason = str(error).strip().partition("\n")[0]
        raise ModelError(f"{folder} {absent}: {reason}") from error
    if wrong := sorted(map(str, {*said["missing_keys"], *said["mismatched_keys"]})):
        raise ModelError(f"the weights in {folder} are not {whose}: {wrong[0]}")
    return net.eval().requires_grad_(False)


WORK = 400_000_000  # bytes beside the weights


class DepthTorch:
    """The network in a folder. Costly to open."""

    def __init__(self, folder: Path) -> None:
        """Raises ModelError: one sentence, where the folder holds no weights."""
        self._folder = folder
        need = Need(count_parameters(folder), WORK, numbers=("float32",))
        self._model = ledger.Model("Depth Anything", (folder, stamp(folder)), need, self._open)

    def inverse_depth(self, rgb: RGB) -> F32:
        """(h', w') relative inverse depth of a picture (h, w, 3). Raises ModelError."""
        pixels = prepared(rgb, size_in(rgb.shape[1], rgb.shape[0]))
        depth = ledger.SHARED.run(self._model, lambda net, plan: self._seen(net, plan, pixels))
        if depth.ndim != 2 or not np.isfinite(depth).all():
            raise ModelError("the depth network's output is no depth per pixel")
        return depth

    def _open(self, plan: Plan) -> Any:
        from transformers import AutoModelForDepthEstimation

        net = open_net(
            AutoModelForDepthEstimation, self._folder, "holds no depth network", "its config's",
            trust_remote_code=False,
        )  # fmt: skip
        return net.to(plan.device)

    def _seen(self, net: Any, plan: Plan, pixels: F32) -> F32:
        import torch

        with torch.inference_mode():
            found = net(pixel_values=torch.from_numpy(pixels).to(plan.device)).predicted_depth
        return np.ascontiguousarray(found[0].float().cpu().numpy(), np.float32)
