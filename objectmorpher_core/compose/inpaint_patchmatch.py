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

from ..arrays import I32, RGB, Mask, Pixels, frozen
from ..image import resized, to_u8
from ..progress import Progress
from . import InpaintError

SEARCH_PIXELS = 100_000  # of the small picture; 3 x more takes 4 x longer and looks the same
MARGIN = 0.6  # x the hole's longer side, the surroundings that are copied from
MIN_MARGIN = 32  # px
PATCH_RADIUS = 3  # px; 2 repeats things, 5 takes twice as long
LOW_PASS = 2  # small pixels: what is coarser comes from the search, what is finer from the photo
BLEND_STEEPNESS = 2.0  # x, of the blend between two sources' detail
ROUNDS = 6  # of propagation; the patches' distances hardly fall any more


class PatchMatchInpainter:
    """The default inpainter: textures and straight edges go on, nothing is understood."""

    name = "patchmatch"
    is_random = True

    def missing(self) -> str | None:
        """Why this backend cannot run here, one sentence; None where it can."""
        try:
            from patchmatch import patchmatch_available
        except ImportError:
            return "the package pypatchmatch is not installed"
        return None if patchmatch_available else "pypatchmatch has no library for this system"

    def inpaint(self, rgb: Pixels, hole: Mask, progress: Progress, seed: int = 0) -> Pixels:
        """`rgb` (h, w, 3) with its hole filled; the same bytes outside. Raises InpaintError."""
        if hole.all():
            raise InpaintError("the hole covers everything: there is nothing to fill it from")
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
    small, small_hole = (
        resized(to_u8(crop), *size).copy(),
        resized(hole.astype(np.float32), *size) > 0,
    )
    # A rim too thin for the small picture is at least known by its mean colour.
    small[small_hole] = to_u8(crop)[~hole].mean(0) if small_hole.all() else 0
    return small, small_hole


def _search(small: RGB, hole: Mask, seed: int) -> RGB:
    """The small picture with its hole filled by pypatchmatch."""
    from patchmatch import inpaint, set_random_seed

    if hole.all():
        return small
    set_random_seed(seed)
    return inpaint(small, hole, patch_size=PATCH_RADIUS)


def _sources(small: RGB, hole: Mask, seed: int) -> I32:
    """(h, w, 2) row, column from where each pixel's patch came; outside the hole itself."""
    height, width = hole.shape
    sources = np.moveaxis(np.indices((height, width), dtype=np.int32), 0, 2).copy()
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
    padded = np.pad(small, ((radius, radius), (radius, radius), (0, 0)), mode="edge")
    seen = frozen(padded), frozen(usable, np.bool_), frozen(targets)
    _improve(*seen, sources, random)
    return sources


@numba.njit(cache=True)
def _distance(padded, here, there, size, limit):
    """Sum of squared differences of two patches of `size` px; stops beyond `limit`."""
    total = 0
    for i in range(size):
        for j in range(size):
            for c in range(3):
                a = np.int64(padded[here[0] + i, here[1] + j, c])
                gap = a - np.int64(padded[there[0] + i, there[1] + j, c])
                total += gap * gap
        if total >= limit:
            break
    return total


@numba.njit(cache=True)
def _improve(padded, usable, targets, sources, random):
    """PatchMatch rounds over the `targets` (T, 2): neighbours' sources, then random places.

    `sources` (h, w, 2) is changed in place; `padded` has the patch's radius more on every side.
    """
    height, width = usable.shape
    size = padded.shape[0] - height + 1
    best = np.empty(len(targets), np.int64)
    for k in range(len(targets)):
        row, column = targets[k]
        source = (sources[row, column, 0], sources[row, column, 1])
        best[k] = _distance(padded, (row, column), source, size, 1 << 40)
    for turn in range(ROUNDS):
        step = 1 if turn % 2 == 0 else -1
        for n in range(len(targets)):
            k = n if step > 0 else len(targets) - 1 - n
            row, column = targets[k]
            reach = max(height, width)
            attempt = 0
            while attempt < 2 or reach >= 1:
                if attempt < 2:  # what the pixel before, in the row and in the column, found
                    i, j = (row - step, column) if attempt == 0 else (row, column - step)
                    if not (0 <= i < height and 0 <= j < width):
                        attempt += 1
                        continue
                    i, j = sources[i, j, 0] + row - i, sources[i, j, 1] + column - j
                else:
                    i = sources[row, column, 0] + np.int64((2 * random.random() - 1) * reach)
                    j = sources[row, column, 1] + np.int64((2 * random.random() - 1) * reach)
                    reach //= 2
                attempt += 1
                if not (0 <= i < height and 0 <= j < width) or not usable[i, j]:
                    continue
                distance = _distance(padded, (row, column), (i, j), size, best[k])
                if distance < best[k]:
                    best[k] = distance
                    sources[row, column, 0], sources[row, column, 1] = i, j


def _with_detail(crop: Pixels, hole: Mask, small: RGB, sources: I32) -> Pixels:
    """The crop at its own resolution, its hole filled as the head of this module says."""
    rough = resized(small, max(1, small.shape[1] // LOW_PASS), max(1, small.shape[0] // LOW_PASS))
    unit = np.float32(np.iinfo(crop.dtype).max / 255)
    filled = crop.copy()
    seen = frozen(crop), frozen(hole), frozen(rough * unit), frozen(sources)
    _copy_detail(*seen, filled)
    return filled


@numba.njit(cache=True)
def _copy_detail(crop, hole, rough, sources, filled):
    """Fills `filled` (h, w, 3) in its hole: low + the detail of each pixel's source.

    A pixel between four pixels of the small picture mixes their four sources, mostly the nearest:
    the seam between two sources is a narrow blend.
    """
    height, width = hole.shape
    zoom = height / sources.shape[0], width / sources.shape[1]
    top = 65535.0 if crop.itemsize == 2 else 255.0
    shares, places = np.empty(4), np.empty((4, 2), np.int64)
    for y in range(height):
        for x in range(width):
            if not hole[y, x]:
                continue
            _places(sources, zoom, y, x, shares, places)
            for c in range(3):
                value = _level(rough, y / height, x / width, c)
                for k in range(4):
                    i, j = (
                        min(max(places[k, 0], 0), height - 1),
                        min(max(places[k, 1], 0), width - 1),
                    )
                    if shares[k] > 0 and not hole[i, j]:
                        low = _level(rough, i / height, j / width, c)
                        value += shares[k] * (np.float64(crop[i, j, c]) - low)
                filled[y, x, c] = np.rint(min(max(value, 0.0), top))


@numba.njit(cache=True)
def _places(sources, zoom, y, x, shares, places):
    """The four places (4, 2) where pixel y, x comes from, and their shares (4,), sum 1."""
    rows, columns = sources.shape[:2]
    v, u = (y + 0.5) / zoom[0] - 0.5, (x + 0.5) / zoom[1] - 0.5
    v0, u0 = int(np.floor(v)), int(np.floor(u))
    for k in range(4):
        dv, du = k // 2, k % 2
        i, j = min(max(v0 + dv, 0), rows - 1), min(max(u0 + du, 0), columns - 1)
        shares[k] = _step(v - v0, dv) * _step(u - u0, du)
        places[k, 0] = y + int(np.rint((sources[i, j, 0] - i) * zoom[0]))
        places[k, 1] = x + int(np.rint((sources[i, j, 1] - j) * zoom[1]))
        for before in range(k):
            if places[before, 0] == places[k, 0] and places[before, 1] == places[k, 1]:
                shares[before] += shares[k]  # mostly all four agree: one look-up instead of four
                shares[k] = 0
                break


@numba.njit(cache=True)
def _level(rough, v, u, c):
    """Channel `c` of `rough` (h, w, 3) at (v, u) in [0, 1), linear between its pixels."""
    rows, columns = rough.shape[:2]
    v, u = v * rows - 0.5, u * columns - 0.5
    v, u = min(max(v, 0.0), rows - 1.0), min(max(u, 0.0), columns - 1.0)
    i, j = int(v), int(u)
    i2, j2 = min(i + 1, rows - 1), min(j + 1, columns - 1)
    upper = rough[i, j, c] + (rough[i, j2, c] - rough[i, j, c]) * (u - j)
    lower = rough[i2, j, c] + (rough[i2, j2, c] - rough[i2, j, c]) * (u - j)
    return upper + (lower - upper) * (v - i)


@numba.njit(cache=True)
def _step(t, side):
    """Share of the `side` (0 or 1) at t in [0, 1] between two samples: steep in the middle."""
    t = min(max((t - 0.5) * BLEND_STEEPNESS + 0.5, 0.0), 1.0)
    t = t * t * (3 - 2 * t)
    return t if side == 1 else 1 - t
