"""The soft shadow of a moved object on the ground: a layer between plate and objects.

It follows from the object's silhouette. Its lowest row is the ground: a point at height h above
it throws its shadow to h x length x (cos, sin) of the direction, the sine shortened as the ground
is; the farther from the ground, the more blurred and the weaker. Right below the object lies a
dark band, the contact. Nothing is known of the light or the ground: the artist says both.

A shadow multiplies the light that is left. A power of 2.2 stands for sRGB's curve here, for then
it multiplies the encoded values, too, and a window that blends them shows what is exported.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import F32, F64
from ..document import Shadow
from .blend import Box
from .silhouette import Silhouette, sampled

GAMMA = 2.2  # of the encoded values
GROUND = 0.5  # x, lengths on the ground towards the viewer look so much shorter
FLATTEST = 0.06  # x the height: a shadow to the side is not thinner than that
BLURS = (0.015, 0.09, 0.28)  # x height, at softness 1: near the ground, half up, at the top
HARDEST = 0.004  # x height, of the least blur
FADE = 0.5  # of the strength is lost from the ground to the top
BAND = 0.12  # x height, rows of the silhouette that touch the ground
BAND_BLUR = 0.035  # x height
BAND_DROP = 0.012  # x height that the contact lies below the object
SOLID = 0.5  # alpha from which on a row belongs to the object
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


def cast(shadow: Shadow, shape: Silhouette) -> Shade | None:
    """The shadow of what has that silhouette; None where there is none."""
    solid = np.flatnonzero((shape.alpha > SOLID).any(1))
    if shadow.strength <= 0 or not len(solid):
        return None
    ground, height = float(solid[-1] + 1), float(solid[-1] + 1 - solid[0])
    blurred, pad = _blurred(shadow, shape.alpha, ground, height)
    shear = _shear(shadow, ground)
    near = _contact(shape.alpha, ground, height)
    drop = BAND_DROP * height
    low, high = _bounds(shear, blurred.shape, pad, near.shape, drop)
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    far = _warped(blurred, shear @ _shift(-pad, -pad), low, size)
    middle = (near.shape[0] - shape.alpha.shape[0]) / 2
    near = _warped(near, _shift(-middle, drop - middle), low, size)
    taken = DARKEST * shadow.strength * (1 - (1 - far) * (1 - shadow.contact * near))
    alpha = 1 - (1 - taken) ** (1 / GAMMA)
    alpha = np.clip((alpha - FAINTEST) / (1 - FAINTEST), 0, 1).astype(np.float32)
    left, top = shape.left + low[0] * shape.pitch, shape.top + low[1] * shape.pitch
    return Shade(alpha, float(left), float(top), shape.pitch, shadow.colour)


def _shear(shadow: Shadow, ground: float) -> F64:
    """(3, 3) from the silhouette's grid to where its points throw their shadow."""
    angle = np.radians(shadow.direction)
    across, down = np.cos(angle) * shadow.length, np.sin(angle) * shadow.length * GROUND
    down = np.copysign(max(abs(down), FLATTEST), down)
    return np.array([[1, -across, across * ground], [0, -down, ground + down * ground], [0, 0, 1]])


def _blurred(shadow: Shadow, alpha: F32, ground: float, height: float) -> tuple[F32, int]:
    """The silhouette, more blurred and weaker towards its top, and the px added around it."""
    sigmas = [max(HARDEST, blur * shadow.softness) * height for blur in BLURS]
    pad = int(np.ceil(3 * sigmas[-1])) + 2
    padded = np.pad(alpha, pad)
    rows = np.arange(padded.shape[0], dtype=np.float32)[:, None] + np.float32(0.5 - pad)
    share = np.clip((ground - rows) / height, 0, 1)  # of the height
    mixed = np.zeros_like(padded)
    for k, sigma in enumerate(sigmas):
        weight = np.clip(1 - np.abs(share * (len(sigmas) - 1) - k), 0, 1)
        mixed += weight * smooth(padded, sigma)
    return np.asarray(mixed * (1 - FADE * share), np.float32), pad


def _contact(alpha: F32, ground: float, height: float) -> F32:
    """What touches the ground, blurred, 1 at its darkest; with px added around it."""
    sigma = BAND_BLUR * height
    pad = int(np.ceil(3 * sigma)) + 2
    rows = np.arange(alpha.shape[0], dtype=np.float32)[:, None] + np.float32(0.5)
    band = alpha * np.clip(1 - (ground - rows) / (BAND * height), 0, 1)
    near = smooth(np.pad(band, pad).astype(np.float32), sigma)
    return near / max(float(near.max()), 1e-6)


def smooth(values: F32, sigma: float) -> F32:
    """Three boxes one after the other: nearly a bell, and as quick for any width."""
    width = 2 * round(sigma) + 1
    for _ in range(3):
        blurred = cv2.blur(values, (width, width), borderType=cv2.BORDER_CONSTANT)
        values = np.asarray(blurred, np.float32)
    return values


def _bounds(
    shear: F64, far: tuple[int, ...], pad: int, near: tuple[int, ...], drop: float
) -> tuple[F64, F64]:
    """Whole px of the silhouette's grid around both parts, and a clear one more."""
    height, width = far[0] - 2 * pad, far[1] - 2 * pad
    corners = np.array([[x, y, 1] for x in (-pad, width + pad) for y in (-pad, height + pad)])
    thrown = (corners @ shear.T)[:, :2]
    more = (near[0] - height) / 2
    band = np.array([[-more, drop - more], [width + more, height + drop + more]])
    both = np.concatenate([thrown, band])
    return np.floor(both.min(0)) - 1, np.ceil(both.max(0)) + 1


def _warped(values: F32, matrix: F64, low: F64, size: tuple[int, int]) -> F32:
    """`values` moved by `matrix` (3, 3) into a picture of `size` whose corner is `low`."""
    half = 0.5  # OpenCV counts from the middle of the first pixel
    whole = _shift(-half - low[0], -half - low[1]) @ matrix @ _shift(half, half)
    return np.asarray(cv2.warpAffine(values, whole[:2], size, flags=cv2.INTER_LINEAR), np.float32)


def _shift(x: float, y: float) -> F64:
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
