"""Nearest patches and their votes: the two steps of filling a hole by example.

Every patch that touches the hole looks for the most alike among the known ones (PatchMatch,
Barnes et al. 2009); then every pixel of the hole takes the mean of what the patches over it say
(Wexler et al. 2007, "Space-Time Completion of Video"), and so on.

Sources are pixels of layers: the picture and changed copies of it, such as its mirror image, all
of one size. Patches are (size, size) with an odd size; arrays that hold them have a rim of half a
patch around the picture, so that pixel (i, j) is the middle of [i : i + size, j : j + size].
Guidance, (h, w, 3 + K) wanted and (L, h, w, 4) offered: the number of the line that a pixel lies
beside or 0, how far beside it in px, a bit for each hint that holds there, and what a source from
each of K regions costs, or the number of the region that it is of.
"""

from __future__ import annotations

import numpy as np

from ...base.kernel_files import numba

NEVER = np.float32(1e12)  # penalty of a source that must not be taken
LINE_COST = 80.0  # squared levels of 255 per squared px beside where the line says
MOST_BESIDE = 4.0  # px: farther is no worse
HINT_COST = 20_000.0  # squared levels of 255, for a source that a hint does not offer


@numba.njit(cache=True, nogil=True, fastmath=True, inline="always")
def patch_cost(target, weight, layers, place, source, size, limit):
    """Weighted sum of squares of the patches at `place` and `source`; stops beyond `limit`.

    `target` and `weight` are (h, w * C), `layers` (L, h, w * C), all float32 with their rim: the
    channels of a row of a patch lie in one piece, which is added up several numbers at a time.
    `place` is a row, a column and C.
    """
    total = np.float32(0.0)
    row, column, channels = place
    layer, i, j = source
    # Unsigned: numba asks of every other index whether it counts from the end.
    layer, row, i = np.uintp(layer), np.uintp(row), np.uintp(i)
    here, there = np.uintp(column * channels), np.uintp(j * channels)
    for a in range(np.uintp(size)):
        for b in range(np.uintp(size * channels)):
            gap = target[row + a, here + b] - layers[layer, i + a, there + b]
            total += weight[row + a, here + b] * gap * gap
        if total >= limit:
            break
    return total


@numba.njit(fastmath=True, inline="always")
def _penalty(wanted, row, column, offered, barred, source):
    """What a source costs at a place, whatever it looks like, per unit of a patch's weight."""
    k, i, j = source
    penalty = barred[k, i, j]
    if wanted[row, column, 0] > 0:
        gap = MOST_BESIDE
        if offered[k, i, j, 0] == wanted[row, column, 0]:
            gap = min(abs(offered[k, i, j, 1] - wanted[row, column, 1]), MOST_BESIDE)
        penalty += LINE_COST * gap * gap
    hints = np.int64(wanted[row, column, 2])
    if wanted[row, column, 2] > 0 and (hints & np.int64(offered[k, i, j, 2])) == 0:
        penalty += HINT_COST
    if wanted.shape[2] > 3:  # there are regions
        penalty += wanted[row, column, 3 + np.int64(offered[k, i, j, 3])]
    return np.float32(penalty)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _begin(pictures, wanted, offered, barred, targets, sources, costs):
    """Fills `costs` at the targets with what their sources cost; (T,) the weights of the patches.

    Also the size of a patch and the number of channels.
    """
    target, weight, layers = pictures
    height, width = costs.shape
    size = target.shape[0] - height + 1
    channels = target.shape[1] // (width + size - 1)
    weights = np.empty(len(targets), np.float32)
    for n in range(len(targets)):
        row, column = targets[n]
        first, end = column * channels, (column + size) * channels
        weights[n] = weight[row : row + size, first:end:channels].sum()
        source = (sources[row, column, 0], sources[row, column, 1], sources[row, column, 2])
        costs[row, column] = weights[n] * _penalty(wanted, row, column, offered, barred, source)
        place = (row, column, channels)
        costs[row, column] += patch_cost(target, weight, layers, place, source, size, NEVER)
    return weights, size, channels


@numba.njit(cache=True, nogil=True, fastmath=True)
def search(pictures, wanted, offered, barred, targets, sources, costs, rounds, random):
    """PatchMatch rounds over the `targets` (T, 2): neighbours' sources, then random places.

    `pictures` are target, weight and layers of `patch_cost`. `sources` (h, w, 3) is each place's
    layer, row and column (-1: none), `costs` (h, w) its cost per unit of weight: both are changed
    in place. `barred` (L, h, w) is the penalty of each source, NEVER where it must not be taken.
    """
    target, weight, layers = pictures
    height, width = costs.shape
    weights, size, channels = _begin(pictures, wanted, offered, barred, targets, sources, costs)
    for turn in range(rounds):
        step = 1 if turn % 2 == 0 else -1
        for m in range(len(targets)):
            n = m if step > 0 else len(targets) - 1 - m
            row, column = targets[n]
            best = costs[row, column]
            reach, attempt = max(height, width), 0
            while attempt < 3 or reach >= 1:
                k, i, j = sources[row, column, 0], sources[row, column, 1], sources[row, column, 2]
                if attempt == 0:
                    k = int(random.random() * layers.shape[0])
                    i, j = int(random.random() * height), int(random.random() * width)
                elif attempt < 3:  # what the place before, in the row and in the column, found
                    v, u = (row - step, column) if attempt == 1 else (row, column - step)
                    if 0 <= v < height and 0 <= u < width and sources[v, u, 0] >= 0:
                        k = sources[v, u, 0]
                        i, j = sources[v, u, 1] + row - v, sources[v, u, 2] + column - u
                else:
                    i += np.int64((2 * random.random() - 1) * reach)
                    j += np.int64((2 * random.random() - 1) * reach)
                    reach //= 2
                attempt += 1
                if not (0 <= i < height and 0 <= j < width):
                    continue
                if (
                    k == sources[row, column, 0]
                    and i == sources[row, column, 1]
                    and j == sources[row, column, 2]
                ):
                    continue  # near the end most of what neighbours say is what it has
                source = (k, i, j)
                cost = weights[n] * _penalty(wanted, row, column, offered, barred, source)
                if cost >= best:
                    continue
                place = (row, column, channels)
                cost += patch_cost(target, weight, layers, place, source, size, best - cost)
                if cost < best:
                    best = cost
                    sources[row, column, 0] = k
                    sources[row, column, 1] = i
                    sources[row, column, 2] = j
            costs[row, column] = best
    for n in range(len(targets)):
        costs[targets[n, 0], targets[n, 1]] /= max(weights[n], np.float32(1e-6))


@numba.njit(cache=True, nogil=True, fastmath=True)
def vote(layers, sources, shares, hole, voted, first, last):
    """Set each pixel of the `hole` (h, w) to the mean of the patches over it, in rows first..last.

    `voted` (h, w, C) is changed in place; the patch at (i, j) weighs `shares` (h, w).
    """
    height, width = hole.shape
    size = layers.shape[1] - height + 1
    radius = size // 2
    mean = np.empty(voted.shape[2], np.float32)
    for row in range(first, last):
        for column in range(width):
            if not hole[row, column]:
                continue
            mean[:] = 0
            total = np.float32(0.0)
            for a in range(size):
                for b in range(size):
                    i, j = row + radius - a, column + radius - b
                    if not (0 <= i < height and 0 <= j < width) or sources[i, j, 0] < 0:
                        continue
                    total += shares[i, j]
                    k, v, u = sources[i, j, 0], sources[i, j, 1] + a, sources[i, j, 2] + b
                    for c in range(len(mean)):
                        mean[c] += shares[i, j] * layers[k, v, u, c]
            if total > 0:
                for c in range(len(mean)):
                    voted[row, column, c] = mean[c] / total
