"""A soft cut-out from a hard mask: alpha, and the object's own colours at its edge.

About the mask's edge each pixel may be a mixture of a colour of the object and one of the
background: alpha says how much of it is the object (`soft_edge`), and the object's colour is what
remains when the background's share is taken out (`unmix`). Where the artist drew a soft edge, that
edge is alpha; what was drawn half covered throughout is seen through (`veil`).
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8, Mask, Pixels, Selection, unit_pixels
from ...base.masks import box_of
from ...document.model import Matte
from ..mask_edit import FULL, grow, is_selected, is_soft
from .soft_edge import find_alpha
from .soft_edge import signed_distance as signed_distance
from .straying import STRAY, strays
from .unmix import Unmixed, coarse_colours, unmixed

BAND = 0.0040  # x the photo's diagonal: how far a mask's edge may be off, about
MIN_BAND = 2.0  # px
REACH = 4.0  # x band: how far from the mask's edge alpha may be soft
LARGE = 24.0  # x band: the square root of an object's area, from which it may be
TRUST = 0.1  # in a mask where its edge was found to be farther off
MARGIN = 4.0  # x band, kept around the object in the crop
LOOKED = 4  # px from the frame, at least, over which a run's width is seen to change
EXTENSION = 0.12  # x the object's size: how far it goes on where the photo ends


def band_width(width: int, height: int) -> float:
    """Half-width in px of the soft band for a photo of this size."""
    return max(MIN_BAND, BAND * float(np.hypot(width, height)))


def frame_extension(mask: Mask) -> tuple[int, int, int, int]:
    """Return how far, px, an object that leaves the photo is continued: top, bottom, left, right.

    Turned or moved, such an object would show its cut edge. Mirrored at the frame it goes on for
    a tenth of its size; those pixels are invented, and counted so.
    """
    height, width = mask.shape
    x0, y0, x1, y1 = box_of(mask)
    reach = round(EXTENSION * (max(x1 - x0, y1 - y0) - 1) + 1)
    touches = (y0 == 0, y1 == height, x0 == 0, x1 == width)
    limits = (height - 1, height - 1, width - 1, width - 1)
    top, bottom, left, right = (
        int(min(reach, limit)) if touch else 0 for touch, limit in zip(touches, limits, strict=True)
    )
    return top, bottom, left, right


def extended(image: np.ndarray, extension: tuple[int, int, int, int]) -> np.ndarray:
    """`image` (H, W, ...) continued past its frame by mirroring; no copy where it is not."""
    if not any(extension):
        return image
    top, bottom, left, right = extension
    pads = [(top, bottom), (left, right)] + [(0, 0)] * (image.ndim - 2)
    return np.pad(image, pads, mode="reflect")


def extended_part(
    image: np.ndarray, extension: tuple[int, int, int, int], window: tuple[slice, slice]
) -> np.ndarray:
    """`extended(image, extension)[window]`, without all the rest of it."""
    if not any(extension):
        return image[window]
    kept, pads, inner = [], [], []
    for part, before, size in zip(
        window, (extension[0], extension[2]), image.shape[:2], strict=True
    ):
        start, stop = part.start - before, part.stop - before  # px of the image
        low, high = max(-start, 0), max(stop - size, 0)
        # What is mirrored is kept, too, however narrow the window.
        first = max(min(start, size - 1 - high if high else start), 0)
        last = min(max(stop, low + 1), size)
        kept.append(slice(first, last))
        pads.append((low, high))
        inner.append(slice(start + low - first, stop + low - first))
    pads += [(0, 0)] * (image.ndim - 2)
    return np.pad(image[kept[0], kept[1]], pads, mode="reflect")[inner[0], inner[1]]


def extended_mask(mask: Selection, extension: tuple[int, int, int, int]) -> Selection:
    """`mask` (H, W), bool or u8, continued like `extended`, but only where it touches the frame.

    What merely stands near the frame must not come back as its own mirror image, and what becomes
    narrower towards it goes on closing: a ball that touches the frame has its pole there.
    """
    if not any(extension):
        return mask
    top, bottom, left, right = extension
    whole = extended(mask, extension)
    for axis, before, after in ((0, top, bottom), (1, left, right)):
        turned = np.moveaxis(whole, axis, 0)  # views: both sides are changed in place
        for side, near, far in ((turned, before, after), (turned[::-1], after, before)):
            if near:
                beyond = np.minimum.accumulate(side[near::-1])
                side[:near] = _closing(beyond, side[near : len(side) - far])[:0:-1]
    return whole


def _closing(beyond: Selection, inner: Selection) -> Selection:
    """`beyond` (n, w), rows outward from the frame's own, no wider than its runs go on as conics.

    `inner` (m, w): rows inward, likewise from the frame's own. The square of a conic's chord is a
    parabola over the row.
    """
    own = is_selected(inner[: max(LOOKED, len(beyond))])
    ends = np.flatnonzero(np.diff(own[0], prepend=False, append=False)).reshape(-1, 2)
    far = np.arange(len(beyond))
    at = np.arange(own.shape[1])
    kept = np.zeros(beyond.shape, bool)
    for first, last in ends:
        squares = _chords(own, int(first), int(last)) ** 2
        narrower, bent = _parabola(squares)
        chords = np.sqrt(np.maximum(squares[0] - far * (narrower - bent * far), 0.0))
        middle = 0.5 * (first + last - 1)
        kept |= np.abs(at - middle) <= 0.5 * chords[:, None] - 0.5 + 1e-6
    return np.where(kept, beyond, beyond.dtype.type(0))


def _parabola(squares: F64) -> tuple[float, float]:
    """The parabola from the first of `squares` (k,) through the others: its growth, and its bend.

    Both are 0 where they do not grow; it never bends upwards.
    """
    steps = np.arange(len(squares), dtype=np.float64)
    if len(steps) < LOOKED:
        return 0.0, 0.0
    powers = np.stack([steps, steps**2], -1)
    growth, bend = np.linalg.lstsq(powers, squares - squares[0], rcond=None)[0]
    if bend > 0:
        growth, bend = float(steps @ (squares - squares[0]) / (steps @ steps)), 0.0
    return (float(growth), float(bend)) if growth > 0 else (0.0, 0.0)


def _chords(rows: Mask, first: int, last: int) -> F64:
    """(k,) the lengths, row by row, of the run [first, last) of the first of `rows` (n, w).

    Of a run that parts in two both count; it ends where nothing of it is left.
    """
    found = []
    for row in rows:
        inside = np.flatnonzero(row[first:last])
        if not len(inside):
            break
        before = np.flatnonzero(~row[: first + inside[0]])
        after = np.flatnonzero(~row[first + inside[-1] :])
        first, last = (
            int(before[-1]) + 1 if len(before) else 0,
            first + int(inside[-1]) + int(after[0]) if len(after) else len(row),
        )
        found.append(float(last - first))
    return np.array(found)


def cut_out(pixels: Pixels, mask: Selection, mixed: Mask | None = None) -> Matte:
    """`build_matte` with as much around the object as its soft edge may need."""
    height, width = mask.shape
    return build_matte(pixels, mask, int(np.ceil(MARGIN * band_width(width, height))) + 8, mixed)


def build_matte(
    pixels: Pixels, mask: Selection, margin: int, mixed: Mask | None = None
) -> Matte:  # fmt: skip
    """Soft cut-out of `mask` (H, W) in the photo (H, W, 3), on a crop with `margin` px around it.

    A mask of u8 is a coverage: where it is soft, it is the cut-out's alpha, and where it is `mixed`
    (H, W), the photo is a mixture of object and background by it.
    Where the object leaves the photo the crop does so too, see `frame_extension`.
    Raises ValueError for an empty mask or one that is not the photo's size.
    """
    if mask.shape != pixels.shape[:2]:
        raise ValueError(f"mask is {mask.shape}, photo is {pixels.shape[:2]}")
    if not is_selected(mask).any():
        raise ValueError("the mask is empty")
    band = band_width(mask.shape[1], mask.shape[0])
    extension = frame_extension(is_selected(mask))
    mask = extended_mask(mask, extension)
    mixed = None if mixed is None else extended_mask(mixed, extension)
    far = _far(pixels, mask, mixed, band, extension)
    left, top, right, bottom = far[0] if far else box_of(mask, margin)
    window = np.s_[top:bottom, left:right]
    part = extended_part(pixels, extension, window)
    own = None if mixed is None else mixed[window]
    alpha, colours = soft_cutout(part, mask[window], band, own, far[1] if far else None)
    return Matte(left - extension[2], top - extension[0], alpha, colours.foreground)


def _far(
    pixels: Pixels,
    mask: Selection,
    mixed: Mask | None,
    band: float,
    extension: tuple[int, int, int, int],
) -> tuple[tuple[int, int, int, int], Mask] | None:
    """A box with more of the extended photo around, and where in it the edge may be farther off.

    Near what an artist drew soft, or brushed, it is not; nor is it of what is small, which a wide
    band would be half of.
    """
    if not is_large(is_selected(mask), band):
        return None
    box = box_of(mask, int(np.ceil((STRAY * REACH + MARGIN) * band)))
    window = np.s_[box[1] : box[3], box[0] : box[2]]
    part = extended_part(pixels, extension, window)
    found = strays(part, is_selected(mask[window]), band, REACH * band)
    drawn = _drawn(mask[window], band)
    if mixed is not None:
        drawn |= mixed[window]
    if found is not None and drawn.any():
        found &= ~grow(drawn, STRAY * REACH * band)
    return (box, found) if found is not None and found.any() else None


def is_large(mask: Mask, band: float) -> bool:
    """Whether an object is so large that hair about it may be wider than `band` px and be seen."""
    return bool(np.sqrt(np.count_nonzero(mask)) >= LARGE * band)


def soft_cutout(
    pixels: Pixels,
    selection: Selection,
    band: float,
    mixed: Mask | None = None,
    far: Mask | None = None,
) -> tuple[F32, Unmixed]:
    """Alpha (h, w) and the colours of a photo's crop (h, w, 3) in which an object is selected.

    Where it is `mixed` (h, w), the selection is alpha, as the edge brush found it. `far` (h, w):
    where the edge is to be looked for farther from the mask's than elsewhere, see `strays`.
    """
    if mixed is None or not mixed.any():
        painted, drawn = selection, _drawn(selection, band)
    else:
        painted = np.where(mixed, is_selected(selection) * np.uint8(FULL), selection)
        drawn = _drawn(painted, band) | mixed
    alpha = find_alpha(pixels, selection, drawn, band, REACH * band)
    if far is not None:
        kept = ~far | drawn
        known = (alpha * FULL + 0.5).astype(np.uint8)
        wide = find_alpha(pixels, known, kept, STRAY * band, STRAY * REACH * band, TRUST)
        alpha = np.where(kept, alpha, wide)
    if not drawn.any():
        return alpha, unmixed(pixels, alpha)
    # Of an edge that was drawn the photo is no mixture: what is inside it is the object's own.
    through = veil(painted)
    is_edge = drawn & ~through if mixed is None else drawn & ~through & ~mixed
    share = np.where(is_edge, is_selected(selection), alpha).astype(np.float32)
    colours = unmixed(pixels, share)
    return alpha, _unveiled(pixels, painted, through, colours) if through.any() else colours


def _unveiled(pixels: Pixels, coverage: U8, through: Mask, colours: Unmixed) -> Unmixed:
    """`colours` with those of a veil where `through` (h, w)."""
    small = veil_colour(pixels, coverage, through)
    there = through[colours.rows, colours.columns]
    rows, columns = colours.rows[there], colours.columns[there]
    alpha = coverage[rows, columns] * np.float32(1 / FULL)
    own = colour_at(small, through.shape, rows, columns)
    fore, behind = unveiled(unit_pixels(pixels[rows, columns]), alpha, own)
    foreground, background = colours.foreground, colours.background
    foreground[rows, columns] = fore
    background[there] = behind
    return replace(colours, foreground=foreground, background=background)


def _drawn(selection: Selection, band: float) -> Mask:
    """Where (h, w) the edge is the artist's: what is drawn soft, and the band beside it."""
    if selection.dtype == np.bool_:
        return np.zeros(selection.shape, np.bool_)
    return grow(is_soft(selection), band)


# What an artist drew half covered: a soft edge, or something that is seen through.

RUNS_THROUGH = 0.05  # of an edge is at least this much in the lowest quarter, and in the highest
COARSE = 96  # px, at most: size at which a veil's colour is found
WIDE = 0.25  # x the crop's size: over so much of the veil its colour is averaged
PIECE = 30_000  # px that OpenCV samples at a time
FAINT = 0.05  # coverage below which the veil's colour is unknown


def veil(coverage: U8) -> Mask:
    """(H, W) where a coverage is that of something that is seen through."""
    soft = is_soft(coverage)
    count, found = cv2.connectedComponents(soft.view(np.uint8), connectivity=8)
    pieces = np.asarray(found)[soft]
    size = np.bincount(pieces, minlength=count).astype(np.float64)
    low, high = (
        np.bincount(pieces, weights=part, minlength=count)
        for part in (coverage[soft] < FULL / 4, coverage[soft] > FULL * 3 / 4)
    )
    is_veil = np.minimum(low, high) < RUNS_THROUGH * size
    is_veil[0] = False
    return is_veil[np.asarray(found, np.int32)]


def veil_colour(pixels: Pixels, coverage: U8, where: Mask) -> F32:
    """A veil's own colour, at a small size of the photo's crop (h, w, 3), see `colour_at`."""
    height, width = where.shape
    scale = min(COARSE / max(height, width), 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))

    def small(image: np.ndarray) -> F32:
        return cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)

    rgb = small(pixels) / np.float32(np.iinfo(pixels.dtype).max)
    share = small((coverage * where).astype(np.float32)) / FULL
    hidden = (small((coverage > 0).astype(np.float32)) > 0.01).astype(np.float32)
    _, behind = coarse_colours(rgb, hidden)
    own = (rgb - (1 - share[..., None]) * behind) / np.maximum(share, FAINT)[..., None]
    weight = np.where(share > FAINT, share, 0).astype(np.float32)
    blur = (0, 0), WIDE * max(size)
    total = cv2.GaussianBlur(weight, *blur)
    mean = cv2.GaussianBlur(np.clip(own, 0, 1).astype(np.float32) * weight[..., None], *blur)
    return np.asarray(mean / np.maximum(total, 1e-6)[..., None], np.float32)


def colour_at(small: F32, shape: tuple[int, ...], rows: np.ndarray, columns: np.ndarray) -> F32:
    """(N, 3) `small` at pixels of a picture of `shape` (h, w), smoothly."""
    y = (rows + 0.5) * (small.shape[0] / shape[0]) - 0.5
    x = (columns + 0.5) * (small.shape[1] / shape[1]) - 0.5
    found = np.empty((len(rows), 3), np.float32)
    for k in range(0, len(rows), PIECE):
        part = slice(k, k + PIECE)
        left, top = (axis[part, None].astype(np.float32) for axis in (x, y))
        mode, border = cv2.INTER_LINEAR, cv2.BORDER_REPLICATE
        sampled = cv2.remap(small, left, top, mode, borderMode=border)
        found[part] = np.asarray(sampled)[:, 0]
    return found


def unveiled(rgb: F32, alpha: F32, own: F32) -> tuple[F32, F32]:
    """F and B (N, 3) that mix to `rgb` (N, 3): F is `own` as far as a B in [0, 1] allows it."""
    a = alpha[:, None].astype(np.float64)
    behind = np.clip((rgb - a * own) / (1 - a), 0, 1)
    fore = np.clip((rgb - (1 - a) * behind) / a, 0, 1)
    return fore.astype(np.float32), behind.astype(np.float32)
