"""Changes of an object's soft edge, as pure functions Document -> Document.

What the edge brush finds is a part of the mask, soft where the photo is; what is taken out of the
edge's colours is a part of the matte, beside the colours as they were found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import F32, U8, Mask, crop, frozen
from .model import Document, EditObject, Matte, Photo
from .settings import Refined
from .transparency import colours_of


def set_edge(document: Document, k: int, coverage: U8, mixed: Mask) -> Document:
    """The mask of object `k` as the edge brush leaves it: soft as the photo is at `mixed` (H, W).

    See `segment.matting.repair.brush_edge`.
    """
    from .edits import change_mask

    changed = change_mask(document, k, coverage)
    own, kept = changed.objects[k], frozen(mixed) if mixed.any() else None
    objects = (replace(o, mixed=kept) if o.mask is own.mask else o for o in changed.objects)
    return replace(changed, objects=tuple(objects))


def set_decontaminate(
    document: Document, k: int, amount: float, spill: F32 | None = None
) -> Document:
    """Set how far the background's colour is taken out of the edge of object `k`, in [0, 1].

    `spill`: what `spill_of` gives for its matte as it was found, where that is known already.
    """
    from .edits import EditError

    item = document.objects[k]
    if not 0 <= amount <= 1:
        raise EditError(f"a decontamination of {amount:g} is not between 0 and 1")
    if item.matte is None or item.lifted is None:
        raise EditError("lift the object before cleaning its edge")
    found = replace(item, matte=item.found_matte, contaminated=None, decontaminate=float(amount))
    return document.with_object(k, decontaminated(document.photo, found, spill))


def spill_of(photo: Photo, matte: Matte) -> F32:
    """(h, w, 3) sRGB, what of the background's colour is in the edge of a matte."""
    from ..segment.matting.repair import background_in_edge

    return background_in_edge(colours_of(photo.picture), matte)


def decontaminated(photo: Photo, item: EditObject, spill: F32 | None = None) -> EditObject:
    """`item` with as clean an edge as it says, where its matte is as it was found."""
    matte = item.matte
    if matte is None or item.decontaminate == 0 or item.contaminated is not None:
        return item
    spill = spill_of(photo, matte) if spill is None else spill
    clean = np.clip(matte.foreground - np.float32(item.decontaminate) * spill, 0, 1)
    return replace(
        item, matte=replace(matte, foreground=clean), contaminated=matte.foreground
    )  # fmt: skip


def keep_refined(document: Document, refined: Refined | None, disturbed: Mask) -> Document:
    """`document` with what an older refinement shows outside of `disturbed` (H, W)."""
    if refined is None:
        return document
    width, height = document.photo.size
    there = crop(disturbed, (0, 0, width, height), refined.box)
    alpha = np.where(there, np.uint8(0), refined.alpha)
    return replace(document, refined=replace(refined, alpha=alpha) if alpha.any() else None)
