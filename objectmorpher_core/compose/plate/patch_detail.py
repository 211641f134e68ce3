"""The detail of a filled hole, from the photo at its own resolution and bit depth.

Every pixel of the hole knows from where in the small picture its patch came, and takes that
place's detail in the photo on top of the small result's colours:

    filled(x) = low(x) + photo(source(x)) - low(source(x)),   low = the small result, enlarged
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ...base.arrays import F32, I32, Mask, Pixels, frozen
from ...base.kernel_files import numba
from ...base.threads import in_threads
from ...pictures.image import resized

LOW_PASS = 2  # small pixels: what is coarser comes from the search, what is finer from the photo
PARTS, LEAST_ROWS = 4, 32  # of the photo's rows: how many a core, and what one is worth waking
BLEND_STEEPNESS = 2.0  # x, of the blend between two sources' detail


def with_detail(
    crop: Pixels, hole: Mask, small: F32, sources: I32, low_pass: int = LOW_PASS
) -> Pixels:
    """The crop (H, W, 3), its hole (H, W) filled.

    `small` (h, w, 3) is the picture filled at a smaller size, levels up to 255, and `sources`
    (h, w, 3) from where: whether from its mirror image, row and column. None where that is -1.
    What is coarser than `low_pass` pixels of `small` is taken from there.
    """
    size = max(1, small.shape[1] // low_pass), max(1, small.shape[0] // low_pass)
    unit = np.float32(np.iinfo(crop.dtype).max / 255)
    filled = crop.copy()
    rough = resized(small, *size) * unit
    seen = frozen(crop), frozen(hole), frozen(rough, np.float32), frozen(sources)
    in_threads(partial(_copy_detail, *seen, filled), len(crop), PARTS, LEAST_ROWS)
    return filled


@numba.njit(cache=True, nogil=True)
def _copy_detail(crop, hole, rough, sources, filled, first, last):
    """Fills the rows first..last of `filled` (H, W, 3) in its hole: low + the source's detail.

    A pixel between four pixels of the small picture mixes their four sources, mostly the nearest:
    the seam between two sources is a narrow blend.
    """
    height, width = hole.shape
    zoom = height / sources.shape[0], width / sources.shape[1]
    top = 65535.0 if crop.itemsize == 2 else 255.0
    shares, places = np.empty(4), np.empty((4, 2), np.int64)
    for y in range(first, last):
        for x in range(width):
            if not hole[y, x]:
                continue
            _find_places(sources, zoom, width, (y, x), shares, places)
            for c in range(3):
                value, total = 0.0, 0.0
                for k in range(4):
                    i, j = places[k]
                    is_inside = 0 <= i < height and 0 <= j < width
                    if shares[k] > 0 and is_inside and not hole[i, j]:
                        low = _level(rough, (i + 0.5) / height, (j + 0.5) / width, c)
                        value += shares[k] * (np.float64(crop[i, j, c]) - low)
                        total += shares[k]
                low = _level(rough, (y + 0.5) / height, (x + 0.5) / width, c)
                value = value / max(total, 1e-9) + low
                filled[y, x, c] = np.rint(min(max(value, 0.0), top))


@numba.njit(cache=True, nogil=True)
def _find_places(sources, zoom, width, place, shares, places):
    """The four places (4, 2) where pixel (y, x) comes from, and their shares (4,), at most 1."""
    rows, columns = sources.shape[:2]
    y, x = place
    v, u = (y + 0.5) / zoom[0] - 0.5, (x + 0.5) / zoom[1] - 0.5
    v0, u0 = int(np.floor(v)), int(np.floor(u))
    for k in range(4):
        dv, du = k // 2, k % 2
        i, j = min(max(v0 + dv, 0), rows - 1), min(max(u0 + du, 0), columns - 1)
        shares[k] = _step(v - v0, dv) * _step(u - u0, du)
        if sources[i, j, 0] < 0:
            shares[k] = 0
            continue
        places[k, 0] = y + int(np.rint((sources[i, j, 1] - i) * zoom[0]))
        places[k, 1] = x + int(np.rint((sources[i, j, 2] - j) * zoom[1]))
        if sources[i, j, 0] == 1:  # a place in the mirror image
            places[k, 1] = width - 1 - places[k, 1]
        for before in range(k):
            same = places[before, 0] == places[k, 0] and places[before, 1] == places[k, 1]
            if same and shares[before] > 0:
                shares[before] += shares[k]  # mostly all four agree: one look-up instead of four
                shares[k] = 0
                break


@numba.njit(cache=True, nogil=True)
def _level(rough, v, u, c):
    """Channel `c` of `rough` (h, w, 3) at (v, u) in (0, 1), linear between its pixels' centres."""
    rows, columns = rough.shape[:2]
    v, u = v * rows - 0.5, u * columns - 0.5
    v, u = min(max(v, 0.0), rows - 1.0), min(max(u, 0.0), columns - 1.0)
    i, j = int(v), int(u)
    i2, j2 = min(i + 1, rows - 1), min(j + 1, columns - 1)
    upper = rough[i, j, c] + (rough[i, j2, c] - rough[i, j, c]) * (u - j)
    lower = rough[i2, j, c] + (rough[i2, j2, c] - rough[i2, j, c]) * (u - j)
    return upper + (lower - upper) * (v - i)


@numba.njit(cache=True, nogil=True)
def _step(t, side):
    """Share of the `side` (0 or 1) at t in [0, 1] between two samples: steep in the middle."""
    t = min(max((t - 0.5) * BLEND_STEEPNESS + 0.5, 0.0), 1.0)
    t = t * t * (3 - 2 * t)
    return t if side == 1 else 1 - t
