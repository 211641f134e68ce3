"""The soft shadow of a moved object on the ground: a layer between plate and objects.

It follows from the object's silhouette. The lower edge of each column, where it is not far above
the lowest of all, stands on the ground; what is h above it throws its shadow h x length x (cos,
sin) of the direction from there, the sine shortened as the ground is. The farther from the
ground, the more blurred and the weaker. Right below the edge lies a dark band, the contact.
Nothing is known of the light or the ground: the artist says both.

A shadow multiplies the light that is left. A power of 2.2 stands for sRGB's curve here, for then
it multiplies the encoded values, too, and a window that blends them shows what is exported.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import F32, F64
from ..joining import Shadow
from ..pixels import crop
from .blend import Box
from .silhouette import Silhouette, sampled

GAMMA = 2.2  # of the encoded values
GROUND = 0.5  # x, lengths on the ground towards the viewer look so much shorter
LIFT = 0.4  # x height: a lower edge that is farther above the lowest does not stand on the ground
LEVEL = 0.03  # x width, over which the ground's line is smooth
BLURS = (0.012, 0.07, 0.2)  # x height, at softness 1: near the ground, half up, at the top
HARDEST = 0.006  # x height, of the least blur
FADE = 0.5  # of the strength is lost from the ground to the top
LAST_BLURS = (0.008, 0.035)  # x height, of all of it, at softness 0 and 1
BAND = 0.07  # x height, of the silhouette that touches the ground
BAND_BLUR = 0.03  # x height
BAND_DROP = 0.015  # x height that the contact lies below the object
SOLID = 0.5  # alpha from which on a pixel belongs to the object
DARKEST = 0.97  # of the light, at strength 1
FAINTEST = 1 / 255  # what is weaker is none: the footprint ends somewhere


@dataclass(frozen=True, eq=False)
class Shade:
    """A shadow as a picture over the photo: `colour` at the opacity `alpha`, sRGB."""

    alpha: F32  # (h, w) in [0, 1]; 0 along its border
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it
    colour: tuple[float, float, float]

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 photo px."""
        height, width = self.alpha.shape
        right, bottom = self.left + width * self.pitch, self.top + height * self.pitch
        return self.left, self.top, right, bottom

    def at(self, box: Box) -> F32:
        """Its opacity (h, w) at the pixels of a box of the photo."""
        return sampled(self.alpha, (self.left, self.top), self.pitch, box)


@dataclass(frozen=True, eq=False)
class Standing:
    """A silhouette, and where it stands; all in px of its grid."""

    alpha: F32  # (h, w)
    ground: F64  # (w,) of each column, from the top
    share: F32  # (w,) 1 where it touches the ground there, 0 where it hangs above it
    height: float


def cast(shadow: Shadow, shape: Silhouette) -> Shade | None:
    """The shadow of what has that silhouette; None where there is none."""
    if shadow.strength <= 0 or not (shape.alpha > SOLID).any():
        return None
    widest = max(BLURS[-1] * shadow.softness, BAND_BLUR)
    pad = int(np.ceil(3 * widest * max(shape.alpha.shape))) + 4
    standing = stand(np.pad(shape.alpha, pad))
    near, drop = _contact(standing), round(BAND_DROP * standing.height)
    far, left, top = _thrown(shadow, standing)
    x0, y0 = min(left, 0), min(top, drop)
    x1 = max(left + far.shape[1], near.shape[1])
    y1 = max(top + far.shape[0], drop + near.shape[0])
    light = np.ones((y1 - y0 + 2, x1 - x0 + 2), np.float32)  # that is left
    for part, x, y, weight in ((far, left, top, 1.0), (near, 0, drop, shadow.contact)):
        row, column = y - y0 + 1, x - x0 + 1
        light[row : row + part.shape[0], column : column + part.shape[1]] *= 1 - weight * part
    alpha = 1 - (1 - DARKEST * shadow.strength * (1 - light)) ** (1 / GAMMA)
    alpha = np.clip((alpha - FAINTEST) / (1 - FAINTEST), 0, 1).astype(np.float32)
    rows, columns = np.flatnonzero(alpha.any(1)), np.flatnonzero(alpha.any(0))
    if not len(rows):
        return None
    box = (columns[0] - 1, rows[0] - 1, columns[-1] + 2, rows[-1] + 2)
    alpha = np.pad(alpha[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1], 1)
    corner = np.array([x0 - 1 + box[0] - pad, y0 - 1 + box[1] - pad]) * shape.pitch
    left_px, top_px = float(shape.left + corner[0]), float(shape.top + corner[1])
    return Shade(alpha, left_px, top_px, shape.pitch, shadow.colour)


def stand(alpha: F32) -> Standing:
    """Where what has that silhouette (h, w) stands. Raises ValueError where it has none."""
    solid = alpha > SOLID
    rows = np.arange(1, alpha.shape[0] + 1, dtype=np.float64)[:, None]
    lower = (solid * rows).max(0)  # of each column; 0 where there is none
    ground, height = float(lower.max()), float(lower.max() - rows[solid.any(1)].min() + 1)
    share = np.clip((lower - ground) / (LIFT * height) * 2 + 2, 0, 1)  # full for half of LIFT
    held = np.maximum(lower, ground - LIFT * height)
    columns = np.arange(alpha.shape[1])
    there = columns[lower > 0]
    held = np.interp(columns, there, held[there])
    level = cv2.GaussianBlur(held[None], (0, 0), max(LEVEL * np.ptp(there), 0.5))[0]
    return Standing(alpha, np.asarray(level, np.float64), share.astype(np.float32), height)


def _blurred(shadow: Shadow, standing: Standing) -> F32:
    """The silhouette, more blurred and weaker the higher above the ground."""
    share = _above(standing) / np.float32(standing.height)
    mixed = np.zeros_like(standing.alpha)
    for k, blur in enumerate(BLURS):
        weight = np.clip(1 - np.abs(np.clip(share, 0, 1) * (len(BLURS) - 1) - k), 0, 1)
        sigma = max(HARDEST, blur * shadow.softness) * standing.height
        mixed += weight * _smooth(standing.alpha, sigma)
    return np.asarray(mixed * (1 - FADE * np.clip(share, 0, 1)), np.float32)


def _above(standing: Standing) -> F32:
    """(h, w) px above the ground of each pixel's middle."""
    rows = np.arange(standing.alpha.shape[0], dtype=np.float32)[:, None] + np.float32(0.5)
    return np.asarray(standing.ground.astype(np.float32) - rows, np.float32)


def _contact(standing: Standing) -> F32:
    """What touches the ground, blurred, 1 at its darkest."""
    band = np.clip(1 - np.abs(_above(standing)) / (BAND * standing.height), 0, 1)
    touching = np.asarray(standing.alpha * band * standing.share, np.float32)
    near = _smooth(touching, BAND_BLUR * standing.height)
    return near / max(float(near.max()), 1e-6)


def thrown(shadow: Shadow, standing: Standing) -> F32:
    """(h, w) on the silhouette's own grid: what of the light its shadow takes, in [0, 1]."""
    far, left, top = _thrown(shadow, standing)
    return _moved(far, left, top, standing.alpha.shape)


def contact_of(standing: Standing) -> F32:
    """(h, w) likewise of the dark band right below it."""
    near = _contact(standing)
    return _moved(near, 0, round(BAND_DROP * standing.height), near.shape)


def _moved(part: F32, left: int, top: int, shape: tuple[int, ...]) -> F32:
    """A picture at that place of a larger or smaller one (h, w) of zeros."""
    height, width = shape
    box, own = (0, 0, width, height), (left, top, left + part.shape[1], top + part.shape[0])
    return crop(part, own, box)


def _thrown(shadow: Shadow, standing: Standing) -> tuple[F32, int, int]:
    """Each pixel of the silhouette where its shadow falls; the picture's corner on the grid.

    Pixels that fall on one another are averaged, each weighing what it is: clear ones nothing.
    """
    values, angle = _blurred(shadow, standing), np.radians(shadow.direction)
    across, down = np.cos(angle) * shadow.length, np.sin(angle) * shadow.length * GROUND
    fine = int(np.ceil(max(1.0, abs(across), abs(down))))  # so that no gaps are left
    large = cv2.resize(values, None, fx=1, fy=2 * fine, interpolation=cv2.INTER_LINEAR)
    rows, columns = np.nonzero(large > FAINTEST / 2)
    level = standing.ground[columns]
    height = level - (rows + 0.5) / (2 * fine)
    x = np.rint(columns + height * across).astype(np.int64)
    y = np.floor(level + height * down).astype(np.int64)
    hard, soft = LAST_BLURS
    sigma = (hard + (soft - hard) * shadow.softness) * standing.height
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
    return _smooth(np.asarray(mean, np.float32), sigma), left, top


def _smooth(values: F32, sigma: float) -> F32:
    """Three boxes one after the other: nearly a bell, and as quick for any width."""
    width = 2 * round(sigma) + 1
    for _ in range(3):
        blurred = cv2.blur(values, (width, width), borderType=cv2.BORDER_CONSTANT)
        values = np.asarray(blurred, np.float32)
    return values
