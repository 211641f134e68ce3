"""Repairs of a cut-out's soft edge: found anew where an artist paints, and freed of the background.

The edge brush looks for hair, fur and blur farther from the mask's edge than anyone looks unasked,
but only where it was painted. Decontamination takes out of the object's own colours, near its edge,
what they have of the background's beside it: a halo, or a rim of the old place.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, U8, Mask, Pixels, Selection, crop, unit_pixels
from ...base.masks import disc
from ...document.model import Matte
from ..mask_edit import FULL, as_coverage, is_selected
from ..selection import box_around
from .matte import REACH, band_width, soft_cutout
from .soft_edge import find_alpha, signed_distance

AROUND = 4.0  # x band, seen around what is painted
MOST = 16.0  # x band: no hair is looked for farther from the mask's edge
RIM = 1.5, 2.5  # x band inside the edge: all of the spill is taken out, and none
DEEP = 1.5  # x band inside the edge: from there on the colour is the object's alone
SPREADS = 1.5, 6.0, 24.0  # x band: colours are gathered in the nearest of these that has any
LEAST_SHARE = 0.02  # of a window, below which its colour is not known
GRAIN = 0.5  # standard deviations of the object's colours, which are no spill
LIKENESS = 0.25, 0.5  # x the way to the background's colour: no spill below, nothing else above
ALIKE = 0.06  # sRGB: colours so near each other cannot be distinguished


@dataclass(frozen=True, eq=False)
class EdgeStroke:
    """What the edge brush was painted on, and where."""

    pixels: Pixels  # (H, W, 3) the photo's
    selection: Selection  # (H, W)
    mixed: Mask | None  # (H, W) what the brush has found before
    painted: Mask  # (H, W)


def brush_edge(stroke: EdgeStroke) -> tuple[U8, Mask]:
    """The coverage (H, W) with the photo's own soft edge where it is painted, and all such places.

    Outside of what is painted both stay as they are.
    """
    coverage, painted = as_coverage(stroke.selection), stroke.painted
    mixed = painted.copy() if stroke.mixed is None else stroke.mixed | painted
    band = band_width(painted.shape[1], painted.shape[0])
    window = box_around(painted, int(AROUND * band) + 2)
    if window is None:
        return coverage, mixed
    pixels, own = stroke.pixels[window], painted[window]
    before = None if stroke.mixed is None else stroke.mixed[window]
    around, _ = soft_cutout(pixels, stroke.selection[window], band, before)
    known = (around * FULL + 0.5).astype(np.uint8)
    mask = is_selected(known)
    if mask.all() or not mask.any():  # no edge is anywhere near
        return coverage, np.zeros_like(painted) if stroke.mixed is None else stroke.mixed
    away = float(np.abs(signed_distance(mask))[own].max()) + 1.0
    reach = min(away, MOST * band)
    alpha = find_alpha(pixels, known, ~own, max(band, reach / REACH), max(reach, REACH * band))
    coverage[window] = np.where(own, (alpha * FULL + 0.5).astype(np.uint8), coverage[window])
    return coverage, mixed


def unbrush_edge(stroke: EdgeStroke) -> tuple[U8, Mask]:
    """Return the same where the edge is left to be found by itself again."""
    coverage, painted = as_coverage(stroke.selection), stroke.painted
    hard = is_selected(coverage) * np.uint8(FULL)
    mixed = np.zeros_like(painted) if stroke.mixed is None else stroke.mixed & ~painted
    was = painted if stroke.mixed is None else painted & stroke.mixed
    return np.where(was, hard, coverage), mixed


def background_in_edge(pixels: Pixels, matte: Matte) -> F32:
    """(h, w, 3) sRGB, what of the background's colour is in a matte's foreground near its edge.

    Of each colour there, its difference from the object's own, deeper inside, as far as it is
    more like the background's beside it than the object's own colours vary. 0 where the two are
    alike, where nothing of the object is deep enough inside to tell its colour, and where what is
    like the background is cut off from the edge by what is not.
    """
    height, width = pixels.shape[:2]
    band = band_width(width, height)
    spill = np.zeros(matte.foreground.shape, np.float32)
    near_edge = cv2.dilate((matte.alpha < 1).view(np.uint8), disc(int(np.ceil(RIM[1] * band))))
    window = box_around((near_edge > 0) & (matte.alpha > 0), int(SPREADS[1] * band) + 2)
    if window is None:
        return spill
    alpha, own = matte.alpha[window], matte.foreground[window]
    box = (matte.left + window[1].start, matte.top + window[0].start)
    box = (*box, box[0] + alpha.shape[1], box[1] + alpha.shape[0])
    photo = unit_pixels(crop(pixels, (0, 0, width, height), box))
    is_photo = crop(np.ones((height, width), bool), (0, 0, width, height), box)
    inward = signed_distance(alpha >= 0.5)
    inside, spread, sure = _gathered(own, (inward > DEEP * band) & (alpha >= 1), band)
    outside, _, beside = _gathered(photo, (alpha <= 0) & is_photo, band)
    axis = outside - inside
    length = np.sqrt((axis * axis).sum(2))
    along = ((own - inside) * axis).sum(2) / np.maximum(length, 1e-6)  # sRGB towards the background
    least = np.maximum(GRAIN * spread, LIKENESS[0] * length)
    likeness = np.clip((along - least) / np.maximum(LIKENESS[1] * length - least, ALIKE), 0, 1)
    start, end = RIM[0] * band, RIM[1] * band
    share = likeness * np.clip((end - inward) / (end - start), 0, 1)
    share *= np.minimum(sure, beside) * np.clip(length / ALIKE - 1, 0, 1)
    share = _from_outside(np.asarray(share, np.float32), inward < 1, int(np.ceil(end)))
    spill[window] = share[..., None] * (own - inside)
    return spill


def _from_outside(share: F32, start: Mask, steps: int) -> F32:
    """`share` (h, w) of what hangs together with `start` (h, w) by as much or more."""
    reached, square = np.where(start, share, np.float32(0)), np.ones((3, 3), np.uint8)
    for _ in range(steps):
        reached = np.minimum(share, cv2.dilate(reached, square))
    return reached


def _gathered(rgb: F32, where: Mask, band: float) -> tuple[F32, F32, F32]:
    """Mean colour (h, w, 3) of what is nearest `where`, its deviation, and how sure it is (h, w).

    The deviation is that of one channel, sRGB.
    """
    mean = np.zeros_like(rgb)
    square, known = np.zeros(where.shape, np.float32), np.zeros(where.shape, np.float32)
    there = where.astype(np.float32)
    for spread in SPREADS:
        share, colour, power = (
            _blurred(part, spread * band)
            for part in (there, rgb * there[..., None], (rgb * rgb).mean(2) * there)
        )
        new = np.clip(share / LEAST_SHARE, 0, 1) * (1 - known)
        mean += (new / np.maximum(share, 1e-6))[..., None] * colour
        square += new / np.maximum(share, 1e-6) * power
        known += new
    mean /= np.maximum(known, 1e-6)[..., None]
    square /= np.maximum(known, 1e-6)
    deviation = np.sqrt(np.maximum(square - (mean * mean).mean(2), 0))
    return mean, deviation, known


def _blurred(image: F32, sigma: float) -> F32:
    """A Gaussian blur; a wide one at a smaller size."""
    times = max(int(sigma / 3), 1)
    height, width = image.shape[:2]
    size = (max(width // times, 1), max(height // times, 1))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if times > 1 else image
    soft = cv2.GaussianBlur(small, (0, 0), sigma / times, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(soft, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
