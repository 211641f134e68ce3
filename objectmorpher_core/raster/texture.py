"""The photo as the Gaussians carry it: straight colour and alpha, with halved copies."""

from __future__ import annotations

import mmap
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np

from ..base.arrays import F32, F64, frozen
from ..base.threads import in_threads

LEAST_LEVEL = 4  # px, shorter side of a picture that is halved again
MOST_LEVELS = 8
STRIP = 128  # rows that are made at a time: a border around all of a photo is a photo more
BESIDE = 8.0  # px: so far beside a place the full size may be looked at


@dataclass(frozen=True, eq=False)
class TextureLevels:
    """The object's straight colours and alpha, with halved copies for minification."""

    texels: F32  # (4 T,) all levels, one after the other, rows of pixels as they come
    shapes: np.ndarray  # (levels, 3) height, width and first texel of each
    left: float  # px in the photo, corner of the crop
    top: float

    @cached_property
    def levels(self) -> tuple[F32, ...]:
        """Return the levels, each (h, w, 4) and halved once more than the one before: views."""
        return tuple(
            self.texels[4 * first : 4 * (first + height * width)].reshape(height, width, 4)
            for height, width, first in self.shapes.tolist()
        )


@dataclass(frozen=True, eq=False)
class TextureSource:
    """What a texture is made of, by rows: nobody has to hold all of it as straight floats."""

    # From the first to before the last row: straight colours (h, w, 3) in [0, 1] and alpha (h, w);
    # asked for in strips, and in threads.
    rows: Callable[[int, int], tuple[F32, F32]]
    shape: tuple[int, int]  # (h, w)
    left: float  # px in the photo, corner of the crop
    top: float

    @cached_property
    def shapes(self) -> np.ndarray:
        """As those of `TextureLevels`."""
        sizes = [self.shape]
        while min(sizes[-1]) >= LEAST_LEVEL and len(sizes) < MOST_LEVELS:
            sizes.append((-(-sizes[-1][0] // 2), -(-sizes[-1][1] // 2)))
        starts = np.cumsum([0, *(h * w for h, w in sizes[:-1])])
        return frozen(np.column_stack([np.array(sizes, np.int64), starts]))

    @property
    def size(self) -> int:
        """Numbers of all the levels."""
        height, width, first = self.shapes[-1].tolist()
        return 4 * (first + height * width)

    def fill(self, first: int, last: int, texels: F32) -> None:
        """Put rows of the full size into `texels` (h, w, 4)."""
        parts = [np.ascontiguousarray(part, np.float32) for part in self.rows(first, last)]
        cv2.mixChannels(parts, [texels], [0, 0, 1, 1, 2, 2, 3, 3])

    def levels(self) -> TextureLevels:
        """The whole texture."""
        texels = np.empty(self.size, np.float32)  # a photo's worth: nothing is kept twice
        full, *others = TextureLevels(texels, self.shapes, self.left, self.top).levels
        _in_strips(lambda first, last: self.fill(first, last, full[first:last]), self.shape[0])
        _halve_all([full, *others])
        return TextureLevels(frozen(texels), self.shapes, self.left, self.top)


def build_levels(foreground: F32, alpha: F32, left: float, top: float) -> TextureLevels:
    """Texture from straight `foreground` (h, w, 3) in [0, 1] and `alpha` (h, w).

    `left`, `top`: px in the photo of the crop's corner, which may lie outside it.
    """

    def rows(first: int, last: int) -> tuple[F32, F32]:
        return foreground[first:last], alpha[first:last]

    return TextureSource(rows, (alpha.shape[0], alpha.shape[1]), left, top).levels()


class TextureRows:
    """A texture of which the full size is there only where it is about to be looked at.

    That is three quarters of it; a picture that is drawn from above to below looks at a few rows at
    a time. The memory of the others is reserved and not used, and given back where it was.
    """

    def __init__(self, source: TextureSource) -> None:
        self._source = source
        self._memory = _reserved(4 * source.size)
        texels = np.frombuffer(self._memory, np.float32, source.size)
        self._texture = TextureLevels(texels, source.shapes, source.left, source.top)
        self._is_there = np.zeros(-(-source.shape[0] // STRIP), bool)
        _, half, *others = self._texture.levels

        def halve(first: int, last: int) -> None:
            rows = slice(2 * first, min(2 * last, source.shape[0]))
            fine = np.empty((rows.stop - rows.start, source.shape[1], 4), np.float32)
            source.fill(rows.start, rows.stop, fine)
            _halve(fine, half[first:last])

        _in_strips(halve, len(half))
        _halve_all([half, *others])

    def looked_at(self, low: F64, high: F64) -> TextureLevels:
        """The texture, to be looked at between rows `low` and `high` (N,) px of the photo only.

        What was asked for before is not there any more.
        """
        count = len(self._is_there)
        first, last = (
            np.floor((rows - self._source.top + beside) / STRIP).clip(-1, count).astype(np.int64)
            for rows, beside in ((low, -BESIDE), (high, BESIDE))
        )
        ends = np.zeros(count + 2, np.int64)
        np.add.at(ends, first.clip(0), 1)
        np.add.at(ends, last + 1, -1)
        wanted = np.cumsum(ends)[:count] > 0
        for strip in np.flatnonzero(self._is_there & ~wanted):
            self._give_back(int(strip))
        missing = np.flatnonzero(wanted & ~self._is_there)

        def fill(first: int, last: int) -> None:
            for strip in missing[first:last].tolist():
                top, bottom = strip * STRIP, min((strip + 1) * STRIP, self._source.shape[0])
                self._source.fill(top, bottom, self._texture.levels[0][top:bottom])

        in_threads(fill, len(missing), parts=4)
        self._is_there = wanted
        return replace(self._texture, texels=frozen(self._texture.texels))

    def _give_back(self, strip: int) -> None:
        """What no other strip has a part of (Windows cannot take back a part of a mapping)."""
        width, page = 16 * self._source.shape[1], mmap.PAGESIZE
        last = min((strip + 1) * STRIP, self._source.shape[0])  # the halved copies lie behind it
        start, end = strip * STRIP * width, last * width
        start, end = -(-start // page) * page, end // page * page
        if sys.platform != "win32" and start < end:
            self._memory.madvise(mmap.MADV_DONTNEED, start, end - start)


def _reserved(size: int) -> mmap.mmap:
    """Bytes that take memory only where they are written."""
    if sys.platform == "win32":
        return mmap.mmap(-1, size)
    return mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)


def _halve_all(levels: list[F32]) -> None:
    """Fill all levels but the first, each from the one before."""
    for fine, coarse in pairwise(levels):

        def halve(first: int, last: int, fine: F32 = fine, coarse: F32 = coarse) -> None:
            _halve(fine[2 * first : 2 * last], coarse[first:last])

        _in_strips(halve, len(coarse))


def _in_strips(run: Callable[[int, int], None], height: int) -> None:
    """Call `run(first, last)` for strips of `height` rows."""

    def several(first: int, last: int) -> None:
        for strip in range(first, last):
            run(strip * STRIP, min((strip + 1) * STRIP, height))

    in_threads(several, -(-height // STRIP), parts=4)


def _halve(fine: F32, coarse: F32) -> None:
    """Means of 2 x 2 pixels; an odd last row or column counts twice."""
    odd = fine.shape[0] % 2, fine.shape[1] % 2
    if any(odd):
        rim = cv2.copyMakeBorder(fine, 0, odd[0], 0, odd[1], cv2.BORDER_REPLICATE)
        fine = np.asarray(rim, np.float32)
    size = (coarse.shape[1], coarse.shape[0])
    cv2.resize(fine, size, dst=coarse, interpolation=cv2.INTER_AREA)


def sample_texture(texture: TextureLevels, look: np.ndarray, lod: np.ndarray) -> np.ndarray:
    """Straight colour and alpha (n, 4) at photo px (n, 2), filtered for `lod` (n,).

    The two nearest levels are mixed; the full-size one is sampled bicubically (Catmull-Rom: it
    returns a pixel's own value at its centre), halved ones bilinearly. Outside the crop alpha
    is 0.
    """
    lod = np.clip(lod, 0, len(texture.levels) - 1)
    lower = np.floor(lod).astype(int)
    result = np.zeros((len(look), 4))
    for level, image in enumerate(texture.levels):
        for use, mix in ((lower == level, 1 - (lod - lower)), (lower + 1 == level, lod - lower)):
            at = np.flatnonzero(use & (mix > 0))
            if len(at):
                xy = (look[at] - [texture.left, texture.top]) / 2**level - 0.5
                values = _cubic(image, xy) if level == 0 else _linear(image, xy)
                result[at] += mix[at, None] * values
    return result


def _linear(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    return _taps(image, xy, (0, 1), lambda t: [1 - t, t])


def _cubic(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    def weights(t: np.ndarray) -> list[np.ndarray]:
        return [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ]

    return np.clip(_taps(image, xy, (-1, 0, 1, 2), weights), 0, 1)


def _taps(image, xy, offsets, weights):
    height, width = image.shape[:2]
    base = np.floor(xy).astype(int)
    wx, wy = weights(xy[:, 0] - base[:, 0]), weights(xy[:, 1] - base[:, 1])
    result = np.zeros((len(xy), 4))
    for oy, a in zip(offsets, wy, strict=True):
        for ox, b in zip(offsets, wx, strict=True):
            j, i = base[:, 0] + ox, base[:, 1] + oy
            is_inside = (j >= 0) & (j < width) & (i >= 0) & (i < height)
            value = image[i.clip(0, height - 1), j.clip(0, width - 1)].astype(np.float64)
            value[~is_inside, 3] = 0.0
            result += (a * b)[:, None] * value
    return result
