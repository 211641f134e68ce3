"""Closed-form matting (Levin, Lischinski & Weiss 2008) on the unknown pixels of a picture.

Within a window of 3 x 3 pixels alpha is assumed to be an affine function of colour; summed over
all windows that leaves one sparse linear system, 25 entries a row, for the unknown pixels alone.
Own code because only windows that touch such a pixel are needed, and because alpha is nearly known
from the picture at half the size: a few rounds of conjugate gradients are then enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, I32, Mask
from ...base.kernel_files import numba

SMOOTHNESS = 1e-5  # colour variance (of sRGB in [0, 1]) below which a window says nothing
TOLERANCE = 3e-4  # of the residual's length, over the right-hand side's
WIDTH = 5  # px: how far two pixels of one window are apart at most, and back


@dataclass(frozen=True, eq=False)
class Expected:
    """The expected alpha before the picture is looked at."""

    alpha: F32  # (h, w) where a pixel is known, this is its alpha
    weight: F32  # (h, w) how much that counts for an unknown pixel: 1 is about as much as colour


def solve_alpha(rgb: F32, unknown: Mask, expected: Expected, start: F32, rounds: int) -> F32:
    """Alpha (h, w) in [0, 1] of a picture (h, w, 3); what is not `unknown` is as expected.

    `start` (h, w) is a first guess, `rounds` the most steps that are taken from it.
    """
    alpha = expected.alpha.copy()
    place = np.flatnonzero(unknown)
    if len(place) == 0:
        return alpha
    index = np.full(unknown.shape, -1, np.int32)
    index.ravel()[place] = np.arange(len(place), dtype=np.int32)
    matrix = np.zeros((len(place), WIDTH * WIDTH), np.float32)
    _add_windows(np.ascontiguousarray(rgb, np.float32), index, matrix, SMOOTHNESS)
    weight = expected.weight.ravel()[place]
    right = weight * alpha.ravel()[place]
    neighbours = np.empty(matrix.shape, np.int32)
    _take_known(index, alpha, matrix, right, neighbours)
    matrix[:, matrix.shape[1] // 2] += weight
    solved = start.ravel()[place].astype(np.float32)
    _conjugate_gradients(matrix, neighbours, right, solved, rounds)
    alpha.ravel()[place] = np.clip(solved, 0, 1)
    return alpha


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _add_windows(rgb: F32, index: I32, matrix: F32, smoothness: float) -> None:
    """Adds to each unknown pixel's row what the windows around it say; `matrix` (N, 25).

    Entry 5 (dy + 2) + dx + 2 of a row belongs to the pixel dy, dx away.
    """
    height, width = index.shape
    colours, whitened = np.empty((9, 3), np.float32), np.empty((9, 3), np.float32)
    rows = np.empty(9, np.int32)
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            last = -1
            for k in range(9):
                rows[k] = index[y + k // 3 - 1, x + k % 3 - 1]
                last = max(last, rows[k])
            if last < 0:
                continue
            _whiten(rgb, y, x, smoothness / 9, colours, whitened)
            for k in range(9):
                one = rows[k]
                if one >= 0:
                    matrix[one, 12] += np.float32(1)
                for n in range(k, 9):
                    other = rows[n]
                    if one < 0 and other < 0:
                        continue
                    affinity = np.float32(1)
                    for c in range(3):
                        affinity += whitened[k, c] * colours[n, c]
                    affinity *= np.float32(1 / 9)
                    entry = (n // 3 - k // 3 + 2) * 5 + n % 3 - k % 3 + 2
                    if one >= 0:
                        matrix[one, entry] -= affinity
                    if other >= 0 and n != k:
                        matrix[other, 24 - entry] -= affinity


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _whiten(rgb: F32, y: int, x: int, ridge: float, colours: F32, whitened: F32) -> None:
    """The window around y, x: `colours` (9, 3) centred, and times their inverse covariance."""
    for c in range(3):
        mean = np.float32(0)
        for k in range(9):
            mean += rgb[y + k // 3 - 1, x + k % 3 - 1, c]
        mean *= np.float32(1 / 9)
        for k in range(9):
            colours[k, c] = rgb[y + k // 3 - 1, x + k % 3 - 1, c] - mean
    a = b = c = d = e = f = 0.0
    for k in range(9):
        red, green, blue = colours[k]
        a += red * red
        b += red * green
        c += red * blue
        d += green * green
        e += green * blue
        f += blue * blue
    a, b, c = a / 9 + ridge, b / 9, c / 9
    d, e, f = d / 9 + ridge, e / 9, f / 9 + ridge
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1 / (a * aa + b * bb + c * cc)
    for k in range(9):
        red, green, blue = colours[k]
        whitened[k, 0] = scale * (aa * red + bb * green + cc * blue)
        whitened[k, 1] = scale * (bb * red + dd * green + ee * blue)
        whitened[k, 2] = scale * (cc * red + ee * green + ff * blue)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _take_known(index: I32, alpha: F32, matrix: F32, right: F32, neighbours: I32) -> None:
    """Moves what known pixels say to the right-hand side; `neighbours` (N, 25) are rows."""
    height, width = index.shape
    for y in range(height):
        for x in range(width):
            row = index[y, x]
            if row < 0:
                continue
            for entry in range(25):
                i, j = y + entry // 5 - 2, x + entry % 5 - 2
                neighbours[row, entry] = row  # of a pixel that is known, or beyond the picture
                if i < 0 or j < 0 or i >= height or j >= width:
                    matrix[row, entry] = 0
                elif index[i, j] >= 0:
                    neighbours[row, entry] = index[i, j]
                else:
                    right[row] -= matrix[row, entry] * alpha[i, j]
                    matrix[row, entry] = 0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _conjugate_gradients(
    matrix: F32, neighbours: I32, right: F32, x: F32, rounds: int
) -> None:  # fmt: skip
    """Improves `x` (N,), preconditioned with the diagonal, until it hardly changes any more."""
    count = len(x)
    residual, step, along = np.empty_like(x), np.zeros_like(x), np.empty_like(x)
    before, enough = 1.0, 0.0
    _times(matrix, neighbours, x, along)
    for i in range(count):
        residual[i] = right[i] - along[i]
        enough += float(right[i]) ** 2
    enough *= TOLERANCE**2
    for turn in range(rounds):
        length = now = 0.0
        for i in range(count):
            length += float(residual[i]) ** 2
            now += float(residual[i]) ** 2 / matrix[i, 12]
        if length <= enough or now == 0.0:
            return
        keep = np.float32(now / before) if turn else np.float32(0)
        for i in range(count):
            step[i] = residual[i] / matrix[i, 12] + keep * step[i]
        _times(matrix, neighbours, step, along)
        slope = 0.0
        for i in range(count):
            slope += float(step[i]) * float(along[i])
        if slope <= 0.0:  # rounding: nothing to be gained any more
            return
        go = np.float32(now / slope)
        for i in range(count):
            x[i] += go * step[i]
            residual[i] -= go * along[i]
        before = now


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _times(matrix: F32, neighbours: I32, x: F32, product: F32) -> None:
    for row in range(len(x)):
        total = np.float32(0)
        for entry in range(25):
            total += matrix[row, entry] * x[neighbours[row, entry]]
        product[row] = total


def affine(rgb: F32, alpha: F32) -> F32:
    """(h, w, 4) alpha as a function of colour: what its windows' affine functions are on average.

    It holds for the same picture at twice the size, too, where it brings out what is too fine
    for this one: see `applied`.
    """
    around = [np.pad(image, ((2, 2), (2, 2)) + ((0, 0),) * (image.ndim - 2), mode="edge")
              for image in (rgb, alpha)]  # fmt: skip
    functions = np.zeros((alpha.shape[0] + 2, alpha.shape[1] + 2, 4), np.float32)
    _fit_windows(around[0], around[1], SMOOTHNESS, functions)
    return np.asarray(cv2.blur(functions, (3, 3))[1:-1, 1:-1], np.float32)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _fit_windows(rgb: F32, alpha: F32, smoothness: float, functions: F32) -> None:
    """`functions` (h, w, 4) of the windows of a picture (h + 2, w + 2, 3) and its alpha."""
    height, width = alpha.shape
    colours, whitened = np.empty((9, 3), np.float32), np.empty((9, 3), np.float32)
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            total, spread = np.float32(0), False
            for k in range(9):
                own = alpha[y + k // 3 - 1, x + k % 3 - 1]
                spread |= own != alpha[y, x]
                total += own
            fit = functions[y - 1, x - 1]
            fit[3] = total / np.float32(9)
            if spread:
                _whiten(rgb, y, x, smoothness / 9, colours, whitened)
                for k in range(9):
                    for c in range(3):
                        fit[c] += whitened[k, c] * alpha[y + k // 3 - 1, x + k % 3 - 1]
                for c in range(3):
                    fit[c] /= np.float32(9)
                    fit[3] -= fit[c] * (rgb[y, x, c] - colours[4, c])


def applied(functions: F32, rgb: F32, where: Mask, alpha: F32) -> F32:
    """`alpha` (h, w), and `where` (h, w) what `functions` of half the size make of a picture."""
    changed = alpha.copy()
    _apply(np.ascontiguousarray(functions), np.ascontiguousarray(rgb), where, changed)
    return changed


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _apply(functions: F32, rgb: F32, where: Mask, alpha: F32) -> None:
    height, width = functions.shape[:2]
    near, far = np.float32(0.75), np.float32(0.25)
    for y in range(alpha.shape[0]):
        i = min(y // 2, height - 1)
        other = min(max(i + 2 * (y % 2) - 1, 0), height - 1)
        for x in range(alpha.shape[1]):
            if not where[y, x]:
                continue
            j = min(x // 2, width - 1)
            beside = min(max(j + 2 * (x % 2) - 1, 0), width - 1)
            total = np.float32(0)
            for c in range(4):
                upper = near * functions[i, j, c] + far * functions[i, beside, c]
                lower = near * functions[other, j, c] + far * functions[other, beside, c]
                value = near * upper + far * lower
                total += value * rgb[y, x, c] if c < 3 else value
            alpha[y, x] = min(max(total, np.float32(0)), np.float32(1))
