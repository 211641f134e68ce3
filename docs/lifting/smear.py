"""How much of what a turn newly shows is smeared: drawn out along one direction, or flat."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.raster.reference import Picture3D

STRETCHED = 0.6  # photo px per px, along the direction drawn out most, below which it is new
SURE = 0.98  # alpha: nothing of what is behind is in it
FINE = 0.8  # px, of the derivatives that are fine contrast
AROUND = 2.5  # px, over which it is gathered
USUAL = 0.02  # share of an object's own surface that is as drawn out, or as flat, as to count


@dataclass(frozen=True)
class Smear:
    """Shares of the newly shown surface; `USUAL` where it is as the object's own."""

    area: float  # of the visible object that is newly shown
    streaks: float
    flat: float


def smear_of(turned: Picture3D, rest: Picture3D) -> Smear:
    """Of a picture after a turn; `rest` shows the object as the photo does."""
    whole, usual = _inner(turned), _inner(rest)
    new = whole & _is_new(turned)
    if new.sum() < 50 or usual.sum() < 50:
        return Smear(float(new.sum()) / max(float(whole.sum()), 1), 0.0, 0.0)
    ratio, contrast = _contrasts(turned)
    own_ratio, own_contrast = (field[usual] for field in _contrasts(rest))
    return Smear(
        float(new.sum()) / float(whole.sum()),
        float((ratio[new] < np.quantile(own_ratio, USUAL)).mean()),
        float((contrast[new] < np.quantile(own_contrast, USUAL)).mean()),
    )


def _inner(picture: Picture3D) -> Mask:
    """(h, w) where the object is, away from its edge and from the frame."""
    solid = np.pad((picture.alpha > SURE)[1:-1, 1:-1], 1).astype(np.uint8)
    return cv2.erode(solid, np.ones((7, 7), np.uint8)) > 0


def _is_new(picture: Picture3D) -> Mask:
    """(h, w) where the photo is not carried, or drawn out."""
    shift = picture.shift.astype(np.float64)
    across, down = np.gradient(shift, axis=1), np.gradient(shift, axis=0)
    a, b = 1 + across[..., 0], down[..., 0]
    c, d = across[..., 1], 1 + down[..., 1]
    half, det = 0.5 * (a * a + b * b + c * c + d * d), a * d - b * c
    least = np.sqrt(np.maximum(half - np.sqrt(np.maximum(half * half - det * det, 0)), 0))
    is_smooth = np.maximum(np.abs(across), np.abs(down)).max(-1) < 4  # no step between surfaces
    invented = picture.from_photo < 0.5 * picture.alpha
    return invented | (is_smooth & (least < STRETCHED))


def _contrasts(picture: Picture3D) -> tuple[F64, F64]:
    """(h, w) each: fine contrast along the weakest direction over that across it, and both."""
    grey = picture.color.astype(np.float64).mean(-1)
    smooth = cv2.GaussianBlur(grey, (0, 0), FINE)
    x, y = np.gradient(smooth, axis=1), np.gradient(smooth, axis=0)
    xx, xy, yy = (cv2.GaussianBlur(p, (0, 0), AROUND) for p in (x * x, x * y, y * y))
    half, off = 0.5 * (xx + yy), np.sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
    weak, strong = np.sqrt(np.maximum(half - off, 0)), np.sqrt(half + off)
    return weak / np.maximum(strong, 1e-6), strong
