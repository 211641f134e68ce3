"""The reflection of an object in the photo: whether there is one, and where it is seen.

The object is mirrored about lines near its foot, a little tilted, a little longer or shorter, and
compared with what is seen below it: by normalised correlation of what is neither smooth nor
finest, each evened out to the same contrast, within the mirrored outline and off the object. The
same picture is laid everywhere else in the surroundings, too: only what agrees much better at the
object's foot than anywhere else is a reflection.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import fft

from ...base.arrays import F32, F64, Mask, Pixels
from ...base.pixels import crop, unit_pixels
from ...document.model import Matte
from ..silhouette import sampled
from .mirror_fit import fitted, grid_pitch
from .mirroring import MirrorLine, premultiplied
from .old_reflection import OldReflection

CELLS = 96  # along the object's longer side, about
AROUND = 1.0  # x that side, how far one looks beside and above it
BELOW = 1.2  # x its height
FINE, COARSE = 1.0, 5.0  # cells: what is compared is between the two
LEAST_CONTRAST = np.array([1.5, 3.0]) / 255  # of the photo's, and the object's: less is noise
MOST = 2.0  # x the usual contrast that anything counts
FREE = 0.02  # of a cell, that objects may cover
SOLID = 0.9  # of a cell, from which it shows the object alone
FADE = 0.5  # x the object's height, over which a reflection is taken to fade
TILTS = (-2.0, -1.0, 0.0, 1.0, 2.0)  # degrees
SCALES = (0.9, 1.0, 1.1)  # of the mirrored height
ASIDE = 0.03  # x the longer side that it may lie beside the object
HIGHER, LOWER = 0.2, 0.12  # x the height: how far it may lie above or below its place
NEAR = 9  # cells about a place that are no other place
LEAST_SEEN = 0.3  # of its weight, that has to lie on ground
LEAST_CELLS = 150
LEAST_AGREEMENT = 0.12
STANDS_OUT = 6.0  # x what is usual elsewhere
LEADS = 1.35  # x the best elsewhere
BAND = 5.0  # cells of distance from the line over which agreement is told
ENDS = 0.45  # x the agreement found, below which it has ended
BLURRED = 2  # cells that it reaches past the mirrored outline
BESIDE = 0.4  # x the object's height, of ground that is looked at about it
CLEAR = 0.03  # x that: farther from the mirrored outline nothing is mirrored


@dataclass(frozen=True, eq=False)
class _Seen:
    """The object and its surroundings on a small grid of evened contrasts."""

    ground: F32  # (h, w, 3) 0 where it is hidden
    free: F32  # (h, w) 1 where it is ground
    object: F32  # (h, w, 3)
    cover: F32  # (h, w) of the object
    foot: tuple[float, float]  # x, y in cells: the middle of its base
    height: float  # cells
    left: int
    top: int
    pitch: int


def find_old_reflection(
    pixels: Pixels, matte: Matte, others: Mask | None = None
) -> OldReflection | None:
    """Find the reflection of the cut-out object in `pixels` (H, W, 3); None where none is sure.

    `others` (H, W): what else hides the ground.
    """
    seen = _look(pixels, matte, others)
    if seen is None:
        return None
    found = _searched(seen)
    if found is None:
        return None
    old = _reflection(seen, found)
    return None if old is None else _exact(pixels, matte, others, _placed(seen, found)) or old


def _look(pixels: Pixels, matte: Matte, others: Mask | None) -> _Seen | None:
    """None where the object is too small, or nothing is seen below it."""
    height, width = pixels.shape[:2]
    solid = crop(matte.alpha, matte.box, (0, 0, width, height)) > 0.5
    rows, columns = np.flatnonzero(solid.any(1)), np.flatnonzero(solid.any(0))
    if not len(rows):
        return None
    high, wide = int(np.ptp(rows)) + 1, int(np.ptp(columns)) + 1
    longer = max(high, wide)
    pitch = max(round(longer / CELLS), 1)
    reach = int(AROUND * longer)
    x0, x1 = max(columns[0] - reach, 0), min(columns[-1] + 1 + reach, width)
    y0, y1 = max(rows[0] - reach // 2, 0), min(rows[-1] + 1 + int(BELOW * high), height)
    shape = (int(x1 - x0) // pitch, int(y1 - y0) // pitch)
    if min(shape) < 1:  # a photo that is thinner than a cell
        return None
    x1, y1 = int(x0 + shape[0] * pitch), int(y0 + shape[1] * pitch)
    box = (int(x0), int(y0), x1, y1)

    def small(image: np.ndarray) -> F32:
        """The box of an image on the grid."""
        return np.asarray(
            cv2.resize(image.astype(np.float32), shape, interpolation=cv2.INTER_AREA), np.float32
        )

    cover = small(crop(matte.alpha, matte.box, box))
    hidden = cover
    if others is not None:
        hidden = np.maximum(cover, small(others[box[1] : y1, box[0] : x1]))
    free = (cv2.dilate(hidden, np.ones((3, 3))) < FREE).astype(np.float32)
    foot = (columns[0] + wide / 2 - x0) / pitch - 0.5, (rows[-1] + 1 - y0) / pitch - 0.5
    if free[min(int(foot[1]), len(free) - 1) :].sum() < LEAST_CELLS:
        return None
    part = pixels[box[1] : y1, box[0] : x1]
    channels = [small(unit_pixels(part[..., n])) for n in range(3)]  # one by one: less memory
    colours = _opponents(*channels)
    alone = (cover > SOLID).astype(np.float32)
    ground, own = (
        _evened(colours, where, float(least))
        for where, least in zip((free, alone), LEAST_CONTRAST, strict=True)
    )
    return _Seen(ground, free, own, cover, foot, high / pitch, box[0], box[1], pitch)


def _opponents(red: F32, green: F32, blue: F32) -> F32:
    """(h, w, 3) brightness, and what is red or blue about a colour."""
    return np.stack([(red + green + blue) / 3, red - green, blue - (red + green) / 2], -1)


def _evened(values: F32, where: F32, least: float) -> F32:
    """(h, w, c) what is between FINE and COARSE, of values at `where`, over its usual contrast."""

    def mean(image: F32, sigma: float) -> F32:
        spread = np.maximum(cv2.GaussianBlur(where, (0, 0), sigma), 1e-3)[..., None]
        blurred = cv2.GaussianBlur(image * where[..., None], (0, 0), sigma)
        return np.asarray(blurred / spread, np.float32)

    band = np.asarray(mean(values, FINE) - mean(values, COARSE), np.float32)
    usual = np.sqrt(mean(band * band, COARSE))
    return np.asarray(np.clip(band / (usual + least), -MOST, MOST) * where[..., None], np.float32)


@dataclass(frozen=True, eq=False)
class _Mirror:
    """The object mirrored about a line through its foot, before it is shifted."""

    pixels: F32  # (h, w, 3)
    alone: F32  # (h, w) where that shows it
    cover: F32  # (h, w) of its outline
    below: F32  # (h, w) cells below the line
    tilt: float  # degrees
    scale: float  # of the mirrored height


def _mirrored(seen: _Seen, tilt: float, scale: float) -> _Mirror:
    height, width = seen.free.shape
    normal = np.array([-np.sin(np.radians(tilt)), np.cos(np.radians(tilt))])
    foot, back = np.array(seen.foot), 1 + 1 / scale
    matrix = np.column_stack(
        [np.eye(2) - back * np.outer(normal, normal), back * (foot @ normal) * normal]
    )
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    below = ((x - foot[0]) * normal[0] + (y - foot[1]) * normal[1]).astype(np.float32)

    def laid(image: F32) -> F32:
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(image, matrix, (width, height), flags=flags), np.float32)

    cover = laid(seen.cover)
    alone = (cover > SOLID).astype(np.float32)
    return _Mirror(laid(seen.object), alone, cover, below, tilt, scale)


@dataclass(frozen=True, eq=False)
class _Found:
    """A mirror image where it agrees best."""

    mirror: _Mirror
    right: int  # cells that it is shifted
    down: int
    agreement: float  # correlation
    score: float  # that, less where less of it is seen


def _searched(seen: _Seen) -> _Found | None:
    """The best, where it is much better than anywhere else."""
    rows, columns = seen.free.shape
    size = (_padded(rows), _padded(columns))
    down, right = (np.arange(n) - n * (np.arange(n) > n // 2) for n in size)
    spectra = _Spectra.of(seen, size)
    aside = max(round(ASIDE * max(seen.height, CELLS)), 2)
    is_its_place = (
        (down[:, None] >= -HIGHER * seen.height)
        & (down[:, None] <= LOWER * seen.height)
        & (np.abs(right) <= aside)
    )
    best, maps = None, []
    for scale in SCALES:
        for tilt in TILTS:
            mirror = _mirrored(seen, tilt, scale)
            agreement, seen_share = spectra.compared(mirror, seen.height)
            score = np.where(
                seen_share > LEAST_SEEN, agreement * np.sqrt(np.clip(seen_share, 0, 1)), 0
            )
            maps.append(score)
            at = np.unravel_index(int(np.where(is_its_place, score, -1).argmax()), size)
            if best is None or score[at] > best.score:
                best = _Found(mirror, int(right[at[1]]), int(down[at[0]]),
                              float(agreement[at]), float(score[at]))  # fmt: skip
    if best is None or best.agreement < LEAST_AGREEMENT:
        return None
    is_near = (np.abs(down - best.down) <= NEAR)[:, None] & (np.abs(right - best.right) <= NEAR)
    elsewhere = np.stack(maps)[:, ~is_near]
    tried = elsewhere[elsewhere != 0]
    if len(tried) < LEAST_CELLS:
        return None
    usual = float(np.sqrt(np.mean(tried * tried)))
    is_sure = best.score > STANDS_OUT * usual and best.score > LEADS * float(tried.max())
    return best if is_sure else None


@dataclass(frozen=True, eq=False)
class _Spectra:
    """The surroundings, transformed once for all mirror images."""

    size: tuple[int, ...]
    ground: np.ndarray
    squares: np.ndarray
    free: np.ndarray

    @staticmethod
    def of(seen: _Seen, size: tuple[int, ...]) -> _Spectra:
        squares = (seen.ground**2).sum(-1)
        images = (seen.ground, squares, seen.free)
        return _Spectra(size, *(_spectrum(image, size) for image in images))

    def compared(self, mirror: _Mirror, height: float) -> tuple[F64, F64]:
        """Correlation of a mirror image at all shifts (of `size`), and the share that is seen."""
        weight = _weight(mirror, height)
        own = weight[..., None] * mirror.pixels
        product = self._correlated(own, self.ground).sum(-1)
        squares = self._correlated(weight, self.squares)
        own_squares = self._correlated((own * mirror.pixels).sum(-1), self.free)
        share = self._correlated(weight, self.free) / max(float(weight.sum()), 1e-6)
        least = 1e-4 * max(float(weight.sum()), 1.0)
        agreement = product / np.sqrt(np.maximum(squares, least) * np.maximum(own_squares, least))
        return agreement, share

    def _correlated(self, image: F32, spectrum: np.ndarray) -> F64:
        product = np.conj(_spectrum(image, self.size)) * spectrum
        return np.asarray(fft.irfft2(product, self.size, axes=(0, 1)), np.float64)


def _padded(count: int) -> int:
    """Of an axis of so many cells, so that no shift comes in again at the other end."""
    size = fft.next_fast_len(2 * count, real=True)
    assert size is not None
    return int(size)


def _spectrum(image: F32, size: tuple[int, ...]) -> np.ndarray:
    """Of an image (h, w) or (h, w, c), padded with 0 to `size`."""
    return np.asarray(fft.rfft2(image, size, axes=(0, 1)))


def _weight(mirror: _Mirror, height: float) -> F32:
    """(h, w) how much each cell of a mirror image counts."""
    return mirror.alone * np.exp(-np.maximum(mirror.below, 0) / np.float32(FADE * height))


def _reflection(seen: _Seen, found: _Found) -> OldReflection | None:
    """Where it is seen: from the line downwards, as far as it agrees."""

    def shifted(image: F32) -> F32:
        matrix = np.array([[1.0, 0, found.right], [0, 1, found.down]])
        size = (image.shape[1], image.shape[0])
        return np.asarray(cv2.warpAffine(image, matrix, size), np.float32)

    mirror = found.mirror
    own, alone = shifted(mirror.pixels), shifted(mirror.alone) * seen.free
    below = mirror.below - found.down
    rows = np.clip(np.rint(below).astype(np.int64), 0, None)
    sums = [
        cv2.GaussianBlur(
            np.bincount(rows.ravel(), (alone * v).ravel()).reshape(-1, 1), (0, 0), BAND
        )
        for v in ((own * seen.ground).sum(-1), (own**2).sum(-1), (seen.ground**2).sum(-1))
    ]
    agrees = sums[0] / np.sqrt(np.maximum(sums[1] * sums[2], 1e-9))
    last = _last(agrees.ravel() > ENDS * found.agreement)
    outline = cv2.dilate(shifted(mirror.cover), np.ones((2 * BLURRED + 1,) * 2))
    cover = np.where(below < last, outline, 0)
    cover[[0, -1]] = 0
    cover[:, [0, -1]] = 0
    if not (cover > 0.5).any():
        return None
    return OldReflection(np.asarray(cover, np.float32), seen.left, seen.top, seen.pitch, None)


def _last(agrees: np.ndarray) -> int:
    """How far it goes on from where it is first seen."""
    first = int(agrees.argmax())
    ended = np.flatnonzero(~agrees[first:])
    return first + int(ended[0]) if len(ended) else len(agrees)


def _placed(seen: _Seen, found: _Found) -> MirrorLine:
    """The mirror image in the photo's pixels."""
    tilt, scale = found.mirror.tilt, found.mirror.scale
    across = np.array([-np.sin(np.radians(tilt)), np.cos(np.radians(tilt))])
    shift = np.array([found.right, found.down]) * seen.pitch
    foot = np.array([seen.left, seen.top]) + (np.array(seen.foot) + 0.5) * seen.pitch
    foot += across * (across @ shift) / (1 + scale)
    height = seen.height * seen.pitch
    aside = float(shift @ [across[1], -across[0]])
    return MirrorLine((float(foot[0]), float(foot[1])), tilt, aside, scale, seen.pitch, height,
                     FADE * height)  # fmt: skip


def _exact(
    pixels: Pixels, matte: Matte, others: Mask | None, start: MirrorLine
) -> OldReflection | None:
    """What is mirrored as `start` says, about, with what of it can be taken off."""
    height, width = pixels.shape[:2]
    pitch, whole = grid_pitch(matte), (0, 0, width, height)
    outline = start.laid(premultiplied(matte, pitch)[..., 3:], matte.box[:2], whole, pitch) > FREE
    outline &= start.below(whole, pitch) >= 0
    rows, columns = (pitch * np.flatnonzero(outline.any(axis)) for axis in (1, 0))
    if not len(rows):
        return None
    side = int(BESIDE * start.height)
    x0, y0 = max(int(columns[0]) - side, 0), max(int(rows[0]) - side, 0)
    x1 = min(int(np.ceil(columns[-1] + pitch)) + side, width)
    y1 = min(int(np.ceil(rows[-1] + pitch)) + side, height)
    box = (x0, y0, x1, y1)
    reach = 2 * max(round(CLEAR * start.height / pitch), round(3 / pitch)) + 1
    wide = cv2.dilate(outline.astype(np.uint8), np.ones((reach, reach), np.uint8))
    wide = wide.astype(np.float32)
    mirrored, part = sampled(wide, (0, 0), pitch, box) > 0.5, np.s_[y0:y1, x0:x1]
    hidden = crop(matte.alpha, matte.box, box) > FREE
    if others is not None:
        hidden = hidden | others[part]
    free = cv2.dilate(hidden.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0
    return fitted(pixels, matte, (free, free & ~mirrored), start, box)
