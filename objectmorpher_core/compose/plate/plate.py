"""The photo behind its objects: what is invented, and how it joins what is true.

The inpainter fills a hole that reaches well past the object, so that it never copies the object's
rim. Of the fill only what the object covers is kept, what it leaves beside its cut-out (`residue`),
and a narrow seam: beyond, the photo is true. Where the two meet, the fill takes on the photo's
colour (a membrane, as in Poisson image editing, Perez et al. 2003), so that no line shows where the
object was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from ...base.arrays import F32, Mask, Pixels, crop, pixels_from_unit, unit_pixels
from ...base.masks import LARGE
from ...base.progress import Progress, part, silent
from ...document.model import Document, Matte, Plate
from ...document.settings import Hint
from ...document.transparency import alpha_behind, colours_of
from .. import Inpainter, InpaintError, LooksFar, TakesHints
from ..blend import Box, distance
from .residue import (
    BLACK,
    TINTED,
    Erased,
    Ghost,
    erased_by,
    find_ghosts,
    find_residue,
    keeps_shade,
    shown_shares,
    tint_of,
    visible_residue,
    with_ghosts,
    without_ghosts,
)

HOLE_MARGIN = 0.01  # x the photo's diagonal: the hole reaches this far past the object
MIN_HOLE_MARGIN = 4.0  # px
SEAM = 0.45  # x hole margin, width of the seam around the object
RAMP = 0.6  # of the seam, over which the fill becomes the photo
REACH = 3.0  # x hole margin: the fill's colour is corrected about so far into the hole
COARSE = 4.0  # px of hole margin at which the correction is computed
SIGMAS = (1.0, 2.0, 4.0, 8.0, 16.0)  # coarse px; each weighs a hundredth of the one before
NO_SHADE = 0.6  # tint, from which what is darker is no shadow; see `residue.Ghost`
FAINT = 0.1  # of the logarithm of a fill: what is beside it by so little darker is no shadow
DEEPEST = 0.4  # gain: what is darker yet is the unlit place below a thing, and goes with it
UNSEEN = 0.995  # gain, from which nothing is seen of it
TRUE = 0.05  # share of the fill in a coarse pixel that is still the photo's
CONTEXT = 1.0  # x the hole's longer side, kept around it for the inpainter to copy from
LEAST_CONTEXT = 64  # px
STRIP = 256  # rows that are joined at a time: of 100 megapixels all at once take 10 GB


def hole_margin(width: int, height: int) -> float:
    """Return how far, px, the hole in a photo of this size reaches past the object."""
    return max(MIN_HOLE_MARGIN, HOLE_MARGIN * float(np.hypot(width, height)))


def plate_cover(document: Document) -> Mask:
    """(H, W) True where an object hides the background, be it ever so little.

    What is only selected hides nothing: it is a part of the photo as long as it is not lifted.
    """
    width, height = document.photo.size
    covered = np.zeros((height, width), bool)
    for item in document.objects:
        if (matte := item.matte_here) is not None:
            shared = overlap(matte.box, (0, 0, width, height))
            if shared is not None:
                own = cut(matte.alpha, matte.box, shared)
                cut(covered, (0, 0, width, height), shared)[own > 0] = True
    return covered


def build_plate(
    pixels: Pixels,
    covered: Mask,
    inpainter: Inpainter,
    progress: Progress = silent,
    seed: int = 0,
    hints: tuple[Hint, ...] = (),
) -> Plate:
    """The photo (H, W, 3) without what hides it at `covered` (H, W).

    `Plate.hole` is where anything is invented. Hints are for inpainters that take them. Raises
    InpaintError where nothing is covered.
    """
    if not covered.any():
        raise InpaintError("the object is too thin to be cut out of the photo")
    height, width = covered.shape
    margin = hole_margin(width, height)
    residue = find_residue(pixels, covered, margin)
    away = distance(covered | residue)
    hole = away < margin
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    box = (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
    x0, y0, x1, y1 = box
    window, left, top = _window(box, inpainter, hole.shape, bool(hints))
    cut_out, step = (pixels[window], hole[window]), part(progress, 0.0, 0.9)
    if hints and isinstance(inpainter, TakesHints):
        moved = tuple(hint.moved(-left, -top) for hint in hints)
        filled = inpainter.inpaint_from(*cut_out, moved, step, seed)
    else:
        filled = inpainter.inpaint(*cut_out, step, seed)
    progress(0.9, "joining it to the photo")
    inner = (slice(y0, y1), slice(x0, x1))
    fill, photo = filled[y0 - top : y1 - top, x0 - left : x1 - left], pixels[inner]
    if residue.any():
        residue[inner] = visible_residue(residue[inner], photo, fill)
        away = distance(covered | residue)
    weight = fill_weight(away[inner].copy(), margin)
    del away
    is_invented = weight > 0
    ring = hole[inner] & ~is_invented  # filled, and true
    joined = _joined(photo, fill, weight, ring, margin)
    return Plate(x0, y0, joined, is_invented, inpainter.name, seed)


def _joined(photo: Pixels, fill: Pixels, weight: F32, ring: Mask, margin: float) -> Pixels:
    """The photo with its fill (h, w, 3), which takes on the photo's colour at the ring (h, w)."""
    strips = [slice(first, first + STRIP) for first in range(0, len(photo), STRIP)]
    # Of a large picture the channels one after the other: each is 4 bytes a pixel.
    count = 3 if ring.size <= LARGE else 1
    channels = [slice(first, first + count) for first in range(0, 3, count)]
    parts = []
    for own in channels:
        one, other = (_plane(picture, own) for picture in (photo, fill))
        difference = np.zeros((*ring.shape, count), np.float32)
        for strip in strips:
            difference[strip] = unit_pixels(one[strip]) - unit_pixels(other[strip])
            difference[strip] *= ring[strip, :, None]
        parts.append(_coarse(difference, margin))
        del difference
    small, joined = _coarse_correction(np.dstack(parts), ring, margin), np.empty_like(photo)
    for own in channels:
        one, other = (_plane(picture, own) for picture in (photo, fill))
        change = _enlarged(np.ascontiguousarray(small[..., own]), ring.shape)
        change = change.reshape(*ring.shape, count)
        for strip in strips:
            true, new = unit_pixels(one[strip]), unit_pixels(other[strip])
            mixed = true + weight[strip, :, None] * (np.clip(new + change[strip], 0, 1) - true)
            mixed = pixels_from_unit(mixed, photo.dtype)
            joined[strip, :, own] = np.where(weight[strip, :, None] > 0, mixed, one[strip])
        del change
    return joined


def _plane(picture: Pixels, own: slice) -> Pixels:
    """Channels of a picture (h, w, 3): all of them as they are, one of them in one piece."""
    return picture if own.stop - own.start == 3 else picture[..., own].copy()


def _window(
    box: Box, inpainter: Inpainter, shape: tuple[int, ...], has_hints: bool
) -> tuple[tuple[slice, slice], int, int]:
    """What an inpainter sees around the `box` of a hole: rows and columns, and their corner."""
    height, width = shape
    x0, y0, x1, y1 = box
    context = int(max(CONTEXT * max(x1 - x0, y1 - y0), LEAST_CONTEXT))
    if isinstance(inpainter, LooksFar):
        context = max(context, inpainter.context)
    if has_hints:  # from anywhere
        context = max(width, height)
    top, left = max(y0 - context, 0), max(x0 - context, 0)
    return (slice(top, min(y1 + context, height)), slice(left, min(x1 + context, width))), left, top


def fill_weight(away: F32, margin: float) -> F32:
    """Return the weight of the fill `away` (h, w) px from what hides the background, in place."""
    np.subtract(SEAM * margin, away, out=away)  # all that is as large as the photo
    away /= RAMP * SEAM * margin
    return np.clip(away, 0, 1, out=away)


def correction(difference: F32, ring: Mask, margin: float) -> F32:
    """(h, w, 3) to add to the fill: `difference` (h, w, 3) at the ring, less and less inwards."""
    values = _coarse(difference * ring[..., None], margin)
    return _enlarged(_coarse_correction(values, ring, margin), ring.shape)


def _coarse_correction(values: F32, ring: Mask, margin: float) -> F32:
    """`correction` (h, w, 3) of `_coarse` values that are 0 beside the ring (H, W)."""
    if not ring.any():
        return np.zeros((1, 1, 3), np.float32)
    known = _coarse(ring.astype(np.float32), margin)
    mean, near = _spread(values, known, REACH * margin * _coarseness(margin))
    mean *= near[..., None]
    return mean


def _coarseness(margin: float) -> float:
    """Px of a coarse picture per px of the photo."""
    return min(COARSE / margin, 1.0)


def _coarse(image: np.ndarray, margin: float) -> F32:
    """Return `image` (h, w, ...) as coarse as the margin allows."""
    width, height = (max(round(n * _coarseness(margin)), 1) for n in image.shape[1::-1])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)


def _spread(values: F32, known: F32, reach: float) -> tuple[F32, F32]:
    """Return the mean of `values` (h, w, 3) around each place, and how near to it they are.

    They are 0 where nothing is `known` (h, w). How near is 1 where something is, and falls over the
    `reach`, px. Shepard's interpolation with a heavy-tailed kernel.
    """
    total, mean = np.zeros_like(known), np.zeros_like(values)
    for n, sigma in enumerate(SIGMAS):
        share = 100.0**-n
        total += share * cv2.GaussianBlur(known, (0, 0), sigma)
        mean += share * cv2.GaussianBlur(values, (0, 0), sigma)
    mean /= np.maximum(total, 1e-12)[..., None]
    away = cv2.distanceTransform((known <= 0).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(mean, np.float32), np.exp(-away / reach)


def _enlarged(small: F32, shape: tuple[int, ...]) -> F32:
    size = (shape[1], shape[0])
    return np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_LINEAR), np.float32)


def plate_of_holes(
    document: Document,
    holes: tuple[Matte, ...],
    ghosts: tuple[Ghost, ...] | None = None,
    base: Plate | None = None,
) -> Plate | None:
    """The document's plate, invented only where what stood in these `holes` is gone.

    Around objects that are still there it is the photo, except where it was repaired by hand.
    `ghosts` saves finding them again, and `base`, see `shaded_plate`, most of the rest.
    """
    margin = hole_margin(*document.photo.size)
    near = SEAM * margin
    ghosts = find_ghosts(document, near) if ghosts is None else ghosts
    plate = base or shaded_plate(document, holes, ghosts)
    if plate is not None:
        shares = shown_shares(document, ghosts, holes)
        photo = colours_of(document.photo.picture)
        plate = _rejoined(plate, photo, ghosts, shares, margin)
        plate = with_ghosts(plate, photo, ghosts, shares)
    rest = [o for o in document.objects if o.hides_background and o.matte not in holes]
    if plate is None or not rest:
        return plate
    covered = np.zeros(plate.hole.shape, bool)
    for matte in holes:
        covered |= crop(matte.alpha, matte.box, plate.box) > 0
    is_shown, painted = distance(covered) < near, plate.painted
    if painted is not None:
        painted = painted.copy()
        for item in rest:
            if item.matte is not None:
                painted &= (crop(item.matte.alpha, item.matte.box, plate.box) <= 0) | covered
        is_shown |= painted
    hole = plate.hole & is_shown
    x0, y0, x1, y1 = plate.box
    pixels = np.where(hole[..., None], plate.pixels, document.photo.pixels[y0:y1, x0:x1])
    return replace(plate, pixels=pixels, hole=hole, painted=painted)


def _rejoined(
    plate: Plate, photo: Pixels, ghosts: Sequence[Ghost], shares: Sequence[float], margin: float
) -> Plate:
    """`plate` whose fill takes on the colours of the ghosts that stay, where it meets them.

    It was joined to the photo beyond them, and the seam of the object lies between.
    """
    pixels, near, reach = None, SEAM * margin, REACH * margin
    height, width = plate.hole.shape
    grow = int(np.ceil(reach))
    for ghost, share in zip(ghosts, shares, strict=True):
        if share >= 1:
            continue
        x0, y0, x1, y1 = ghost.box
        box = max(x0 - grow, 0), max(y0 - grow, 0), min(x1 + grow, width), min(y1 + grow, height)
        stays = crop(ghost.there, ghost.box, box)
        away = distance(stays)
        seam = plate.hole[box[1] : box[3], box[0] : box[2]] & ~stays & (away < reach)
        if not seam.any():
            continue
        pixels = plate.pixels.copy() if pixels is None else pixels
        own = pixels[box[1] : box[3], box[0] : box[2]]
        behind = photo[plate.top :, plate.left :][box[1] : box[3], box[0] : box[2]]
        true, fill = unit_pixels(behind), unit_pixels(own)
        change = correction((true - fill) * stays[..., None], stays, margin)
        change *= np.clip(1 - away / reach, 0, 1)[..., None]
        weight = np.clip(away / (RAMP * near), 0, 1)[..., None]
        mixed = true + weight * (np.clip(fill + change, 0, 1) - true)
        mixed = mixed + np.float32(share) * (fill - mixed)
        own[seam] = pixels_from_unit(mixed[seam], pixels.dtype)
    return plate if pixels is None else replace(plate, pixels=pixels)


def erased_beside(document: Document, holes: tuple[Matte, ...]) -> tuple[Erased, ...]:
    """What the edit takes off the photo beside the outlines of what stood in these `holes`."""
    margin = hole_margin(*document.photo.size)
    ghosts = find_ghosts(document, SEAM * margin)
    return erased_by(document, ghosts, shown_shares(document, ghosts, holes), margin)


def shaded_plate(
    document: Document, holes: tuple[Matte, ...], ghosts: tuple[Ghost, ...]
) -> Plate | None:
    """The plate without the ghosts that go, and in the shade that lies behind what only turned.

    It is the same for a whole drag, however far the object has come.
    """
    plate, still = document.plate, shaded(document, holes)
    if plate is None:
        return None
    plate = without_ghosts(plate, document, ghosts, holes)
    if not still:
        return plate
    photo, margin = colours_of(document.photo.picture), hole_margin(*document.photo.size)
    return _in_shade(plate, photo, still, margin)


def shaded(document: Document, holes: tuple[Matte, ...]) -> tuple[Matte, ...]:
    """Return the `holes` behind which a shadow beside them goes on: their things only turned."""
    return tuple(
        item.matte
        for item in document.objects
        if item.matte is not None and item.matte in holes and keeps_shade(item, document)
    )


def _in_shade(plate: Plate, photo: Pixels, still: tuple[Matte, ...], margin: float) -> Plate:
    """Return `plate` with the shadows beside things that only turned going on behind these.

    `still` are the things' mattes. The fill ends such a shadow at the outline, and a turn would
    show that. What differs from the fill in its colour, too, is no shadow.
    """
    (x0, y0, x1, y1), hole = plate.box, plate.hole
    open_hole = hole if plate.painted is None else hole & ~plate.painted
    own = _coarse(open_hole.astype(np.float32), margin)
    covered = np.zeros(own.shape, bool)
    for matte in still:
        covered |= _coarse(crop(matte.alpha, matte.box, plate.box), margin) > 0
    wide, reach = (px * margin * _coarseness(margin) for px in (1.0, REACH))
    own *= distance(covered) < SEAM * wide + 1
    is_true = _coarse(hole.astype(np.float32), margin) < TRUE
    ring, sure = is_true & (distance(own > 0) < wide + 1), own > 0.5
    seen, fill = (
        np.log(_coarse(image, margin) / np.iinfo(image.dtype).max + BLACK)
        for image in (photo[y0:y1, x0:x1], plate.pixels)
    )
    beside, near = _spread(seen * ring[..., None], ring.astype(np.float32), reach)
    usual, _ = _spread(fill * sure[..., None], sure.astype(np.float32), reach)
    darker = np.minimum(beside - usual + FAINT, 0)
    is_shade = np.clip((NO_SHADE - tint_of(darker)) / (NO_SHADE - TINTED), 0, 1)
    share = np.minimum(2 * near, 1) * is_shade * (own > 0)
    gain = np.exp(np.maximum(darker, np.log(np.float32(DEEPEST))) * share[..., None])
    if gain.min() >= UNSEEN:
        return plate
    pixels = plate.pixels.copy()
    _darken(pixels, hole, gain, np.asarray(np.exp(beside - FAINT) - BLACK, np.float32))
    return replace(plate, pixels=pixels)


def _darken(pixels: Pixels, hole: Mask, gain: F32, least: F32) -> None:
    """Multiplies pixels (H, W, 3) in the hole (H, W) by a coarse gain (h, w, 3), in place.

    Not below `least` (h, w, 3).
    """
    height, width = hole.shape
    across, down = gain.shape[1] / width, gain.shape[0] / height
    is_dark = np.asarray((gain < UNSEEN).any((1, 2)))
    for first in range(0, height, STRIP):
        strip = slice(first, min(first + STRIP, height))
        if not is_dark[max(int(down * first) - 1, 0) : int(down * strip.stop) + 2].any():
            continue
        # From the centres of the strip's pixels to those of the coarse picture.
        place = np.array([[across, 0, 0.5 * across - 0.5], [0, down, down * (first + 0.5) - 0.5]])
        more, floor = (
            cv2.warpAffine(
                field, place, (width, strip.stop - first), borderMode=cv2.BORDER_REPLICATE,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            )
            for field in (gain, least)
        )  # fmt: skip
        there = hole[strip] & (np.minimum.reduce(cv2.split(more)) < UNSEEN)
        fill = unit_pixels(pixels[strip][there])
        dark = (fill + BLACK) * more[there] - BLACK
        dark = np.clip(dark, np.minimum(fill, floor[there]), fill)
        pixels[strip][there] = pixels_from_unit(dark, pixels.dtype)


def plate_picture(document: Document) -> Pixels:
    """(H, W, 3) the photo with its objects painted out, but for what stays in front."""
    plate, photo = document.plate, document.photo.pixels
    assert plate is not None, "make the plate first"
    width, height = document.photo.size
    result = plate_crop(photo, plate, (0, 0, width, height))
    for item in document.objects:
        box = overlap(plate.box, item.matte.box) if item.matte is not None else None
        if box is not None and item.matte is not None and item.stays_in_front:
            own, is_invented = item.matte, cut(plate.hole, plate.box, box)[..., None]
            alpha = cut(own.alpha, own.box, box)[..., None]
            behind = cut(result, (0, 0, width, height), box)
            mixed = alpha * cut(own.foreground, own.box, box) + (1 - alpha) * unit_pixels(behind)
            np.copyto(behind, pixels_from_unit(mixed, photo.dtype), where=is_invented)
    return result


def plate_alpha(document: Document) -> np.ndarray | None:
    """(H, W) the alpha of the `plate_picture`; None where the photo has none."""
    plate, alpha, size = document.plate, document.photo.picture.alpha, document.photo.size
    if plate is None or alpha is None:
        return alpha
    there = [(o.matte_here, o.stays_in_front) for o in document.objects]
    result = alpha_behind(alpha, plate, tuple(m for m, stays in there if m and not stays)).copy()
    for matte in (m for m, stays in there if m and stays):
        own = crop(matte.alpha, matte.box, (0, 0, *size))
        np.maximum(result, pixels_from_unit(own, alpha.dtype), out=result)
    return result


def plate_crop(photo: Pixels, plate: Plate, box: Box) -> Pixels:
    """The photo in `box` with its objects painted out."""
    x0, y0, x1, y1 = box
    result = photo[y0:y1, x0:x1].copy()
    inner = overlap(plate.box, box)
    if inner is not None:
        hole, pixels = (cut(part, plate.box, inner) for part in (plate.hole, plate.pixels))
        np.copyto(cut(result, box, inner), pixels, where=hole[..., None])
    return result


def overlap(one: Box, other: Box) -> Box | None:
    """The box that two boxes share; None where they share nothing."""
    x0, y0 = max(one[0], other[0]), max(one[1], other[1])
    x1, y1 = min(one[2], other[2]), min(one[3], other[3])
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def cut(image: np.ndarray, own: Box, box: Box) -> np.ndarray:
    """The part `box` of an image that covers the box `own` around it; not a copy."""
    return image[box[1] - own[1] : box[3] - own[1], box[0] - own[0] : box[2] - own[0]]
