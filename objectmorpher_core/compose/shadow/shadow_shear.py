"""The shadow of a silhouette: sheared along the ground, from each column's lower edge.

That lower edge, where it is not far above the lowest of all, stands on the ground; what is h above
it throws its shadow h x length x (cos, sin) of the direction from there, the sine shortened as the
ground is. It is what a sheet throws that stands along the lower outline. It takes nothing but a
mask and is sure of the outline, which a body that was made up from one photo is not: shadows in a
photo are looked for with it (`shadow_fit`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, crop
from ...document.settings import Shadow
from .shadow import BAND, BAND_BLUR, BAND_DROP, BLURS, FADE, FAINTEST, HARDEST, last_blur

# The shadow of a silhouette that is seen from above: the same outline, beside itself.
#
# What lies on a ground that one looks down on, a bowl or a plate, hides its own foot. Its rim is
# about as far above the ground everywhere, so that a distant lamp throws its outline unchanged,
# moved by that height x the shadow's length. The ground is all around it, not only below.

FLAT_SOLID = 0.5  # alpha from which on a pixel belongs to the object


def coarsely_smooth(values: F32, sigma: float) -> F32:
    """Three boxes of whole px: a blur by up to half a px more than `sigma`.

    The scores of a photo's shadows were chosen with it. With exact blurs about as many are found,
    and their forms are as near to the true ones (overlap 0.38), but the shadow of the gallery's
    saucer is taken for a shorter one than it is.
    """
    size = 2 * round(sigma) + 1
    for _ in range(3):
        blurred = cv2.blur(values, (size, size), borderType=cv2.BORDER_CONSTANT)
        values = np.asarray(blurred, np.float32)
    return values


@dataclass(frozen=True, eq=False)
class Flat:
    """A silhouette that lies on the ground, seen from straight above; in px of its grid."""

    alpha: F32  # (h, w)
    height: float  # its shorter side in the picture: the unit of its shadow's lengths

    @property
    def base(self) -> float:
        """The row of its lower end."""
        return float(np.flatnonzero((self.alpha > FLAT_SOLID).any(1))[-1] + 1)

    @property
    def above(self) -> float:
        """Return how far above its base the ground is still seen."""
        return float(np.inf)

    def thrown(self, shadow: Shadow) -> F32:
        """(h, w) what of the light its shadow takes, in [0, 1]."""
        angle, far = np.radians(shadow.direction), shadow.length * self.height
        matrix = np.array([[1, 0, far * np.cos(angle)], [0, 1, far * np.sin(angle)]])
        moved = cv2.warpAffine(self.alpha, matrix, self.alpha.shape[::-1])
        blur = max(last_blur(shadow), HARDEST) * self.height
        return coarsely_smooth(np.asarray(moved, np.float32), blur)

    def contact(self) -> F32:
        """(h, w) of the dark where it touches the ground: none that one sees."""
        return np.zeros_like(self.alpha)


def lie(alpha: F32) -> Flat:
    """Return a lying object with that silhouette (h, w), some of it solid, seen from above."""
    solid = alpha > FLAT_SOLID
    sides = [float(np.ptp(np.flatnonzero(solid.any(axis)))) + 1 for axis in (0, 1)]
    return Flat(alpha, min(sides))


LIFT = 0.4  # x height: a lower edge that is farther above the lowest does not stand on the ground
ABOVE = 0.75  # x the object's height above its base: what is higher is no ground
LEVEL = 0.03  # x width, over which the ground's line is smooth
SOLID = 0.5  # alpha from which on a pixel belongs to the object


@dataclass(frozen=True, eq=False)
class ShadowSheet:
    """A silhouette, and where it stands; all in px of its grid."""

    alpha: F32  # (h, w)
    ground: F64  # (w,) of each column, from the top
    share: F32  # (w,) 1 where it touches the ground there, 0 where it hangs above it
    height: float
    slope: float  # a length on the ground, towards the viewer, looks so much shorter

    @property
    def base(self) -> float:
        """The row of its lower end."""
        return float(self.ground.max())

    @property
    def above(self) -> float:
        """Return how far above its base the ground is still seen."""
        return ABOVE * self.height

    def thrown(self, shadow: Shadow) -> F32:
        """(h, w) on the silhouette's own grid: what of the light its shadow takes, in [0, 1]."""
        far, left, top = _thrown(shadow, self)
        return _moved(far, left, top, self.alpha.shape)

    def contact(self) -> F32:
        """(h, w) likewise of the dark band right below it."""
        near = _contact(self)
        return _moved(near, 0, round(BAND_DROP * self.height), near.shape)


def stand(alpha: F32, slope: float) -> ShadowSheet:
    """Return a standing object with that silhouette (h, w), its ground at an angle of that sine.

    Raises ValueError where it has none.
    """
    solid = alpha > SOLID
    if not solid.any():
        raise ValueError("nothing of the silhouette is solid")
    rows = np.arange(1, alpha.shape[0] + 1, dtype=np.float64)[:, None]
    lower = (solid * rows).max(0)  # of each column; 0 where there is none
    ground, height = float(lower.max()), float(lower.max() - rows[solid.any(1)].min() + 1)
    share = np.clip((lower - ground) / (LIFT * height) * 2 + 2, 0, 1)  # full for half of LIFT
    held = np.maximum(lower, ground - LIFT * height)
    columns = np.arange(alpha.shape[1])
    there = columns[lower > 0]
    held = np.interp(columns, there, held[there])
    level = cv2.GaussianBlur(held[None], (0, 0), max(LEVEL * np.ptp(there), 0.5))[0]
    return ShadowSheet(
        alpha, np.asarray(level, np.float64), share.astype(np.float32), height, slope
    )


def _blurred(shadow: Shadow, standing: ShadowSheet) -> F32:
    """The silhouette, more blurred and weaker the higher above the ground."""
    share = _above(standing) / np.float32(standing.height)
    mixed = np.zeros_like(standing.alpha)
    for k, blur in enumerate(BLURS):
        weight = np.clip(1 - np.abs(np.clip(share, 0, 1) * (len(BLURS) - 1) - k), 0, 1)
        sigma = max(HARDEST, blur * shadow.softness) * standing.height
        mixed += weight * coarsely_smooth(standing.alpha, sigma)
    return np.asarray(mixed * (1 - FADE * np.clip(share, 0, 1)), np.float32)


def _above(standing: ShadowSheet) -> F32:
    """(h, w) px above the ground of each pixel's middle."""
    rows = np.arange(standing.alpha.shape[0], dtype=np.float32)[:, None] + np.float32(0.5)
    return np.asarray(standing.ground.astype(np.float32) - rows, np.float32)


def _contact(standing: ShadowSheet) -> F32:
    """What touches the ground, blurred, 1 at its darkest."""
    band = np.clip(1 - np.abs(_above(standing)) / (BAND * standing.height), 0, 1)
    touching = np.asarray(standing.alpha * band * standing.share, np.float32)
    near = coarsely_smooth(touching, BAND_BLUR * standing.height)
    return near / max(float(near.max()), 1e-6)


def _moved(part: F32, left: int, top: int, shape: tuple[int, ...]) -> F32:
    """A picture at that place of a larger or smaller one (h, w) of zeros."""
    height, width = shape
    box, own = (0, 0, width, height), (left, top, left + part.shape[1], top + part.shape[0])
    return crop(part, own, box)


def _thrown(shadow: Shadow, standing: ShadowSheet) -> tuple[F32, int, int]:
    """Each pixel of the silhouette where its shadow falls; the picture's corner on the grid.

    Pixels that fall on one another are averaged, each weighing what it is: clear ones nothing.
    """
    values, angle = _blurred(shadow, standing), np.radians(shadow.direction)
    across, down = np.cos(angle) * shadow.length, np.sin(angle) * shadow.length * standing.slope
    fine = int(np.ceil(max(1.0, abs(across), abs(down))))  # so that no gaps are left
    large = cv2.resize(values, None, fx=1, fy=2 * fine, interpolation=cv2.INTER_LINEAR)
    rows, columns = np.nonzero(large > FAINTEST / 2)
    level = standing.ground[columns]
    height = level - (rows + 0.5) / (2 * fine)
    x = np.rint(columns + height * across).astype(np.int64)
    y = np.floor(level + height * down).astype(np.int64)
    sigma = last_blur(shadow) * standing.height
    rim = int(np.ceil(3 * sigma)) + 4
    left, top = int(x.min()) - rim, int(y.min()) - rim
    size = (int(y.max()) - top + rim + 1, int(x.max()) - left + rim + 1)
    index, weight = (y - top) * size[1] + x - left, large[rows, columns]
    sums = [
        np.bincount(index, weight**power, size[0] * size[1]).reshape(size).astype(np.float32)
        for power in (1, 2)
    ]
    total, squares = (cv2.blur(s, (3, 3), borderType=cv2.BORDER_CONSTANT) for s in sums)
    mean = squares / np.maximum(total, 1e-6)
    return coarsely_smooth(np.asarray(mean, np.float32), sigma), left, top
