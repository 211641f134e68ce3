"""The photo as the Gaussians carry it: straight colour and alpha, with halved copies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np

from ..base.arrays import F32, frozen
from ..base.threads import in_threads

LEAST_LEVEL = 4  # px, shorter side of a picture that is halved again
MOST_LEVELS = 8
STRIP = 128  # rows that are made at a time: a border around all of a photo is a photo more


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


def build_levels(foreground: F32, alpha: F32, left: float, top: float) -> TextureLevels:
    """Texture from straight `foreground` (h, w, 3) in [0, 1] and `alpha` (h, w).

    `left`, `top`: px in the photo of the crop's corner, which may lie outside it.
    """

    def rows(first: int, last: int) -> tuple[F32, F32]:
        return foreground[first:last], alpha[first:last]

    return build_levels_by_rows(rows, alpha.shape, left, top)


def build_levels_by_rows(
    rows: Callable[[int, int], tuple[F32, F32]], shape: tuple[int, ...], left: float, top: float
) -> TextureLevels:
    """Build as `build_levels` does, of what nobody has to hold as a whole.

    `rows` are asked for in strips and in threads: from the first to before the last one of a crop
    of this `shape` (h, w), straight colours and alpha.
    """
    height, width = shape
    sizes = [(height, width)]
    while min(sizes[-1]) >= LEAST_LEVEL and len(sizes) < MOST_LEVELS:
        sizes.append((-(-sizes[-1][0] // 2), -(-sizes[-1][1] // 2)))
    starts = np.concatenate([[0], np.cumsum([h * w for h, w in sizes])])
    shapes = np.column_stack([np.array(sizes, np.int64), starts[:-1]])
    texels = np.empty(4 * int(starts[-1]), np.float32)  # a photo's worth: nothing is kept twice
    levels = TextureLevels(texels, shapes, left, top).levels

    def fill(first: int, last: int) -> None:
        parts = [np.ascontiguousarray(part, np.float32) for part in rows(first, last)]
        cv2.mixChannels(parts, [levels[0][first:last]], [0, 0, 1, 1, 2, 2, 3, 3])

    _in_strips(fill, height)
    for fine, coarse in pairwise(levels):

        def halve(first: int, last: int, fine: F32 = fine, coarse: F32 = coarse) -> None:
            _halve(fine[2 * first : 2 * last], coarse[first:last])

        _in_strips(halve, len(coarse))
    return TextureLevels(frozen(texels), frozen(shapes), left, top)


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
