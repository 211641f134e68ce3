"""Changes of what stays in front of the edited objects, as it stands in the photo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .arrays import Mask
from .camera import Camera
from .document import Document, Matte
from .edits import EditError
from .raster.posed import PosedSplats

MOSTLY = 0.5  # of a moved object: what hides more of it is hardly what was meant to
FRAMED = 3  # sides of the photo: what touches so many is its background
ALONG = 0.1  # of a side's length, from which it is touched


def keep_in_front(document: Document, k: int, matte: Matte | None = None) -> Document:
    """Object `k` is not edited: it covers what is, by its `matte`, as it stands in the photo.

    The matte may come later. Raises EditError where nothing is selected, or it was moved.
    """
    item = document.objects[k]
    if item.mask is None:
        raise EditError("nothing is selected that could stay in front")
    if item.is_moved:
        raise EditError("what was moved cannot stay where it is")
    kept = replace(item, matte=matte or item.matte, stays_in_front=True)
    return document.with_object(k, kept)


def let_go(document: Document, k: int) -> Document:
    """Object `k` does not stay in front any more."""
    item = replace(document.objects[k], stays_in_front=False)
    return document.with_object(k, item if item.lifted else replace(item, matte=None))


def doubt(document: Document, k: int, posed: Callable[[int], PosedSplats]) -> str | None:
    """What is odd about object `k` as something in front, in words that follow its name.

    It hides most of what was moved, or touches three sides of the photo: both happen where a click
    has taken the background. `posed` gives a moved object's Gaussians where the edit has put them.
    """
    mask = document.objects[k].mask
    if mask is None:
        return None
    for number, item in enumerate(document.objects):
        if item.is_moved and item.is_visible:
            share = _hidden(mask, posed(number), document.photo.camera)
            if share > MOSTLY:
                return f"hides {share:.0%} of {item.name}"
    edges = (mask[0], mask[-1], mask[:, 0], mask[:, -1])
    touched = sum(float(edge.mean()) > ALONG for edge in edges)
    return f"touches {touched} sides of the photo" if touched >= FRAMED else None


def _hidden(mask: Mask, splats: PosedSplats, camera: Camera) -> float:
    """The share of an object's Gaussians within the photo that lie behind `mask` (H, W)."""
    height, width = mask.shape
    means = splats.means[splats.means[:, 2] > 0]
    x, y = np.floor(camera.project(means)).astype(np.int64).T
    is_seen = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return float(mask[y[is_seen], x[is_seen]].mean()) if is_seen.any() else 0.0
