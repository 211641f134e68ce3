"""The colours of object and background in pixels that show both.

alpha F + (1 - alpha) B is the photo in every such pixel, and F and B are as smooth as that allows,
the more so where alpha changes: found from coarse to fine (after Germer et al. 2020, Fast
Multi-Level Foreground Estimation), at the finer sizes in mixed pixels only. Where the object is
opaque F is the photo; beyond the object its colours go on.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np

from ..arrays import F32, I32, Mask, Pixels
from ..pixels import unit_pixels
from ..threads import in_threads
from .halving import doubled, halved, halved_pixels

SMOOTHNESS = 1e-5  # weight of equal colours in neighbours
AT_EDGES = 0.1  # x the step of alpha between them: added to it
ANCHOR = 0.01  # weight of a pixel that is nothing but object, or nothing but background
SMALL = 64  # px: up to this size colours still have far to go
ROUNDS = (12, 3)  # small sizes, others
TILE = 256  # px, even
AROUND = 6  # px, even: no fewer than the rounds, so that tiles leave no trace


@dataclass(frozen=True, eq=False)
class Unmixed:
    """The two colours of a crop (h, w)."""

    foreground: F32  # (h, w, 3) the object's, everywhere
    rows: I32  # (N,) of the mixed pixels
    columns: I32  # (N,)
    background: F32  # (N, 3) what is seen through the object there


def unmixed(pixels: Pixels, alpha: F32) -> Unmixed:
    """Of a photo's crop (h, w, 3) in which the object covers `alpha` (h, w)."""
    shape = alpha.shape
    fore, back = coarse_colours(halved_pixels(pixels), halved(alpha))
    foreground = np.empty((*shape, 3), np.float32)
    corners = [(y, x) for y in range(0, shape[0], TILE) for x in range(0, shape[1], TILE)]
    mixed: dict[int, tuple[np.ndarray, np.ndarray, F32]] = {}

    def finish(first: int, last: int) -> None:
        for k in range(first, last):
            y, x = corners[k]
            window = (slice(y, min(y + TILE, shape[0])), slice(x, min(x + TILE, shape[1])))
            own, where, behind = _tile(pixels, alpha, fore, back, window)
            foreground[window] = own
            rows, columns = np.nonzero(where)
            mixed[k] = rows + y, columns + x, behind

    in_threads(finish, len(corners), parts=4)
    rows, columns, behind = (
        np.concatenate([mixed[k][i] for k in range(len(corners))]) for i in range(3)
    )
    return Unmixed(foreground, rows.astype(np.int32), columns.astype(np.int32), behind)


@dataclass(frozen=True, eq=False)
class _Size:
    """A crop at one of its smaller sizes."""

    rgb: F32  # (h, w, 3)
    alpha: F32  # (h, w)
    sure: tuple[F32, F32]  # (h, w) how much of a pixel is nothing but object, but background
    colours: tuple[F32, F32]  # (h, w, 3) times the colour of that

    @staticmethod
    def of(rgb: F32, alpha: F32) -> _Size:
        sure = ((alpha == 1).astype(np.float32), (alpha == 0).astype(np.float32))
        return _Size(rgb, alpha, sure, (sure[0][..., None] * rgb, sure[1][..., None] * rgb))

    def half(self) -> _Size:
        one, other = (halved(share) for share in self.sure)
        fore, back = (halved(colour) for colour in self.colours)
        return _Size(halved(self.rgb), halved(self.alpha), (one, other), (fore, back))


def coarse_colours(rgb: F32, alpha: F32) -> tuple[F32, F32]:
    """F and B (h, w, 3) of a small picture (h, w, 3) from all of its sizes."""
    sizes = [_Size.of(rgb, alpha)]
    while max(sizes[-1].alpha.shape) > 1:
        sizes.append(sizes[-1].half())
    least = sizes[-1]
    fore, back = (
        np.where(sure[..., None] > 0, colour / np.maximum(sure, 1e-12)[..., None], least.rgb)
        for sure, colour in zip(least.sure, least.colours, strict=True)
    )
    while sizes:
        size = sizes.pop()
        fore, back = (np.ascontiguousarray(doubled(c, size.alpha.shape)) for c in (fore, back))
        _relaxed(size, fore, back)
    return fore, back


def _tile(
    pixels: Pixels, alpha: F32, fore: F32, back: F32, window: tuple[slice, slice]
) -> tuple[F32, Mask, F32]:
    """Of one tile of the crop: F (h, w, 3), where it is mixed (h, w), and B (N, 3) there."""
    ends = [(max(s.start - AROUND, 0), min(s.stop + AROUND, n))
            for s, n in zip(window, alpha.shape, strict=True)]  # fmt: skip
    around = (slice(*ends[0]), slice(*ends[1]))
    inner = tuple(slice(s.start - a.start, s.stop - a.start)
                  for s, a in zip(window, around, strict=True))  # fmt: skip
    rgb, share = unit_pixels(pixels[around]), np.ascontiguousarray(alpha[around])
    if share.min() == 1:
        where = np.zeros(alpha[window].shape, np.bool_)
        return rgb[inner[0], inner[1]], where, np.empty((0, 3), np.float32)
    own, behind = (_enlarged(colour, ends) for colour in (fore, back))
    _relaxed(_Size.of(rgb, share), own, behind)
    rgb, share, own, behind = (image[inner[0], inner[1]] for image in (rgb, share, own, behind))
    where = (share > 0) & (share < 1)
    own[where], seen = exact(rgb[where], share[where], own[where], behind[where])
    return own, where, seen


def _enlarged(small: F32, ends: list[tuple[int, int]]) -> F32:
    """The part `ends` (first, last px in y and x) of an image at twice the size of `small`."""
    (y0, y1), (x0, x1) = ends
    top, left = max(y0 // 2 - 1, 0), max(x0 // 2 - 1, 0)
    part = small[top : (y1 + 1) // 2 + 1, left : (x1 + 1) // 2 + 1]
    large = doubled(part, (y1 - 2 * top, x1 - 2 * left))
    return np.ascontiguousarray(large[y0 - 2 * top :, x0 - 2 * left :])


def _relaxed(size: _Size, fore: F32, back: F32) -> None:
    """Brings F and B (h, w, 3) nearer to what a picture (h, w, 3) of this size says, in place."""
    alpha = size.alpha
    np.copyto(fore, size.rgb, where=(alpha == 1)[..., None])
    np.copyto(back, size.rgb, where=(alpha == 0)[..., None])
    mixed = ((alpha > 0) & (alpha < 1)).astype(np.uint8)
    rows, columns = np.nonzero(cv2.dilate(mixed, np.ones((3, 3), np.uint8)))
    if len(rows):
        rounds = ROUNDS[0] if max(alpha.shape) <= SMALL else ROUNDS[1]
        places = rows.astype(np.int32), columns.astype(np.int32)
        sure = np.stack([share[places] for share in size.sure], 1)
        known = np.concatenate([colour[places] for colour in size.colours], 1)
        _relax(size.rgb, alpha, places, (sure, known), (fore, back), rounds)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _relax(
    rgb: F32, alpha: F32, places: tuple[I32, I32], known: tuple[F32, F32],
    colours: tuple[F32, F32], rounds: int,
) -> None:  # fmt: skip
    """`rounds` Jacobi steps at rows, columns (N,): the same in whichever order they are."""
    (rows, columns), (sure, anchors), (fore, back) = places, known, colours
    height, width = alpha.shape
    new = np.empty((len(rows), 6), np.float32)
    mean = np.empty(6)
    for _ in range(rounds):
        for n in range(len(rows)):
            y, x = rows[n], columns[n]
            a = alpha[y, x]
            b = 1 - a
            weights = 0.0
            mean[:] = 0
            for k in range(4):
                i = y + (k == 0) - (k == 1)
                j = x + (k == 2) - (k == 3)
                if i < 0 or j < 0 or i >= height or j >= width:
                    continue
                weight = SMOOTHNESS + AT_EDGES * abs(a - alpha[i, j])
                weights += weight
                for c in range(3):
                    mean[c] += weight * fore[i, j, c]
                    mean[c + 3] += weight * back[i, j, c]
            one, other = weights + ANCHOR * sure[n, 0], weights + ANCHOR * sure[n, 1]
            gain_one, gain_other = a / max(one, 1e-12), b / max(other, 1e-12)
            whole = 1 + a * gain_one + b * gain_other
            for c in range(3):
                own = (mean[c] + ANCHOR * anchors[n, c]) / max(one, 1e-12)
                behind = (mean[c + 3] + ANCHOR * anchors[n, c + 3]) / max(other, 1e-12)
                rest = (rgb[y, x, c] - a * own - b * behind) / whole
                own += gain_one * rest
                behind += gain_other * rest
                new[n, c] = rgb[y, x, c] if a == 1 else min(max(own, 0), 1)
                new[n, c + 3] = rgb[y, x, c] if a == 0 else min(max(behind, 0), 1)
        for n in range(len(rows)):
            for c in range(3):
                fore[rows[n], columns[n], c] = new[n, c]
                back[rows[n], columns[n], c] = new[n, c + 3]


def exact(rgb: F32, alpha: F32, fore: F32, back: F32) -> tuple[F32, F32]:
    """F and B (N, 3) in [0, 1], as near as can be to those given, that mix to `rgb` (N, 3)."""
    a = alpha[:, None].astype(np.float64)
    b = 1 - a
    rest = (rgb - a * fore - b * back) / (a * a + b * b)
    own = np.clip(fore + a * rest, 0, 1)
    behind = np.clip((rgb - a * own) / b, 0, 1)
    own = (rgb - b * behind) / a  # where B came to its limit F gives way, and finds room
    return np.clip(own, 0, 1).astype(np.float32), behind.astype(np.float32)
