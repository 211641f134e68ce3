"""Texture for a hole in a picture, quilted of patches of what is known beside it.

After Efros and Freeman, "Image quilting for texture synthesis and transfer" (2001): whole patches,
each of which fits to what is there already, joined along the line where both differ least. What is
quilted is the detail alone; what is coarser is given. So it is lit as its surface is, and a patch
that shows half an eye does not bring an eye along.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, Mask, frozen
from ...base.kernel_files import numba
from ...base.masks import bounds, box_of, widely_blurred

PATCH = 24  # px to a side
OVERLAP = 8  # px, of neighbours
COARSE = 9.0  # px, standard deviation: what is coarser is given
ROUGHLY = 3.0  # px, likewise: a wider blur is one of a smaller picture
STRIDE = 3  # px, between the places that patches are taken from
MOST = 4_000  # such places
ELSEWHERE = 1.0  # weight of squared levels of the coarse colours, beside those of the detail
HIGHER = 1_600.0  # squared levels that a patch costs from the other end of the picture
SPOT, STRANGE = 9, 2.0  # px of what is as small as an eye; x the usual detail, beyond which it is
USED = 0.15  # x the usual detail, that each use of a place nearby costs
ALIKE, CHANCES = 0.1, 64  # x the cost, by which chance decides; different ones
DARK, GAIN = 8.0, (0.5, 1.6)  # levels added to both, and x the detail, of what is lit otherwise
OTHER = 40.0  # levels, by which the coarse colours of something else differ: it lends no detail
NEARBY = 3.0  # px, over which they are compared
FINE, AROUND = 2.0, 6.0  # px, of the contrast, and over which it is gathered
ENOUGH = 0.8  # x the usual contrast, up to which a hole is plain; from twice as much on it is not
# Contrast along the weakest direction over that across it: of stripes at most 0.22, of peel, fur
# and hair at least 0.45.
STRIPED = 0.25, 0.4
NONE = 0.3  # levels of contrast, that are as good as none
COLOURED = 0.5  # x the colour of the detail


def quilted(levels: F32, known: Mask, clear: Mask, hole: Mask, heights: F32, seed: int) -> F32:
    """`levels` (h, w, 3) up to 255, with detail where its `hole` (h, w) is plainer than the rest.

    `known` (h, w) is what is seen, of which what is `clear` (h, w) may be copied, mostly to about
    the same `heights` (h, w), from 0 to 1.
    """
    height, width = hole.shape
    whole = cv2.erode(np.pad(clear, PATCH).astype(np.uint8), np.ones((PATCH, PATCH), np.uint8))
    middle = PATCH // 2
    rows, columns = np.nonzero(whole[middle + PATCH :: STRIDE, middle + PATCH :: STRIDE])
    places = STRIDE * np.column_stack([rows, columns]).astype(np.int32)
    places = places[(places + PATCH <= [height, width]).all(1)]
    if len(places) == 0 or not hole.any():
        return levels
    rng = np.random.default_rng(seed)
    if len(places) > MOST:
        places = places[rng.choice(len(places), MOST, replace=False)]
    plain = _plainness(levels, clear, hole)
    wanted = hole & (plain > 0)
    if not wanted.any():
        return levels
    low = widely_blurred(levels, COARSE, ROUGHLY)
    share = widely_blurred(known.astype(np.float32), COARSE, ROUGHLY)
    own = widely_blurred(levels * known[..., None], COARSE, ROUGHLY)
    own /= np.maximum(share, 1e-3)[..., None]
    detail = np.where(known[..., None], levels - own, np.float32(0))
    colourless = _grey(detail)[..., None]
    detail = (colourless + COLOURED * (detail - colourless)).astype(np.float32)
    order = _order(wanted, known)
    odd, usual = _oddness(detail, places + middle)
    chance = 1 + ALIKE * rng.random((len(order), CHANCES))
    fields = (frozen(field, np.float32) for field in (low, own, heights))
    costs = frozen(odd, np.float64), USED * usual, chance
    taken = _quilt(detail, known & ~hole, frozen(wanted), *fields, frozen(places), order, costs)
    x0, y0, x1, y1 = box_of(wanted, PATCH)
    there = np.s_[y0:y1, x0:x1]
    change = plain[there][..., None] * _fitting(
        levels[there], low[there], taken[there], detail[there], wanted[there]
    )
    made = (levels[there] + change).clip(*bounds(levels, known))
    filled = levels.copy()
    filled[there] = np.where(wanted[there][..., None], made, levels[there])
    return filled


def _fitting(levels: F32, low: F32, taken: F32, detail: F32, wanted: Mask) -> F32:
    """(h, w, 3) how the `detail` changes `levels`, lit as these; little of something else.

    `low` and `taken` are the coarse colours there, and where the detail comes from.
    """
    gain = ((_grey(low) + DARK) / (_grey(taken) + DARK)).clip(*GAIN)
    made_of = wanted.astype(np.float32)
    off = cv2.GaussianBlur((taken - low) * made_of[..., None], (0, 0), NEARBY)
    off /= np.maximum(cv2.GaussianBlur(made_of, (0, 0), NEARBY), 1e-3)[..., None]
    gain *= np.exp(-((3 * _grey(np.asarray(off * off, np.float32)) / OTHER**2) ** 2))
    return low + gain[..., None] * detail - levels


def _grey(colors: F32) -> F32:
    """(h, w) of colours (h, w, 3): their mean."""
    return np.asarray(cv2.transform(colors, np.full((1, 3), 1 / 3)), np.float32)


def _plainness(levels: F32, clear: Mask, hole: Mask) -> F32:
    """(h, w) in [0, 1] how much of the contrast of what is `clear` (h, w) a hole (h, w) lacks.

    Along the direction in which there is least: streaks are plain. What is striped itself lacks
    nothing: its stripes go on, and are no texture. On every second pixel.
    """
    fine = cv2.GaussianBlur(_grey(levels), (0, 0), FINE)[::2, ::2]
    x, y = np.gradient(fine, axis=1), np.gradient(fine, axis=0)
    weak, strong = [], []
    for where in (clear[::2, ::2].astype(np.float32), hole[::2, ::2].astype(np.float32)):
        products = np.dstack([x * x, x * y, y * y, np.ones_like(x)]) * where[..., None]
        xx, xy, yy, total = cv2.split(cv2.GaussianBlur(products, (0, 0), 0.5 * AROUND))
        half, off = 0.5 * (xx + yy), np.sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
        total = np.maximum(total, 1e-3)
        weak.append(np.sqrt(np.maximum(half - off, 0) / total))
        strong.append(np.sqrt((half + off) / total))
    usual, across = (float(np.median(way[0][clear[::2, ::2]])) for way in (weak, strong))
    textured = np.clip((usual / max(across, NONE) - STRIPED[0]) / (STRIPED[1] - STRIPED[0]), 0, 1)
    lack = 2 * ENOUGH * usual - weak[1]
    plain = textured * np.clip(lack / (ENOUGH * usual + NONE), 0, 1)
    return np.asarray(cv2.resize(plain, hole.shape[::-1]), np.float32)


def _order(hole: Mask, known: Mask) -> np.ndarray:
    """(n, 2) rows and columns of the patches that cover the hole, from what is known on."""
    step = PATCH - OVERLAP
    last = np.array(hole.shape) - 1
    ways = (np.minimum(np.arange(0, side, step), max(side - PATCH, 0)) for side in hole.shape)
    corners = np.stack(np.meshgrid(*ways, indexing="ij"), -1).reshape(-1, 2)
    away = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, 5)
    middle = np.minimum(corners + PATCH // 2, last)
    nearest = np.argsort(away[middle[:, 0], middle[:, 1]], kind="stable")
    return np.ascontiguousarray(corners[nearest], np.int32)


def _oddness(detail: F32, middles: np.ndarray) -> tuple[np.ndarray, float]:
    """(n,) squared levels by which patches about places (n, 2) stand out, and what is usual."""
    power = cv2.boxFilter(3 * _grey(detail * detail), -1, (SPOT, SPOT))
    power = cv2.dilate(power, np.ones((PATCH, PATCH), np.uint8))[middles[:, 0], middles[:, 1]]
    usual = max(float(np.median(power)), 1e-3)
    return usual * np.maximum(power / usual / STRANGE - 1, 0), usual


@numba.njit(cache=True, nogil=True)
def _quilt(detail, have, hole, low, own, heights, places, order, costs):
    """Fills `detail` (h, w, 3) in the hole; returns (h, w, 3) the coarse colours it came from.

    `have` (h, w), what there is already, changes. `low` and `own` (h, w, 3) are the coarse colours
    that are wanted and that are known.
    """
    odd, usage, chance = costs
    taken = np.zeros(low.shape, np.float32)
    used = np.zeros(len(places))
    error, keep = np.empty((PATCH, PATCH)), np.empty((PATCH, PATCH), np.bool_)
    for n in range(len(order)):
        i, j = order[n]
        high, wide = min(PATCH, hole.shape[0] - i), min(PATCH, hole.shape[1] - j)
        if not _is_wanted(have, hole, i, j, high, wide):
            continue
        best, chosen = np.inf, 0
        for k in range(len(places)):
            s, t = places[k]
            luck = chance[n, k % CHANCES]
            cost = odd[k] + used[k] * usage
            cost += _apart(hole, low, own, heights, i, j, s, t, high, wide)
            if cost * luck >= best:
                continue
            cost += _misfit(detail, have, i, j, s, t, high, wide, best / luck - cost)
            if cost * luck < best:
                best, chosen = cost * luck, k
        s, t = places[chosen]
        for k in range(len(places)):
            if abs(places[k, 0] - s) < PATCH // 2 and abs(places[k, 1] - t) < PATCH // 2:
                used[k] += 1
        keep[:], error[:] = False, 0.0
        for a in range(high):
            for b in range(wide):
                if have[i + a, j + b]:
                    for c in range(3):
                        error[a, b] += (detail[i + a, j + b, c] - detail[s + a, t + b, c]) ** 2
        for edge in range(4):
            _cut(have, error, keep, i, j, high, wide, edge)
        for a in range(high):
            for b in range(wide):
                y, x = i + a, j + b
                if hole[y, x] and not (have[y, x] and keep[a, b]):
                    detail[y, x] = detail[s + a, t + b]
                    taken[y, x] = own[s + a, t + b]
                    have[y, x] = True
    return taken


@numba.njit(cache=True, nogil=True)
def _is_wanted(have, hole, i, j, high, wide):
    """Whether a patch has anything to fill."""
    for a in range(i, i + high):
        for b in range(j, j + wide):
            if hole[a, b] and not have[a, b]:
                return True
    return False


@numba.njit(cache=True, nogil=True)
def _apart(hole, low, own, heights, i, j, s, t, high, wide):
    """Squared levels by which the coarse colours at (s, t) are not those wanted at (i, j)."""
    total, count = 0.0, 0
    for a in range(PATCH // 6, high, PATCH // 3):
        for b in range(PATCH // 6, wide, PATCH // 3):
            if hole[i + a, j + b]:
                count += 1
                for c in range(3):
                    total += (low[i + a, j + b, c] - own[s + a, t + b, c]) ** 2
    a, b = min(PATCH // 2, high - 1), min(PATCH // 2, wide - 1)
    higher = heights[i + a, j + b] - heights[s + a, t + b]
    return ELSEWHERE * total / max(count, 1) + HIGHER * higher * higher


@numba.njit(cache=True, nogil=True)
def _misfit(detail, have, i, j, s, t, high, wide, enough):
    """Mean squared levels by which a patch from (s, t) differs from what there is at (i, j).

    Infinite, where it is more than `enough`.
    """
    total, count = 0.0, 0
    most = 0.25 * enough * PATCH * PATCH  # of every second row and column
    for a in range(0, high, 2):
        for b in range(0, wide, 2):
            if have[i + a, j + b]:
                count += 1
                for c in range(3):
                    total += (detail[i + a, j + b, c] - detail[s + a, t + b, c]) ** 2
        if total > most:
            return np.inf
    return total / max(count, 1)


@numba.njit(cache=True, nogil=True)
def _cut(have, error, keep, i, j, high, wide, edge):
    """Marks in `keep` what there is already beside one of four edges, up to the best line.

    `error` (PATCH, PATCH) is what the line costs.
    """
    long, deep = (high, min(OVERLAP, wide)) if edge < 2 else (wide, min(OVERLAP, high))
    there = 0
    for p in range(long):
        for q in range(deep):
            a, b = _at(edge, p, q, high, wide)
            there += have[i + a, j + b]
    if 2 * there < long * deep:
        return
    total, before = np.empty((long, deep)), np.zeros((long, deep), np.int64)
    for p in range(long):
        for q in range(deep):
            a, b = _at(edge, p, q, high, wide)
            total[p, q] = error[a, b]
            if p > 0:
                first = max(q - 1, 0)
                before[p, q] = first + np.argmin(total[p - 1, first : q + 2])
                total[p, q] += total[p - 1, before[p, q]]
    q = np.argmin(total[long - 1])
    for p in range(long - 1, -1, -1):
        for r in range(q):
            a, b = _at(edge, p, r, high, wide)
            keep[a, b] = True
        q = before[p, q]


@numba.njit(cache=True, nogil=True)
def _at(edge, p, q, high, wide):
    """Row and column of what is `p` along one of four edges and `q` in from it."""
    if edge == 0:
        return p, q
    if edge == 1:
        return p, wide - 1 - q
    if edge == 2:
        return q, p
    return high - 1 - q, p
