"""Repairs of the plate by hand: what is painted is filled in anew, or is the photo's again.

Both touch the painted pixels only, whatever the inpainter does. A repair is shown in the edit
wherever it was painted, also far from the objects: the shadow that an object has left behind can
be painted out. Where another thing is selected, the plate is made anew, and its repairs are gone;
where a mask is refined, it is refitted, and they stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, RGB, Mask, Pixels, crop, pixels_from_unit, unit_pixels
from ...base.masks import box_of, dilated
from ...base.progress import Progress, part, silent
from ...document.model import Document, Plate
from ...document.transparency import colours_of, continued
from ...pictures.image import to_u8
from .. import Inpainter
from ..blend import distance
from .plate import (
    RAMP,
    SEAM,
    Box,
    correction,
    cut,
    fill_weight,
    hole_margin,
    plate_cover,
    plate_crop,
)
from .residue import find_residue

RIM = 0.5  # x hole margin: the inpainter fills so much more, to compare with what is there
CONTEXT = 0.6  # x the painted box's longer side, kept around it for the inpainter to copy from
LEAST_CONTEXT = 48  # px
THUMB = (168, 126)  # px, width and height of a thumbnail
AROUND = 1.15  # x what is filled in, that a thumbnail shows
WHOLLY = 0.999  # painted: nothing of what was there is left


@dataclass(frozen=True, eq=False)
class PlatePatch:
    """A part of the plate, and where it is painted."""

    left: int  # px, corner in the photo
    top: int
    pixels: Pixels  # (h, w, 3) of the plate's picture
    coverage: F32  # (h, w) in [0, 1]

    @property
    def box(self) -> Box:
        """x0, y0, x1, y1 px in the photo."""
        height, width = self.coverage.shape
        return self.left, self.top, self.left + width, self.top + height


def patch_of(document: Document, coverage: F32, box: Box) -> PlatePatch:
    """Return a repair's input: `coverage` (H, W) is painted, nothing of it outside `box`."""
    assert document.plate is not None, "make the plate first"
    around = _with_context(box, document.photo.size)
    left, top, right, bottom = around
    painted = coverage[top:bottom, left:right].copy()
    return PlatePatch(left, top, plate_crop(_solid(document), document.plate, around), painted)


def _solid(document: Document) -> Pixels:
    """The photo's pixels (H, W, 3), without the colours that nobody sees under clear ground."""
    picture = document.photo.picture
    return picture.pixels if picture.alpha is None else continued(picture, plate_cover(document))


def _with_context(box: Box, size: tuple[int, int]) -> Box:
    """The box, and what an inpainter copies from around it, in a photo of `size` px."""
    x0, y0, x1, y1 = box
    context = int(max(CONTEXT * max(x1 - x0, y1 - y0), LEAST_CONTEXT))
    left, top = max(x0 - context, 0), max(y0 - context, 0)
    return left, top, min(x1 + context, size[0]), min(y1 + context, size[1])


def fill_patch(
    patch: PlatePatch,
    margin: float,
    inpainter: Inpainter,
    progress: Progress = silent,
    seed: int = 0,
) -> PlatePatch:
    """The patch filled in anew where it is painted, from what is around it.

    `margin`: the photo's `hole_margin`. Raises InpaintError where all of it is painted.
    """
    painted = patch.coverage > 0
    rim = max(round(RIM * margin), 2)
    hole = dilated(painted, rim)
    if hole.all():
        hole = painted
    filled = inpainter.inpaint(patch.pixels, hole, part(progress, 0.0, 0.9), seed)
    progress(0.9, "joining it to the photo")
    old, fill = unit_pixels(patch.pixels), unit_pixels(filled)
    fill = np.clip(fill + correction(old - fill, hole & ~painted, margin), 0, 1)
    mixed = pixels_from_unit(old + patch.coverage[..., None] * (fill - old), patch.pixels.dtype)
    return replace(patch, pixels=np.where(painted[..., None], mixed, patch.pixels))


def with_patch(document: Document, patch: PlatePatch, backend: str) -> Plate:
    """The document's plate with a filled patch in it."""
    plate = document.plate
    assert plate is not None, "make the plate first"
    painted = patch.coverage > 0
    grown = _grown(plate, colours_of(document.photo.picture), _bounds(painted, patch.box))
    inner = _shared(grown, patch.box)
    there = cut(painted, patch.box, inner)
    assert grown.painted is not None
    np.copyto(cut(grown.pixels, grown.box, inner), cut(patch.pixels, patch.box, inner),
              where=there[..., None])  # fmt: skip
    cut(grown.hole, grown.box, inner)[there] = True
    cut(grown.painted, grown.box, inner)[there] = True
    return Plate(grown.left, grown.top, grown.pixels, grown.hole, backend, plate.seed + 1,
                 grown.painted)  # fmt: skip


def restored(document: Document, patch: PlatePatch) -> Plate:
    """The plate with the photo's own pixels where they are painted and no object hides them."""
    plate = document.plate
    assert plate is not None, "make the plate first"
    grown = _grown(plate, colours_of(document.photo.picture), plate.box)
    inner = _shared(grown, patch.box)
    if inner[0] >= inner[2] or inner[1] >= inner[3]:
        return plate
    share = cut(patch.coverage, patch.box, inner) * ~_covered(document, inner)
    pixels = cut(grown.pixels, grown.box, inner)
    hole = cut(grown.hole, grown.box, inner)
    x0, y0, x1, y1 = inner
    photo = colours_of(document.photo.picture)[y0:y1, x0:x1]
    is_own = share > WHOLLY
    old = unit_pixels(pixels)
    mixed = pixels_from_unit(old + share[..., None] * (unit_pixels(photo) - old), photo.dtype)
    np.copyto(pixels, mixed, where=(hole & (share > 0))[..., None])
    np.copyto(pixels, photo, where=is_own[..., None])
    hole[is_own] = False
    assert grown.painted is not None
    cut(grown.painted, grown.box, inner)[is_own] = False
    return Plate(grown.left, grown.top, grown.pixels, grown.hole, plate.backend, plate.seed,
                 grown.painted)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Uncovering:
    """The parts of a photo (H, W, 3) that objects hide now, and hid when its plate was made."""

    pixels: Pixels
    plate: Plate
    before: Mask  # (H, W)
    after: Mask  # (H, W)


def refitted_plate(
    change: Uncovering, inpainter: Inpainter, progress: Progress = silent, seed: int = 0
) -> Plate:
    """The plate for what objects hide now: filled in where they hide more, the photo where less.

    The photo is also back where what is hidden no more had left residue beside it. Everywhere else,
    and where it was repaired by hand, it stays as it is, to the last bit.
    """
    height, width = change.before.shape
    margin = hole_margin(width, height)
    before, after = (
        fill_weight(distance(covered), margin) for covered in (change.before, change.after)
    )
    if (after == before).all():
        return change.plate
    grown = _grown(change.plate, change.pixels, _bounds(after + before > 0, (0, 0, width, height)))
    x0, y0, x1, y1 = grown.box
    old, new = (weight[y0:y1, x0:x1] for weight in (before, after))
    free = ~grown.painted
    is_beside = grown.hole & (old <= 0) & (new <= 0)
    share = np.where(is_beside, _kept_residue(change, grown.box), new / np.maximum(old, 1e-6))
    is_less, is_more = ((new < old) | (is_beside & (share < 1))) & free, (new > old) & free
    photo = unit_pixels(change.pixels[y0:y1, x0:x1])
    mixed = pixels_from_unit(
        photo + share[..., None] * (unit_pixels(grown.pixels) - photo), change.pixels.dtype
    )
    np.copyto(grown.pixels, mixed, where=is_less[..., None])
    grown.hole[is_less & (share <= 0)] = False
    if is_more.any():
        more = np.where(is_more, (new - old) / np.maximum(1 - old, 1e-6), 0).astype(np.float32)
        plate = replace(change.plate, left=grown.left, top=grown.top, pixels=grown.pixels,
                        hole=grown.hole, painted=grown.painted)  # fmt: skip
        around = _with_context(_bounds(is_more, grown.box), (width, height))
        patch = PlatePatch(around[0], around[1], plate_crop(change.pixels, plate, around),
                      crop(more, grown.box, around))  # fmt: skip
        filled = fill_patch(patch, margin, inpainter, progress, seed)
        np.copyto(grown.pixels, crop(filled.pixels, around, grown.box), where=is_more[..., None])
        grown.hole[is_more] = True
    is_painted = change.plate.painted is not None
    return Plate(grown.left, grown.top, grown.pixels, grown.hole, change.plate.backend,
                 change.plate.seed, grown.painted if is_painted else None)  # fmt: skip


def _kept_residue(change: Uncovering, box: Box) -> F32:
    """(h, w) of the box, in [0, 1]: how much stays of what is invented beside the objects there.

    What is nearer to what is hidden no more than to what still is was left by the former. It goes,
    unless it is just as well residue of the latter.
    """
    x0, y0, x1, y1 = box
    height, width = change.before.shape
    margin = hole_margin(width, height)
    gone = change.before & ~change.after
    if not gone.any():
        return np.ones((y1 - y0, x1 - x0), np.float32)
    residue = change.after  # of nothing there is none
    if residue.any():
        residue = find_residue(change.pixels, change.after, margin)
    to_gone, to_there = (distance(there)[y0:y1, x0:x1] for there in (gone, change.after))
    of_there = np.clip((to_gone - to_there) / (RAMP * SEAM * margin), 0, 1)
    return np.maximum(fill_weight(distance(residue)[y0:y1, x0:x1].copy(), margin), of_there)


def thumbnail(photo: Pixels, plate: Plate) -> RGB:
    """(h, w, 3) what is filled in, with some of the photo around it, in the shape of `THUMB`."""
    height, width = photo.shape[:2]
    x0, y0, x1, y1 = plate.box
    across, down = THUMB
    scale = max((x1 - x0) / across, (y1 - y0) / down) * AROUND
    scale = min(scale, width / across, height / down)
    left = int(np.clip((x0 + x1 - scale * across) / 2, 0, width - scale * across))
    top = int(np.clip((y0 + y1 - scale * down) / 2, 0, height - scale * down))
    box = (left, top, left + max(int(scale * across), 1), top + max(int(scale * down), 1))
    small = cv2.resize(plate_crop(photo, plate, box), THUMB, interpolation=cv2.INTER_AREA)
    return to_u8(small.astype(photo.dtype))


def margin_of(document: Document) -> float:
    """Px, see `hole_margin`."""
    return hole_margin(*document.photo.size)


@dataclass(eq=False)
class _Grown:
    """A plate that is being changed."""

    left: int
    top: int
    pixels: Pixels
    hole: Mask
    painted: Mask

    @property
    def box(self) -> Box:
        height, width = self.hole.shape
        return self.left, self.top, self.left + width, self.top + height


def _grown(plate: Plate, photo: Pixels, box: Box) -> _Grown:
    """A copy of the plate that reaches over `box`, too: the photo is there as it was."""
    x0, y0 = min(plate.left, box[0]), min(plate.top, box[1])
    x1, y1 = max(plate.box[2], box[2]), max(plate.box[3], box[3])
    whole = (x0, y0, x1, y1)
    pixels = photo[y0:y1, x0:x1].copy()
    cut(pixels, whole, plate.box)[...] = plate.pixels
    hole = crop(plate.hole, plate.box, whole)
    painted = np.zeros_like(hole)
    if plate.painted is not None:
        painted = crop(plate.painted, plate.box, whole)
    return _Grown(x0, y0, pixels, hole, painted)


def _bounds(there: Mask, box: Box) -> Box:
    """Px of the photo around what is `there` in the `box`."""
    (left, top), (x0, y0, x1, y1) = box[:2], box_of(there)
    return left + x0, top + y0, left + x1, top + y1


def _shared(grown: _Grown, box: Box) -> Box:
    """What of `box` the plate covers."""
    own = grown.box
    return (
        max(own[0], box[0]), max(own[1], box[1]), min(own[2], box[2]), min(own[3], box[3]),
    )  # fmt: skip


def _covered(document: Document, box: Box) -> Mask:
    """(h, w) where an object hides the background of the box, be it ever so little."""
    x0, y0, x1, y1 = box
    covered = np.zeros((y1 - y0, x1 - x0), bool)
    for item in document.objects:
        if (matte := item.matte_here) is not None:
            covered |= crop(matte.alpha, matte.box, box) > 0
    return covered
