"""Monocular depth networks: in one ONNX file, as exports of Depth Anything and of MoGe-2 are.

Depth Anything: one input, pictures (n, 3, h, w) float32, ImageNet-normalised, sides that 14
divides; one output that is relative inverse depth, larger for what is nearer: (n, h, w),
(n, 1, h, w) or (h, w).

MoGe-2 (Wang et al. 2025): pictures in [0, 1] and a number of tokens; `points` (n, h, w, 3) whose
depth lacks a constant, and `mask` (n, h, w), where there are any. The constant and the focal length
are those that make the points fall on their pixels.

Or Depth Anything V2 through transformers (Yang et al. 2024). The pictures are prepared as for the
ONNX file; the published preparation makes the shorter side 518, which takes up to three times as
long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..base.arrays import F32, RGB, Mask
from . import ledger
from .onnx_session import open_session
from .plans import Need, Plan
from .registry import ModelError
from .weight_folder import count_parameters, stamp

SIDE = 518  # px, longer side of what the network sees: what Depth Anything was trained with
PATCH = 14  # px: sides are multiples of it
MEAN = np.array([0.485, 0.456, 0.406], np.float32)  # ImageNet's, of RGB in [0, 1]
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)
TOKENS = 1800  # that MoGe cuts a picture into: within what it was trained with
SURE = 0.5  # of its mask
LEAST_POINTS, MOST_POINTS = 16, 4096  # that tell the camera
GOLDEN = (math.sqrt(5) - 1) / 2
TRIAL = (70, 98)  # px, height and width of the made picture with which a file is tried


class DepthNet:
    """The network in a file. Costly to open."""

    def __init__(self, path: Path) -> None:
        """Raises ModelError: one sentence, where the file is no such network."""
        try:
            self._session: Any = open_session(path, is_foreign=True)
        except Exception as error:  # onnxruntime has a type of its own for everything
            raise ModelError(
                f"{path.name} is not an ONNX network, all in one file, that can be opened"
            ) from error
        names = {output.name for output in self._session.get_outputs()}
        self._is_moge = {"points", "mask"} <= names
        self._name, self._fixed = self._checked_input(path.name)

    def _checked_input(self, name: str) -> tuple[str, tuple[int | None, int | None]]:
        """The input's name, and its height and width where the file says them."""
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        if len(inputs) != 1 + self._is_moge:
            raise ModelError(f"{name} has {len(inputs)} inputs, a depth network has one")
        if not outputs:
            raise ModelError(f"{name} has no output")
        shape, kind = list(inputs[0].shape), inputs[0].type
        if len(shape) != 4 or (shape[1] not in (3, None) and not isinstance(shape[1], str)):
            raise ModelError(f"{name} takes {shape}, a depth network takes pictures (n, 3, h, w)")
        if kind != "tensor(float)":
            raise ModelError(f"{name} takes {kind}, a depth network takes float32")
        height, width = (n if isinstance(n, int) and n > 0 else None for n in shape[2:])
        return inputs[0].name, (height, width)

    def check(self) -> None:
        """Looks at a made picture. Raises ModelError where no depth comes out."""
        height, width = TRIAL
        ramp = np.linspace(0, 255, width)[None, :, None] * np.ones((height, 1, 3))
        self.inverse_depth(ramp.astype(np.uint8))

    def inverse_depth(self, rgb: RGB) -> F32:
        """(h', w') relative inverse depth of a picture (h, w, 3), in the network's own size.

        Raises ModelError.
        """
        if self._is_moge:
            return self._points(rgb).inverse_depth
        width, height = self.size_for(rgb.shape[1], rgb.shape[0])
        pixels = prepared(rgb, (width, height))
        try:
            found = np.asarray(self._session.run(None, {self._name: pixels})[0])
        except Exception as error:
            sentence = f"the depth network cannot look at {width} x {height} px"
            raise ModelError(sentence) from error
        if found.size == 0 or found.squeeze().ndim != 2:
            raise ModelError(f"the depth network's output is {found.shape}, not a depth per pixel")
        depth = np.ascontiguousarray(found.squeeze(), np.float32)
        if not np.isfinite(depth).all():
            raise ModelError("the depth network's output is not finite")
        return depth

    def focal(self, rgb: RGB) -> float | None:
        """Px, in the picture (h, w, 3), that its network says; None where it says none.

        Raises ModelError.
        """
        if not self._is_moge:
            return None
        seen = self._points(rgb)
        return seen.focal * rgb.shape[1] / seen.inverse_depth.shape[1]

    def _points(self, rgb: RGB) -> _Seen:
        width, height = self.size_for(rgb.shape[1], rgb.shape[0])
        pixels = prepared(rgb, (width, height)) * DEVIATION[:, None, None] + MEAN[:, None, None]
        tokens = next(i for i in self._session.get_inputs() if i.name != self._name)
        given = {self._name: pixels, tokens.name: np.array(TOKENS, np.int64)}
        try:
            points, mask = self._session.run(["points", "mask"], given)
            return seen_at(np.asarray(points)[0], np.asarray(mask)[0] > SURE)
        except Exception as error:
            sentence = f"the depth network cannot look at {width} x {height} px"
            raise ModelError(sentence) from error

    def size_for(self, width: int, height: int) -> tuple[int, int]:
        """Width and height px in which the network sees a picture of these."""
        own_width, own_height = size_in(width, height)
        return self._fixed[1] or own_width, self._fixed[0] or own_height


@dataclass(frozen=True, eq=False)
class _Seen:
    """What points say."""

    inverse_depth: F32  # (h, w), 0 where nothing is seen
    focal: float  # px of the picture that they are of


def seen_at(points: F32, is_there: Mask) -> _Seen:
    """Inverse depth and focal length of points (h, w, 3), right, down, away, of a camera's pixels.

    Their depth lacks a constant, which is found with the focal length: each point, seen by a
    camera that looks at the picture's middle, is to fall on its own pixel. Raises ValueError.
    """
    height, width = is_there.shape
    rows, columns = np.nonzero(is_there & np.isfinite(points).all(2))
    if len(rows) < LEAST_POINTS:
        raise ValueError("hardly anything is seen")
    every = np.linspace(0, len(rows) - 1, min(len(rows), MOST_POINTS)).astype(int)
    rows, columns = rows[every], columns[every]
    at = np.stack([columns + 0.5 - width / 2, rows + 0.5 - height / 2], 1).astype(np.float64)
    xyz = points[rows, columns].astype(np.float64)
    depth = xyz[:, 2]
    least, most = -float(depth.min()), -float(depth.min()) + 20 * float(np.ptp(xyz[:, :2]))
    spread = most - least

    def off(logarithm: float) -> tuple[float, float, float]:
        """Mean error, focal length and shift, of a distance of the nearest point."""
        shift = least + spread * math.exp(logarithm)
        across = xyz[:, :2] / (depth + shift)[:, None]
        focal = float((across * at).sum() / max((across**2).sum(), 1e-12))
        return float(np.abs(focal * across - at).mean()), focal, shift

    tried = np.linspace(math.log(1e-4), 0.0, 60)
    best = int(np.argmin([off(t)[0] for t in tried]))
    low, high = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
    for _ in range(40):  # golden sections
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (low, b) if off(a)[0] < off(b)[0] else (a, high)
    _, focal, shift = off((low + high) / 2)
    if focal <= 0:
        raise ValueError("the points are behind the camera")
    away = np.where(is_there, points[..., 2] + shift, np.inf)
    return _Seen((1 / np.maximum(away, 1e-6)).astype(np.float32), focal)


def size_in(width: int, height: int) -> tuple[int, int]:
    """Width and height px in which a network of any size sees a picture of these."""
    scale = SIDE / max(width, height)
    own_width, own_height = (max(PATCH, round(n * scale / PATCH) * PATCH) for n in (width, height))
    return own_width, own_height


def prepared(rgb: RGB, size: tuple[int, int]) -> F32:
    """(1, 3, h', w') what a network gets of a picture (h, w, 3); `size`: width and height px."""
    kind = cv2.INTER_AREA if size[0] < rgb.shape[1] else cv2.INTER_CUBIC
    small = cv2.resize(rgb, size, interpolation=kind)
    pixels = (small.astype(np.float32) / 255 - MEAN) / DEVIATION
    return np.ascontiguousarray(pixels.transpose(2, 0, 1)[None], np.float32)


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
