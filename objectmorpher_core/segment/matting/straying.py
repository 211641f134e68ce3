"""Where a mask's edge is farther off than it is thought to be: about hair, fur and manes.

A selection goes around hair in one line, and takes in what shows between and beside the strands.
Alpha is solved for once more on a small picture, with the edge free to be anywhere in a wide band.
That leaks as well into a white sleeve before a white wall; so it is believed only where colours
alone say the same, those of the object well inside that band and of the background well outside,
and where the mask's outline lies on no edge of the picture; within such an edge all is the
object's.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, Mask, Pixels
from ...base.threads import in_threads
from .soft_edge import WHOLE, WHOLE_PICTURE, CropSize, clearness_of, signed_distance, whole_band

STRAY = 3.0  # x band: how far an edge may be off where hair is
CHANGED = 0.1  # alpha, by which the two are at odds
AGREED = 0.1  # how surely, in the mean, colours must say the same
CLEAR = 6.0  # variances that colours are apart, at least: before a busy ground none is sure
EDGES = 0.35, 0.7  # x the way from background to object: a step that is no edge, and that is one
BESIDE = 0.5, 3.0  # x band from the outline: where that step is looked for
GATHERED, DEEP = 2.0, 8.0  # x band: over so much, deviation; and well inside
KNOWN = 3.0  # x the wide reach: so far colours are gathered that are of one side
NEAR = 0.04  # sRGB for one wide reach: how much rather a colour is looked for nearby
MOST = 2000  # colours of each side
NEIGHBOURS = 3
ALIKE = 0.02  # sRGB: a colour so far from one that is known may be of it
LEAST = 11.0  # x band^2: area of what must have changed to be looked at
AROUND = 2.0  # x band: looked at with it


def strays(pixels: Pixels, mask: Mask, band: float, reach: float) -> Mask | None:
    """Where (h, w) the edge of `mask` in a crop (h, w, 3) is to be looked for in `STRAY` x `reach`.

    `band` and `reach`: see `find_alpha`. None where there is no such place.
    """
    size = CropSize.of(pixels, mask, np.zeros_like(mask), STRAY * band)
    times = 1
    while size.band > WHOLE and min(size.mask.shape) > 32:
        size, times = size.half(), 2 * times
    band, reach = band / times, STRAY * reach / times
    distance, rgb = signed_distance(size.mask), size.rgb(WHOLE_PICTURE)
    step = _step(rgb, distance, band, reach)
    is_open = (step < EDGES[0]) & (clearness_of(rgb, distance, reach) > CLEAR)
    if not (is_open & (np.abs(distance) < reach)).any():
        return None
    change = whole_band(size, reach, None) - size.mask
    change[(np.abs(distance) < band) | (np.abs(change) < CHANGED)] = 0
    if np.abs(change).sum() < LEAST * band**2:
        return None
    own = (step > EDGES[1]) & (distance > BESIDE[0] * band) & (distance < BESIDE[1] * band)
    sure = 2 * _likeness(rgb, distance, reach, change != 0, own) - 1
    change[(change > 0) & (sure < 0)] = 0  # a hair before the background is more like that
    share, total = (
        cv2.GaussianBlur(part, (0, 0), GATHERED * band) for part in (sure * change, abs(change))
    )
    found = is_open & (share > AGREED * total) & (total > 0.01)
    found = _large(found, np.abs(change), LEAST * band**2)
    if not found.any():
        return None
    wide = 2 * round(AROUND * band) + 1
    found = cv2.dilate(found.view(np.uint8), np.ones((wide, wide), np.uint8))
    height, width = mask.shape
    return np.repeat(np.repeat(found, times, 0), times, 1)[:height, :width] > 0


def _likeness(rgb: F32, distance: F32, reach: float, where: Mask, own: Mask) -> F32:
    """(h, w) alpha by the colours (h, w, 3) alone `where` asked; one half where they do not tell.

    What is `own` (h, w) is the object's, and so is what is `reach` px within the mask's outline.
    """
    likely = np.full(distance.shape, 0.5, np.float32)
    place = np.indices(distance.shape, dtype=np.float32).transpose(1, 2, 0) * (NEAR / reach)
    features = np.concatenate([rgb, place], -1)
    asked, far = features[where], KNOWN * reach
    apart = np.empty((2, len(asked)), np.float32)
    inside = (distance > reach) & (distance < far) | own
    for side, there in enumerate((inside, (distance < -reach) & (distance > -far))):
        known = features[there]
        if len(known) < NEIGHBOURS:
            return likely
        tree = KDTree(known[:: -(-len(known) // MOST)])

        def look(first: int, last: int, tree: KDTree = tree, side: int = side) -> None:
            found, _ = tree.query(asked[first:last], k=NEIGHBOURS)
            apart[side, first:last] = found[:, -1]

        in_threads(look, len(asked))
    near, off = (apart + ALIKE) ** 2
    likely[where] = off / (near + off)
    return likely


def _step(rgb: F32, distance: F32, band: float, reach: float) -> F32:
    """(h, w) how far the colours (h, w, 3) on both sides of the outline nearby are apart.

    1 is as far as those of the object well inside are from the background's.
    """
    near, far = (k * band for k in BESIDE)
    outside = _mean(rgb, (distance < -near) & (distance > -far), GATHERED * band)
    inside = _mean(rgb, (distance > near) & (distance < far), GATHERED * band)
    deep = _mean(rgb, distance > reach, DEEP * band)
    step, apart = (np.linalg.norm(outside - other, axis=2) for other in (inside, deep))
    return np.asarray(step / np.maximum(apart, 1e-3), np.float32)


def _mean(rgb: F32, where: Mask, over: float) -> F32:
    """(h, w, 3) the colours near by of what is `where` (h, w)."""
    there = where.astype(np.float32)[..., None]
    total = cv2.GaussianBlur(there, (0, 0), over)[..., None]
    mean = cv2.GaussianBlur(rgb * there, (0, 0), over) / np.maximum(total, 1e-4)
    return np.asarray(mean, np.float32)


def _large(found: Mask, change: F32, least: float) -> Mask:
    """The pieces of `found` (h, w) in which `change` (h, w) sums up to `least`."""
    count, pieces = cv2.connectedComponents(found.view(np.uint8), connectivity=8)
    total = np.bincount(pieces.ravel(), weights=change.ravel(), minlength=count)
    total[0] = 0
    return (total >= least)[np.asarray(pieces, np.int32)]
