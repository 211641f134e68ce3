"""The rows of an edit, one strip after the other, blended into the photo.

What a pixel needs of its neighbours reaches a few rows: those nearest to the next strip wait
until that strip is drawn. So the memory does not grow with the photo, and where one strip ends
changes nothing in the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np

from ..base.arrays import F32, Mask, Pixels, pixels_from_unit, unit_pixels
from ..base.threads import in_threads
from ..raster.reference import Picture3D

STILL = 0.05  # px: a surface that moved less is where it was
STILL_ALPHA = 1.5 / 255  # likewise for its alpha
NEAR = 7  # px, window in which a left pixel looks for the object's new edge
FEATHER_START = 0.6  # x hole margin: the edit is blended into the photo from here outwards
FEATHERS = ((STILL, 1.5), (0.5, 3.0), (2.0, 6.0), (6.0, math.inf))  # px moved -> px, at most
SEEN = 1 / 1024  # of a pixel, of a shadow or a repair: with less it is as it was
AT_A_TIME = 3  # x the rows that are looked at around them: how many rows are blended together

Item = TypeVar("Item")
Result = TypeVar("Result")
Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px of the photo
Sums = tuple[float, float, float, float]  # from photo, lifter, inpainter, paint


@dataclass(frozen=True, eq=False)
class Rows:
    """Some rows of the edit, (h, w): plate and objects, not yet blended into the photo."""

    left: int  # px, corner in the photo
    top: int
    colour: F32  # (h, w, 3) sRGB in [0, 1]; premultiplied by `cover`, where there is one
    from_photo: F32  # shares of the colour; with that of paint they sum to 1
    from_lifter: F32
    from_inpainter: F32
    moved: F32  # px, see `displacement`
    is_covered: Mask  # by an object, now or before
    touched: F32 | None = None  # in [0, 1], what changes in place: shadows, repairs, colours
    is_object: Mask | None = None  # what objects alone cover, where more is covered; None: all is
    from_paint: F32 | None = None  # None: nothing is painted
    cover: F32 | None = None  # alpha; None: all is opaque

    @property
    def box(self) -> Box:
        """Return their box in the photo."""
        height, width = self.moved.shape
        return self.left, self.top, self.left + width, self.top + height

    @property
    def bottom(self) -> int:
        """Px, the row of the photo below them."""
        return self.top + len(self.moved)

    def cover_under(self, alpha: F32) -> F32 | None:
        """Their alpha under something of `alpha` (h, w)."""
        if self.cover is None:
            return None
        return np.asarray(self.cover + alpha * (1 - self.cover), np.float32)


def map_in_threads(run: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """`run(item)` of each, in their order; each may take another core."""
    results: dict[int, Result] = {}

    def several(first: int, last: int) -> None:
        for k in range(first, last):
            results[k] = run(items[k])

    in_threads(several, len(items), parts=len(items))
    return [results[k] for k in range(len(items))]


def displacement(picture: Picture3D, rest_alpha: F32) -> F32:
    """(h, w) px by which what stands at a pixel is not where it was; 0 where nothing changed.

    A pixel that the object has left counts as far as its neighbours moved, or as infinitely far
    where none of the object is left near it.
    """
    stands = picture.alpha > 0
    x, y = picture.shift[..., 0], picture.shift[..., 1]
    shift = np.where(stands, np.sqrt(x * x + y * y), 0).astype(np.float32)
    near = cv2.dilate(shift, np.ones((NEAR, NEAR), np.uint8))
    shift = np.where(stands, shift, np.where(near > 0, near, np.inf))
    is_invented = picture.from_photo < picture.alpha - STILL_ALPHA
    is_other = np.abs(picture.alpha - rest_alpha) > STILL_ALPHA
    shift[is_invented] = np.inf
    shift[is_other] = np.maximum(shift[is_other], STILL)
    is_still = (shift < STILL) | (~stands & ~is_other)
    return np.where(is_still, 0, shift).astype(np.float32)


def with_touched(rows: Rows) -> Rows:
    """`rows` in which shadows and repairs count as moved, by the least that counts."""
    if rows.touched is None:
        return rows
    is_touched = rows.touched > SEEN
    moved = np.where(is_touched, np.maximum(rows.moved, np.float32(STILL)), rows.moved)
    is_covered = rows.is_covered | is_touched
    return replace(rows, moved=moved, is_covered=is_covered, is_object=rows.is_covered)


def blend_weights(moved: F32, margin: float, feather: float = 1.0) -> F32:
    """(h, w) in [0, 1]: how much of the edit to show, where its `displacement` is `moved`.

    1 where something moved, and falling to 0 around it over a distance that grows with the
    move: the plate's invented ring is not shown around what has hardly moved. From `margin` px
    on it is 0. `feather` widens those distances.
    """

    def ramp_of(step: tuple[float, float]) -> F32 | None:
        is_moved = moved >= step[0]
        if not is_moved.any():
            return None
        reach = min(step[1] * feather, margin)
        ramp = distance(is_moved)  # and in place from here on: several are held at once
        np.subtract(reach, ramp, out=ramp)
        ramp /= (1 - FEATHER_START) * reach
        return np.clip(ramp, 0, 1, out=ramp)

    blend = np.zeros(moved.shape, np.float32)
    for weights in map_in_threads(ramp_of, FEATHERS):
        if weights is not None:
            np.maximum(blend, weights, out=blend)
    return blend


def distance(there: Mask) -> F32:
    """(h, w) px to the nearest pixel that is `there`; very far where there is none.

    It is the length of a way in steps of one or two pixels, which stays between its ends: what
    is farther up or down than the distance has no say in it, not even in its last bit.
    """
    away = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(away, np.float32)


def differ(one: Pixels, other: Pixels) -> Mask:
    """(h, w) where two pictures (h, w, 3) are not the same."""
    is_other = one != other  # of which any(-1) would take five times as long
    return is_other[..., 0] | is_other[..., 1] | is_other[..., 2]


def _mixed_straight(
    photo: F32, alpha: F32, colour: F32, cover: F32, weights: F32
) -> tuple[F32, F32]:
    """A straight `photo` (h, w, 3) with `alpha` mixed with a premultiplied `colour` with `cover`.

    Returns straight colours and alpha: what is hardly there lends no colour to what is.
    """
    own = photo * alpha[..., None]
    mixed = own + weights[..., None] * (colour - own)
    there = alpha + weights * (cover - alpha)
    straight = mixed / np.maximum(there, np.float32(1e-6))[..., None]
    return np.asarray(straight, np.float32), np.asarray(there, np.float32)


class Blend:
    """The photo with the edit blended in, as far as its rows have come."""

    def __init__(
        self,
        photo: Pixels,
        margin: float,
        box: Box,
        rows: int | None = None,
        feather: float = 1.0,
        keeps_weights: bool = False,
        alpha: np.ndarray | None = None,
    ) -> None:
        """The edit is in `box`, and shows `margin` px around what it disturbs.

        At least `rows` are blended at a time. `feather`: see `blend_weights`. `alpha` (H, W) is
        the photo's, straight; where it has one, the rows have a cover.
        """
        self._feather = feather
        x0, y0, x1, y1 = box
        # (h, w) of the box: how much of the edit each pixel shows; None: not kept
        self.weights = np.zeros((y1 - y0, x1 - x0), np.float32) if keeps_weights else None
        self._corner = x0, y0
        self.pixels = photo.copy()
        self.alpha = None if alpha is None else alpha.copy()
        self.footprint = np.zeros(photo.shape[:2], bool)
        self._photo, self._alpha, self._margin = photo, alpha, margin
        self._reach = math.ceil(margin) + 2  # rows from which on a distance does not matter
        self._rows: list[Rows] = []  # not blended yet, or needed by those that are not
        self._blended, self._bottom = box[1], box[3]  # px, rows of the photo
        self._least = rows or AT_A_TIME * self._reach
        self._sums: list[Sums] = []  # of shares over changed pixels
        self.beside = 0  # px changed by shadows and repairs, out of the reach of every object

    def add(self, rows: Rows) -> None:
        """Takes the next rows, and blends those whose surroundings are known, once enough are."""
        self._rows.append(rows)
        is_last = rows.bottom == self._bottom
        known = rows.bottom if is_last else rows.bottom - self._reach
        ready = [r for r in self._rows if r.top >= self._blended and r.bottom <= known]
        if not ready or (ready[-1].bottom - self._blended < self._least and not is_last):
            return
        weights = blend_weights(
            np.concatenate([r.moved for r in self._rows]), self._margin, self._feather
        )
        away = distance(np.concatenate([r.is_covered for r in self._rows]))
        beside, top = self._beside(), self._rows[0].top

        def mix(rows: Rows) -> Sums:
            inner = slice(rows.top - top, rows.bottom - top)
            return self._mix(rows, weights[inner], away[inner] <= self._margin + 1)

        self._sums += map_in_threads(mix, ready)
        if beside is not None:
            x0, x1 = self._corner[0], self._corner[0] + beside.shape[1]
            done = np.s_[ready[0].top : ready[-1].bottom, x0:x1]
            is_changed = self._differ(done)
            is_beside = beside[ready[0].top - top : ready[-1].bottom - top]
            self.beside += int(np.count_nonzero(is_changed & is_beside))
        self._blended = ready[-1].bottom
        self._rows = [r for r in self._rows if r.bottom > self._blended - self._reach]

    def _beside(self) -> Mask | None:
        """Where of the rows that wait no object reaches, but something else may show."""
        if all(r.is_object is None for r in self._rows):
            return None
        own = [r.is_covered if r.is_object is None else r.is_object for r in self._rows]
        return distance(np.concatenate(own)) > self._margin + 1

    def _mix(self, rows: Rows, weights: F32, footprint: Mask) -> Sums:
        """Blends `rows` in by `weights` (h, w); the shares summed over the changed pixels."""
        x0, y0, x1, y1 = rows.box
        self.footprint[y0:y1, x0:x1] = footprint
        if self.weights is not None:
            left, top = self._corner
            self.weights[y0 - top : y1 - top, x0 - left : x1 - left] = weights
        if not weights.any():
            return 0.0, 0.0, 0.0, 0.0
        old = self._photo[y0:y1, x0:x1]
        photo, is_changed = unit_pixels(old), weights > 0
        if self._alpha is None or self.alpha is None or rows.cover is None:
            mixed = photo + weights[..., None] * (rows.colour - photo)
        else:
            alpha = self._alpha[y0:y1, x0:x1]
            own = unit_pixels(alpha)
            mixed, cover = _mixed_straight(photo, own, rows.colour, rows.cover, weights)
            cover = np.where(is_changed, pixels_from_unit(cover, alpha.dtype), alpha)
            is_changed = is_changed & ((cover > 0) | (alpha > 0))  # what is not seen stays
            self.alpha[y0:y1, x0:x1] = cover
        # Where the blend is nothing, or changes nothing, the photo's own integers stay.
        new = np.where(is_changed[..., None], pixels_from_unit(mixed, old.dtype), old)
        self.pixels[y0:y1, x0:x1] = new
        changed = self._differ(np.s_[y0:y1, x0:x1])
        shown = weights[changed]

        def total(values: np.ndarray) -> float:
            return float(values.sum(dtype=np.float64))

        return (
            total(1 - shown + shown * rows.from_photo[changed]),
            total(shown * rows.from_lifter[changed]),
            total(shown * rows.from_inpainter[changed]),
            0.0 if rows.from_paint is None else total(shown * rows.from_paint[changed]),
        )

    def _differ(self, part: tuple[slice, slice]) -> Mask:
        """Where the picture is not the photo, in colour or alpha."""
        changed = differ(self.pixels[part], self._photo[part])
        if self._alpha is not None and self.alpha is not None:
            changed |= self.alpha[part] != self._alpha[part]
        return changed

    def shares(self) -> Sums:
        """The shares of photo, lifter, inpainter and paint in the changed pixels; else all 0."""
        photo, lifter, inpainter, paint = (math.fsum(s[k] for s in self._sums) for k in range(4))
        whole = photo + lifter + inpainter + paint or 1.0
        return photo / whole, lifter / whole, inpainter / whole, paint / whole
