"""Fills a hole with patches of its surroundings (PatchMatch, Barnes et al. 2009; no weights).

The search runs on a small picture of the hole and its surroundings, which keeps any photo's time
bounded. Detail comes from the photo at its own resolution and bit depth: every pixel of the hole
knows from where in the surroundings its patch came, and takes that place's detail on top of the
small result's colours:

    filled(x) = low(x) + photo(source(x)) - low(source(x)),   low = the small result, enlarged
"""

from __future__ import annotations

import cv2
import numba
import numpy as np

from ..arrays import I32, RGB, Mask, Pixels
from ..image import resized, to_u8
from ..progress import Progress

SEARCH_PIXELS = 100_000  # of the small picture; 3 x more takes 4 x longer and looks the same
MARGIN = 0.6  # x the hole's longer side, the surroundings that are copied from
MIN_MARGIN = 32  # px
PATCH_RADIUS = 3  # px; 2 repeats things, 5 takes twice as long
ROUNDS = 6  # of propagation; the patches' distances hardly fall any more


class PatchMatchInpainter:
    """The default inpainter: textures and straight edges go on, nothing is understood."""

    name = "patchmatch"

    def missing(self) -> str | None:
        """Why this backend cannot run here, one sentence; None where it can."""
        try:
            from patchmatch import patchmatch_available
        except ImportError:
            return "the package pypatchmatch is not installed"
        return None if patchmatch_available else "pypatchmatch has no library for this system"

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """`rgb` (h, w, 3) with its hole filled; the same bytes outside. Raises ValueError."""
        if hole.all():
            raise ValueError("the object covers the whole photo: there is nothing to fill it from")
        filled = rgb.copy()
        if not hole.any():
            return filled
        window = _window(hole)
        crop, hole = rgb[window], hole[window]
        progress(0.0, "Filling the background")
        small, small_hole = _small(crop, hole)
        small = _search(small, small_hole, seed)
        progress(0.6, "Finding the details")
        sources = _sources(small, small_hole, seed)
        progress(0.8, "Copying the details")
        filled[window] = _with_detail(crop, hole, small, sources)
        progress(1.0, "Filled the background")
        return filled


def _window(hole: Mask) -> tuple[slice, slice]:
    """Rows and columns of the hole and the surroundings that it is filled from."""
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    longer = max(np.ptp(rows), np.ptp(columns)) + 1
    margin = max(MIN_MARGIN, round(MARGIN * longer))
    return (
        slice(max(rows[0] - margin, 0), rows[-1] + 1 + margin),
        slice(max(columns[0] - margin, 0), columns[-1] + 1 + margin),
    )


def _small(crop: Pixels, hole: Mask) -> tuple[RGB, Mask]:
    """The picture that is searched, and its hole: every pixel that the true hole touches."""
    height, width = hole.shape
    shrink = min(1.0, (SEARCH_PIXELS / hole.size) ** 0.5)
    size = max(1, round(width * shrink)), max(1, round(height * shrink))
    small_hole = resized(hole.astype(np.float32), *size) > 0
    # Pixels of the hole must not bleed into the rim of what is kept, so they count for nothing.
    known = (~hole).astype(np.float32)
    weight = resized(known, *size)[..., None]
    total = resized(to_u8(crop) * known[..., None], *size)
    small = np.rint(total / np.maximum(weight, 1e-3))
    return np.clip(small, 0, 255).astype(np.uint8), small_hole


def _search(small: RGB, hole: Mask, seed: int) -> RGB:
    """The small picture with its hole filled by pypatchmatch."""
    from patchmatch import inpaint, set_random_seed

    if hole.all():  # a thin rim of known pixels, lost in the small picture
        return small
    set_random_seed(seed)
    return inpaint(small, hole, patch_size=PATCH_RADIUS)


def _sources(small: RGB, hole: Mask, seed: int) -> I32:
    """(h, w, 2) row, column from where each pixel's patch came; outside the hole itself."""
    height, width = hole.shape
    sources = np.stack(np.mgrid[:height, :width], axis=2).astype(np.int32)
    for radius in (PATCH_RADIUS, 1, 0):
        size = 2 * radius + 1
        kernel = np.ones((size, size), np.uint8)
        usable = cv2.erode((~hole).astype(np.uint8), kernel, borderValue=0)
        places = np.argwhere(usable).astype(np.int32)
        if len(places):
            break
    else:
        return sources
    targets = np.argwhere(hole).astype(np.int32)
    random = np.random.default_rng(seed)
    sources[hole] = places[random.integers(len(places), size=len(targets))]
    padded = np.pad(small, ((radius,) * 2, (radius,) * 2, (0, 0)), mode="edge")
    draws = random.random((ROUNDS, 8, 2)).astype(np.float32)
    _improve(padded, usable.view(np.bool_), targets, sources, radius, draws)
    return sources


@numba.njit(cache=True)
def _distance(padded, row, column, row2, column2, size, limit):
    """Sum of squared differences of two patches of `size` px; stops beyond `limit`."""
    total = 0
    for i in range(size):
        for j in range(size):
            for c in range(3):
                gap = np.int64(padded[row + i, column + j, c]) - padded[row2 + i, column2 + j, c]
                total += gap * gap
        if total >= limit:
            break
    return total
