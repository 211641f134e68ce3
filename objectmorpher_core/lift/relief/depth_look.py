"""A look by an installed depth network at an object and its surroundings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import numpy as np

from ... import models
from ...base.arrays import F32, RGB, Mask, Pixels
from ...base.masks import box_of
from ...models.depth_net import DepthNet
from ...models.onnx_session import Looks
from ...pictures.image import to_u8
from .. import LiftError
from .depth_prior import NetworkDepth

Look = Callable[[Pixels, Mask], NetworkDepth | None]
"""Of a photo (H, W, 3), where a mask (H, W) of it is."""
GRAPHS = "depth-graph"  # family of the networks that need no PyTorch
DEPTH_ANYTHING = "depth-anything-v2-small"
PACKAGES = ("torch", "transformers", "safetensors")
MARGIN = 0.35  # x the object's longer side: what of the photo around it is looked at, too
_looks: Looks[F32] = Looks()


def look(pixels: Pixels, mask: Mask) -> NetworkDepth | None:
    """Look with the network at `mask` (H, W) of the photo; None where no network is installed.

    Raises LiftError where the network cannot look at that.
    """
    there = installed()
    if there is None:
        return None
    box = box_around(mask)
    x0, y0, x1, y1 = box
    rgb = np.ascontiguousarray(to_u8(pixels[y0:y1, x0:x1]))
    try:
        inverse = _looks.get(lambda: _opened(there).inverse_depth(rgb), rgb, about=there.id)
        return NetworkDepth(inverse, box)
    except models.ModelError as error:
        raise LiftError(models.unusable(there.model, error)) from error


def look_at_all(pixels: Pixels) -> F32 | None:
    """(h, w) inverse depth of a photo (H, W, 3), see `Document.depth`; None without a network.

    Raises LiftError where the network cannot look at that.
    """
    seen = look(pixels, np.ones(pixels.shape[:2], bool))
    return None if seen is None else seen.inverse


@dataclass(frozen=True)
class There:
    """A depth network on this machine."""

    id: str  # changes with its files
    model: str  # its name among the models
    at: Path
    is_onnx: bool


def installed() -> There | None:
    """The network that is looked with: the user's file, else one of ours, by PyTorch the last."""
    own = models.added("depth")
    if own.state == "ok":
        return There(own.sha256, own.kind.id, own.path, True)
    for model in models.installed(GRAPHS)[:1]:
        (file,) = (f for f in models.files(model.id) if f.suffix == ".onnx")
        facts = file.stat()
        return There(f"{file}:{facts.st_size}:{facts.st_mtime_ns}", model.id, file, True)
    at = models.place(DEPTH_ANYTHING)
    if at is None or any(find_spec(name) is None for name in PACKAGES):
        return None
    facts = (at / "model.safetensors").stat() if (at / "model.safetensors").exists() else at.stat()
    return There(f"{at}:{facts.st_size}:{facts.st_mtime_ns}", DEPTH_ANYTHING, at, False)


def box_around(mask: Mask) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1 px of what is looked at."""
    x0, y0, x1, y1 = box_of(mask)
    return box_of(mask, int(np.ceil(MARGIN * max(x1 - x0, y1 - y0))))


class Net(Protocol):
    """The protocol of `DepthNet` and `DepthTorch`."""

    def inverse_depth(self, rgb: RGB) -> F32:
        """(h', w') of a picture (h, w, 3)."""
        ...


@lru_cache(maxsize=1)
def _opened(there: There) -> Net:
    if there.is_onnx:
        return DepthNet(there.at)
    from ...models.depth_net import DepthTorch

    return DepthTorch(there.at)
