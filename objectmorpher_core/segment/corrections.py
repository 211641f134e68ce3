"""The artist's manual corrections of a mask, kept when a later click has the object found anew.

`EditObject.found` is what the prompt had given: where the mask differs from it, the artist decided.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Mask, Selection
from ..document.model import EditObject, Prompt
from .mask_edit import FULL, grow, is_soft


def corrected(item: EditObject, found: Mask, prompt: Prompt) -> tuple[Selection, Mask]:
    """`found` (H, W) with the object's corrections, and without them.

    A piece of them that a new click of the prompt contradicts is given up. A soft edge stays
    where the outline does.
    """
    assert item.mask is not None and item.found is not None
    kept = item.mask != item.found
    for x, y in _contradictions(item, prompt):
        kept &= ~_piece(kept, x, y)
    mask = np.where(kept, item.mask, found)
    without = mask ^ kept
    if item.coverage is None:
        return mask, without
    soft = is_soft(item.coverage)
    soft &= ~grow(mask != item.mask, _softness(item.mask, soft))
    return np.where(soft, item.coverage, mask * np.uint8(FULL)), without


def _contradictions(item: EditObject, prompt: Prompt) -> list[tuple[int, int]]:
    """Pixels x, y of new clicks that say the contrary of the mask."""
    assert item.mask is not None
    places = []
    for click in prompt.clicks:
        x, y = int(click.x), int(click.y)
        if click not in item.prompt.clicks and item.mask[y, x] != click.is_foreground:
            places.append((x, y))
    return places


def _piece(mask: Mask, x: int, y: int) -> Mask:
    """The connected piece (H, W) of a mask that pixel x, y is in; nothing beside the mask."""
    if not mask[y, x]:
        return np.zeros_like(mask)
    _, labels = cv2.connectedComponents(mask.view(np.uint8), connectivity=4)
    return labels == labels[y, x]


def _softness(mask: Mask, soft: Mask) -> float:
    """How far, in px, what is soft (H, W) reaches from the mask's edge."""
    from .matting.matte import signed_distance

    return 1.0 + float(np.abs(signed_distance(mask))[soft].max(initial=0.0))
