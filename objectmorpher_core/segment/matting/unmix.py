"""The colours of object and background in pixels that show both.

alpha F + (1 - alpha) B is the photo in every such pixel, and F and B are as smooth as that allows,
the more so where alpha changes: found from coarse to fine (after Germer et al. 2020, Fast
Multi-Level Foreground Estimation), at the finer sizes in mixed pixels only. Where the object is
opaque F is the photo; beyond the object its colours go on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, I32, Pixels
from ...base.kernel_files import numba
from ...base.threads import in_threads
from .halving import doubled, halved, halved_pixels, unit

SMOOTHNESS = 1e-5  # weight of equal colours in neighbours
AT_EDGES = 0.1  # x the step of alpha between them: added to it
ANCHOR = 0.01  # weight of a pixel that is nothing but object, or nothing but background
SMALL = 64  # px: up to this size colours still have far to go
ROUNDS = (12, 3)  # small sizes, others
TILE = 256  # px, even
BLOCK = 16  # px: F is like something that is seen in a block or in those around it, ...
BEYOND = np.float32(0.05)  # ... within so much, sRGB
AROUND = 6  # px, even: no fewer than the rounds, so that tiles leave no trace

Window = tuple[slice, slice]


@dataclass(frozen=True, eq=False)
class Unmixed:
    """The two colours of a crop (h, w)."""

    foreground: F32  # (h, w, 3) the object's, everywhere
    rows: I32  # (N,) of the mixed pixels
    columns: I32  # (N,)
    background: F32  # (N, 3) what is seen through the object there


def unmixed(pixels: Pixels, alpha: F32) -> Unmixed:
    """Unmix a photo's crop (h, w, 3) in which the object covers `alpha` (h, w)."""
    half = _half_colours(_Size(halved_pixels(pixels), halved(alpha)))
    least, most = _extremes(pixels)
    foreground = np.empty((*alpha.shape, 3), np.float32)
    mixed: dict[int, tuple[np.ndarray, np.ndarray, F32]] = {}

    def finish(k: int, window: Window) -> None:
        rgb, own, behind = _tile(pixels, alpha, half, window)
        if behind is not None:
            share = alpha[window]
            rows, columns = places = np.nonzero((share > 0) & (share < 1))
            block = tuple((p + s.start) // BLOCK for p, s in zip(places, window, strict=True))
            limits = least[block], most[block]
            own[places], seen = exact(
                rgb[places], share[places], own[places], behind[places], limits
            )
            mixed[k] = rows + window[0].start, columns + window[1].start, seen
        foreground[window] = own

    _in_tiles(alpha.shape, finish)
    nowhere = np.empty(0, np.int32)
    parts = [(nowhere, nowhere, np.empty((0, 3), np.float32)), *(mixed[k] for k in sorted(mixed))]
    rows, columns, behind = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Unmixed(foreground, rows.astype(np.int32), columns.astype(np.int32), behind)


def _extremes(pixels: Pixels) -> tuple[F32, F32]:
    """(h / BLOCK, w / BLOCK, 3) least and most of a photo's crop about each block of it, in [0, 1].

    A colour beyond is in nothing that is seen there.
    """
    rows, columns = (range(0, n, BLOCK) for n in pixels.shape[:2])
    parts = (np.minimum, np.maximum), (cv2.erode, cv2.dilate)
    around, found = np.ones((3, 3), np.uint8), []
    for reduce, spread in zip(*parts, strict=True):
        blocks = reduce.reduceat(reduce.reduceat(pixels, rows, axis=0), columns, axis=1)
        found.append(unit(np.ascontiguousarray(spread(blocks, around))))
    least, most = found
    return np.maximum(least - BEYOND, 0), np.minimum(most + BEYOND, 1)


def _half_colours(size: _Size) -> tuple[F32, F32]:
    """F (h, w, 3) of the crop at half its size, and B near its mixed pixels."""
    smaller = _coarse(size.half())
    fore, back = np.empty_like(size.rgb), np.zeros_like(size.rgb)

    def keep(_k: int, window: Window) -> None:
        _rgb, own, behind = _tile(size.rgb, size.alpha, smaller, window)
        fore[window] = own
        if behind is not None:
            back[window] = behind

    _in_tiles(size.alpha.shape, keep)
    return fore, back


def _in_tiles(shape: tuple[int, ...], finish: Callable[[int, Window], None]) -> None:
    """`finish`(number, window) for all tiles of a picture (h, w)."""
    corners = [(y, x) for y in range(0, shape[0], TILE) for x in range(0, shape[1], TILE)]

    def run(first: int, last: int) -> None:
        for k in range(first, last):
            y, x = corners[k]
            rows, columns = slice(y, min(y + TILE, shape[0])), slice(x, min(x + TILE, shape[1]))
            finish(k, (rows, columns))

    in_threads(run, len(corners), parts=4)


@dataclass(frozen=True, eq=False)
class _Size:
    """A crop at one of its smaller sizes."""

    rgb: F32  # (h, w, 3)
    alpha: F32  # (h, w)
    # (h, w, 8) how much of a pixel is nothing but object, but background, and times the colour of
    # that. None: all of it, or nothing, as alpha says.
    sure: F32 | None = None

    def half(self) -> _Size:
        rgb, alpha = halved(self.rgb), halved(self.alpha)
        if self.sure is not None:
            return _Size(rgb, alpha, halved(self.sure))
        sure = np.zeros((*alpha.shape, 8), np.float32)
        _halve_sure(self.rgb, self.alpha, sure)
        return _Size(rgb, alpha, sure)


def coarse_colours(rgb: F32, alpha: F32) -> tuple[F32, F32]:
    """F and B (h, w, 3) of a small picture (h, w, 3) from all of its sizes."""
    return _coarse(_Size(np.ascontiguousarray(rgb), np.ascontiguousarray(alpha)))


def _coarse(size: _Size) -> tuple[F32, F32]:
    sizes = [size]
    while sizes[-1].sure is None or max(sizes[-1].alpha.shape) > 1:
        sizes.append(sizes[-1].half())
    least = sizes[-1]
    assert least.sure is not None
    one, other, colours = least.sure[..., :1], least.sure[..., 1:2], least.sure[..., 2:]
    fore, back = (
        np.where(sure > 0, colour / np.maximum(sure, 1e-12), least.rgb)
        for sure, colour in ((one, colours[..., :3]), (other, colours[..., 3:]))
    )
    while sizes:
        size = sizes.pop()
        fore, back = (np.ascontiguousarray(doubled(c, size.alpha.shape)) for c in (fore, back))
        _relaxed(size, fore, back, _rounds(size.alpha.shape))
    return fore, back


def _rounds(shape: tuple[int, ...]) -> int:
    return ROUNDS[0] if max(shape) <= SMALL else ROUNDS[1]


def _tile(
    pixels: np.ndarray, alpha: F32, half: tuple[F32, F32], window: Window
) -> tuple[F32, F32, F32 | None]:
    """The photo, F and B (h, w, 3) of one tile, from F and B of `half` the size.

    B is None where nothing is mixed.
    """
    ends = [(max(s.start - AROUND, 0), min(s.stop + AROUND, n))
            for s, n in zip(window, alpha.shape, strict=True)]  # fmt: skip
    around = (slice(*ends[0]), slice(*ends[1]))
    inner = tuple(slice(s.start - a.start, s.stop - a.start)
                  for s, a in zip(window, around, strict=True))  # fmt: skip
    share = alpha[around]
    least, most = float(share.min()), float(share.max())
    if least == 1:
        rgb = unit(pixels[window])
        return rgb, rgb, None
    own = _enlarged(half[0], ends)
    if most == 0:
        return own[inner], own[inner], None
    size = _Size(np.ascontiguousarray(unit(pixels[around])), np.ascontiguousarray(share))
    behind = _enlarged(half[1], ends)
    is_mixed = _relaxed(size, own, behind, _rounds(alpha.shape))
    return size.rgb[inner], own[inner], behind[inner] if is_mixed else None


def _enlarged(small: F32, ends: list[tuple[int, int]]) -> F32:
    """The part `ends` (first, last px in y and x) of an image at twice the size of `small`."""
    (y0, y1), (x0, x1) = ends
    top, left = max(y0 // 2 - 1, 0), max(x0 // 2 - 1, 0)
    part = small[top : (y1 + 1) // 2 + 1, left : (x1 + 1) // 2 + 1]
    large = doubled(part, (y1 - 2 * top, x1 - 2 * left))
    return np.ascontiguousarray(large[y0 - 2 * top :, x0 - 2 * left :])


def _relaxed(size: _Size, fore: F32, back: F32, rounds: int) -> bool:
    """Brings F and B (h, w, 3) nearer to what a picture (h, w, 3) of this size says, in place.

    False where nothing is mixed.
    """
    places = _settle(size.rgb, size.alpha, fore, back)
    if len(places[0]) == 0:
        return False
    sure = np.empty((0, 0, 8), np.float32) if size.sure is None else size.sure
    _relax(size.rgb, size.alpha, places, _weighed(size.rgb, size.alpha, places, sure),
           (fore, back), rounds)  # fmt: skip
    return True


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _halve_sure(rgb: F32, alpha: F32, sure: F32) -> None:
    """`sure` (h, w, 8) at half the size of a picture."""
    height, width = alpha.shape
    for y in range(len(sure)):
        for x in range(sure.shape[1]):
            for k in range(4):
                i, j = min(2 * y + k // 2, height - 1), min(2 * x + k % 2, width - 1)
                if alpha[i, j] != 0 and alpha[i, j] != 1:
                    continue
                side = 0 if alpha[i, j] == 1 else 1
                sure[y, x, side] += np.float32(0.25)
                for c in range(3):
                    sure[y, x, 2 + 3 * side + c] += np.float32(0.25) * rgb[i, j, c]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _settle(rgb: F32, alpha: F32, fore: F32, back: F32) -> tuple[I32, I32]:
    """Sets F where there is nothing but object, and B likewise; rows, columns of all the rest.

    Those are the mixed pixels and what is beside them.
    """
    height, width = alpha.shape
    beside = np.zeros((height, width), np.bool_)
    count = 0
    for y in range(height):
        for x in range(width):
            if alpha[y, x] == 1:
                for c in range(3):
                    fore[y, x, c] = rgb[y, x, c]
            elif alpha[y, x] == 0:
                for c in range(3):
                    back[y, x, c] = rgb[y, x, c]
            else:
                for i in range(max(y - 1, 0), min(y + 2, height)):
                    for j in range(max(x - 1, 0), min(x + 2, width)):
                        count += not beside[i, j]
                        beside[i, j] = True
    rows, columns = np.empty(count, np.int32), np.empty(count, np.int32)
    n = 0
    for y in range(height if count else 0):
        for x in range(width):
            if beside[y, x]:
                rows[n], columns[n] = y, x
                n += 1
    return rows, columns


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _weighed(rgb: F32, alpha: F32, places: tuple[I32, I32], sure: F32) -> F32:
    """(N, 13) what does not change from round to round, of places (N,).

    Weights of the neighbours below, above, right and left; one over the sums of what F and B
    follow; one over what an error is shared by; and what holds F and B, times its weight. An
    empty `sure` says what alpha says.
    """
    (rows, columns), (height, width) = places, alpha.shape
    table = np.zeros((len(rows), 13), np.float32)
    for n in range(len(rows)):
        y, x = rows[n], columns[n]
        a, row = alpha[y, x], table[n]
        total = 0.0
        for k in range(4):
            i, j = y + (k == 0) - (k == 1), x + (k == 2) - (k == 3)
            if i >= 0 and j >= 0 and i < height and j < width:
                row[k] = SMOOTHNESS + AT_EDGES * abs(a - alpha[i, j])
                total += row[k]
        held = (1.0 if a == 1 else 0.0, 1.0 if a == 0 else 0.0)
        if sure.size > 0:
            held = (float(sure[y, x, 0]), float(sure[y, x, 1]))
        for side in range(2):
            row[4 + side] = 1 / max(total + ANCHOR * held[side], 1e-12)
            for c in range(3):
                own = sure[y, x, 2 + 3 * side + c] if sure.size > 0 else held[side] * rgb[y, x, c]
                row[7 + 3 * side + c] = ANCHOR * own
        row[6] = 1 / (1 + a * a * row[4] + (1 - a) * (1 - a) * row[5])
    return table


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _relax(
    rgb: F32, alpha: F32, places: tuple[I32, I32], table: F32, colours: tuple[F32, F32], rounds: int
) -> None:  # fmt: skip
    """`rounds` Jacobi steps at rows, columns (N,): the same in whichever order they are."""
    (rows, columns), (fore, back) = places, colours
    height, width = alpha.shape
    new = np.empty((len(rows), 6), np.float32)
    zero, one = np.float32(0), np.float32(1)
    for _ in range(rounds):
        for n in range(len(rows)):
            y, x, row = rows[n], columns[n], table[n]
            a = alpha[y, x]
            b = one - a
            below, above = min(y + 1, height - 1), max(y - 1, 0)
            right, left = min(x + 1, width - 1), max(x - 1, 0)
            for c in range(3):
                own = (row[0] * fore[below, x, c] + row[1] * fore[above, x, c]
                       + row[2] * fore[y, right, c] + row[3] * fore[y, left, c]
                       + row[7 + c]) * row[4]  # fmt: skip
                behind = (row[0] * back[below, x, c] + row[1] * back[above, x, c]
                          + row[2] * back[y, right, c] + row[3] * back[y, left, c]
                          + row[10 + c]) * row[5]  # fmt: skip
                colour = rgb[y, x, c]
                rest = (colour - a * own - b * behind) * row[6]
                own += a * row[4] * rest
                behind += b * row[5] * rest
                new[n, c] = colour if a == one else min(max(own, zero), one)
                new[n, c + 3] = colour if b == one else min(max(behind, zero), one)
        for n in range(len(rows)):
            for c in range(3):
                fore[rows[n], columns[n], c] = new[n, c]
                back[rows[n], columns[n], c] = new[n, c + 3]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def exact(rgb: F32, alpha: F32, fore: F32, back: F32, limits: tuple[F32, F32]) -> tuple[F32, F32]:
    """F and B (N, 3) in [0, 1], as near as can be to those given, that mix to `rgb` (N, 3).

    F is within the least and the most (N, 3) of its `limits`, unless B in [0, 1] cannot make up
    for that.
    """
    least, most = limits
    one, other = np.empty(rgb.shape, np.float32), np.empty(rgb.shape, np.float32)
    for n in range(len(rgb)):
        a = float(alpha[n])
        b = 1 - a
        share = 1 / (a * a + b * b)
        for c in range(3):
            rest = (rgb[n, c] - a * fore[n, c] - b * back[n, c]) * share
            own = min(max(fore[n, c] + a * rest, least[n, c]), most[n, c])
            behind = min(max((rgb[n, c] - a * own) / b, 0.0), 1.0)
            # Where B came to its limit F gives way, and finds room.
            one[n, c] = min(max((rgb[n, c] - b * behind) / a, 0.0), 1.0)
            other[n, c] = behind
    return one, other
