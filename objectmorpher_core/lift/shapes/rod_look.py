"""A look by the rod network at a handle: its azimuth about the axis of what it is on.

The networks are ours (`objectmorpher train rods`) and come with the program in one file; DINOv2,
whose tokens they read, is fetched.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ... import models
from ...base.arrays import F32, RGB, Mask, Pixels
from ...models import registry
from ...models.onnx_session import Looks, open_session
from ...segment import dino_tokens
from ...segment.dino_tokens import PATCH
from ..crop import SIDE
from .rods import RodView

GRID = SIDE // PATCH  # tokens on a side
UNIT = 0.5  # radians, of the network's numbers
SURE = 0.35  # radians, expected error, from which nothing is known
_looks: Looks[tuple[float, float]] = Looks(kept=4)


def planes_of(mask: Mask, rod: Mask) -> F32:
    """(2, GRID, GRID) shares of each token that the object (SIDE, SIDE) and its rod cover."""
    both = np.stack([mask, rod]).astype(np.float32)
    return both.reshape(2, GRID, PATCH, GRID, PATCH).mean((2, 4))


def azimuth_of(pixels: Pixels, mask: Mask, view: RodView) -> float | None:
    """Radians, above 0 towards the camera, of a rod of `mask` (H, W) in a photo (H, W, 3).

    None where the network cannot run, or is not sure.
    """
    seen = view.crop.seen_mask(mask)
    if models.path(registry.TOKENS) is None or not view.rod.any() or not (seen & ~view.rod).any():
        return None
    rgb = view.crop.seen(pixels)
    azimuth, error = _looks.get(
        lambda: look(rgb, seen, view.rod, view.lean), rgb, seen, view.rod, about=str(view.lean)
    )
    return azimuth if error < SURE else None


def look(rgb: RGB, mask: Mask, rod: Mask, lean: float) -> tuple[float, float]:
    """The azimuth and its expected error, radians, in a crop (SIDE, SIDE, 3).

    `mask` of the object and `rod` (SIDE, SIDE), `lean` as in `RodView`. A rod on the left is seen
    in a mirror: the networks know those on the right.
    """
    is_left = np.nonzero(rod)[1].mean() < np.nonzero(mask & ~rod)[1].mean()
    if is_left:
        rgb, mask, rod = rgb[:, ::-1], mask[:, ::-1], rod[:, ::-1]
    tokens = dino_tokens.shared().inner_tokens(np.ascontiguousarray(rgb)).transpose(2, 0, 1)
    wanted = {
        "tokens": np.ascontiguousarray(tokens)[None], "planes": planes_of(mask, rod)[None],
        "lean": np.array([lean / UNIT], np.float32),
    }  # fmt: skip
    azimuth, doubt = (float(value[0]) for value in _session().run(None, wanted))
    return UNIT * azimuth, UNIT * float(np.exp(doubt))


@cache
def _session() -> Any:
    return open_session(registry.rod_network())
