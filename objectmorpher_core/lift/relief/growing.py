"""A texture grown over a place from what is around it: pixels copied so that neighbours fit.

Every pixel to be filled holds the place that it is copied from. A place is good where the pixels
around it look like those around the pixel, and most often a neighbour's place, moved along, is
the best (Ashikhmin 2001; corrected from coarse to fine as Lefebvre & Hoppe 2005 do). What comes
out consists of the source's own pixels, as sharp as they are.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, Mask, frozen
from ...base.kernel_files import numba

COARSEST = 24  # px, longer side of the picture in which it begins
LEAST = 60  # px of the source there
MOSTLY = 0.7  # share of a coarser pixel that is the source's
PASSES = 4  # over the picture, at each size
FIRST_TRIES = 40  # places by chance for each pixel at the first size
TRIES = 4  # places by chance for each pixel, beside its neighbours', at the others
SMOOTH = 2.5  # px, of the local means that are to agree, too
GUIDE = 1.0  # weight of their difference beside that of the patches
REACH = 2  # px: a patch is 2 REACH + 1 wide


def grown(rgb: F32, source: Mask, hole: Mask, seed: int = 0) -> F32:
    """`rgb` (h, w, 3) with `hole` (h, w) filled from `source` (h, w).

    What `rgb` is in the hole is what it grows from. All else stays. The hole stays as it is where
    there is no source.
    """
    if not (hole.any() and source.any()):
        return rgb
    levels = [(rgb, source, hole)]
    while max(source.shape) > COARSEST:
        smaller = _halved(*levels[-1])
        if smaller[1].sum() < LEAST:
            break
        levels.append(smaller)
        source = smaller[1]
    rng = np.random.default_rng(seed)
    rows, columns = np.nonzero(source)
    chosen = rng.integers(0, len(rows), source.shape)
    places = np.stack([rows[chosen], columns[chosen]], -1)
    picture, settled, tries = levels[-1][0], source, FIRST_TRIES
    for image, known, unknown in reversed(levels):
        if known.shape != settled.shape:
            places = _doubled(places, *known.shape)
            picture, settled = _copied(image, known, unknown, places), known | unknown
        rows, columns = np.nonzero(known)
        offered = rng.integers(0, len(rows), (PASSES, *known.shape, tries), dtype=np.int32)
        choice = np.stack([rows, columns], -1).astype(np.int32)
        guide = _smooth(image, known | unknown)
        inputs = [frozen(a) for a in (image, guide, known, unknown, offered, choice)]
        picture = np.ascontiguousarray(picture, np.float32).copy()
        _correct(picture, places, settled.copy(), *inputs)
        tries = TRIES
    return picture


def _copied(image: F32, source: Mask, hole: Mask, places: np.ndarray) -> F32:
    """`image` (h, w, 3) with the hole copied from places (h, w, 2) that are in the source."""
    row, column = np.clip(places, 0, np.array(hole.shape) - 1)[hole].T
    found = np.where(source[row, column, None], image[row, column], image[hole])
    result = image.copy()
    result[hole] = found
    return result


def _smooth(rgb: F32, where: Mask) -> F32:
    """Local means of `rgb` (h, w, 3) over `where` (h, w)."""
    weight = where.astype(np.float32)
    total = cv2.GaussianBlur(rgb * weight[..., None], (0, 0), SMOOTH)
    share = cv2.GaussianBlur(weight, (0, 0), SMOOTH)
    return np.asarray(total / np.maximum(share, 1e-6)[..., None], np.float32)


def _halved(rgb: F32, source: Mask, hole: Mask) -> tuple[F32, Mask, Mask]:
    """At half the size; a source there holds nothing else."""
    size = ((rgb.shape[1] + 1) // 2, (rgb.shape[0] + 1) // 2)
    share = cv2.resize(source.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    unknown = cv2.resize(hole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32), share > MOSTLY, unknown > 0


def _doubled(places: np.ndarray, height: int, width: int) -> np.ndarray:
    """Places (h, w, 2) of a picture twice as large."""
    row, column = np.indices((height, width))
    coarse = places[
        np.minimum(row // 2, len(places) - 1), np.minimum(column // 2, places.shape[1] - 1)
    ]
    return 2 * coarse + np.stack([row % 2, column % 2], -1)


@numba.njit(cache=True, nogil=True)
def _correct(picture, places, settled, image, guide, source, hole, offered, choice):
    """Each pixel of the hole copied from the best place found.

    `picture`, `places` and `settled`, which pixels of it say something, change. `offered` are
    numbers of `choice` (n, 2).
    """
    height, width = hole.shape
    for p in range(len(offered)):
        for step in range(height * width):
            at = step if p % 2 == 0 else height * width - 1 - step
            i, j = at // width, at % width
            if not hole[i, j]:
                continue
            best, bi, bj = np.inf, -1, -1
            for n in range(9 + offered.shape[3]):
                if n < 9:  # a neighbour's place, moved along; its own is among them
                    a, b = i + n // 3 - 1, j + n % 3 - 1
                    if a < 0 or b < 0 or a >= height or b >= width or not hole[a, b]:
                        continue
                    si, sj = places[a, b, 0] + i - a, places[a, b, 1] + j - b
                else:
                    si, sj = choice[offered[p, i, j, n - 9]]
                if si < 0 or sj < 0 or si >= height or sj >= width or not source[si, sj]:
                    continue
                if si == bi and sj == bj:
                    continue  # neighbours mostly agree
                apart = 0.0
                for c in range(3):
                    apart += GUIDE * (guide[i, j, c] - guide[si, sj, c]) ** 2
                if apart >= best:
                    continue
                gap = apart + _gap(picture, settled, image, source, i, j, si, sj, best - apart)
                if gap < best:
                    best, bi, bj = gap, si, sj
            if bi >= 0:
                places[i, j, 0], places[i, j, 1] = bi, bj
                settled[i, j] = True
                for c in range(3):
                    picture[i, j, c] = image[bi, bj, c]


@numba.njit(cache=True, nogil=True)
def _gap(picture, settled, image, source, i, j, si, sj, enough):
    """Mean squared difference of two patches, where both are of the object.

    At least that, if it is more than `enough`.
    """
    total, count = 0.0, 0
    height, width = source.shape
    most = enough * (2 * REACH + 1) ** 2
    for di in range(max(-REACH, -i, -si), min(REACH, height - 1 - max(i, si)) + 1):
        for dj in range(max(-REACH, -j, -sj), min(REACH, width - 1 - max(j, sj)) + 1):
            a, b, s, t = i + di, j + dj, si + di, sj + dj
            if not source[s, t] or not settled[a, b]:
                continue
            for c in range(3):
                d = picture[a, b, c] - image[s, t, c]
                total += d * d
            count += 1
        if total > most:
            return np.inf
    return total / count if count > 0 else 0.0
