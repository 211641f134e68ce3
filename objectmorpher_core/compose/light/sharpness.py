"""How blurred a photo is, from the widths of its edges.

The same edge is looked at through two blurs: the gradients' ratio tells how wide it was before
(as Zhuo and Sim 2011 do with one). Shading, and what is round, has wide edges in the sharpest of
photos; so the sharper ones of many count. An edge too wide to be told is looked at in a picture
half as large.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels
from ...base.pixels import unit_pixels

NARROW, WIDE = 1.0, 2.0  # px, the two blurs
MOST_LEVELS = 4  # pictures, each half as large as the one before
WIDEST = 2.2  # px of a level: a wider edge is looked at in the next one
STRONGEST = 0.5  # x the strongest gradients of a level: weaker ones are shading and texture
FAINTEST = 0.008  # encoded light per px, a gradient that is an edge
NOISY = 6.0  # x the noise's own gradient, likewise
ENOUGH, FEWEST = 30, 10  # edges that say something together: px of them, and in small pictures
SHARPER = 45  # percentile of their widths that counts
STEPS = np.array([[0, 1], [1, 1], [1, 0], [1, -1]])  # rows and columns, by the gradient's direction


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a picture, and how blurred each is."""

    blur: F64  # (n,) px, standard deviation

    scale: int  # px of the picture per px of the one they were found in

    def typical(self) -> float | None:
        """The blur that the sharper ones have; None of too few, or where it is too wide to tell."""
        if len(self.blur) < max(ENOUGH / self.scale, FEWEST):
            return None
        blur = float(np.percentile(self.blur, SHARPER))
        return blur if blur < WIDEST * self.scale else None


def measure_blur(pixels: Pixels, asked: Mask) -> float | None:
    """Px, standard deviation of the blur of a picture (h, w, 3) where it is `asked` (h, w).

    None where too few edges tell.
    """
    for edges in find_edges(pixels, asked):
        if (found := edges.typical()) is not None:
            return found
    return None


def find_edges(pixels: Pixels, asked: Mask) -> list[Edges]:
    """The edges of a picture (h, w, 3) that lie where it is `asked`, of each size of it."""
    light = unit_pixels(pixels).mean(-1)
    found, scale = [], 1
    for _ in range(MOST_LEVELS):
        if min(light.shape) < 8 or not asked.any():
            break
        found.append(_edges(light, asked, scale))
        size = (max(light.shape[1] // 2, 1), max(light.shape[0] // 2, 1))
        light = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA), np.float32)
        shown = asked.astype(np.float32)
        asked = np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_AREA) > 0.99)
        scale *= 2
    return found


def _edges(light: F32, asked: Mask, scale: int) -> Edges:
    """Of one level (h, w), `scale` px of the picture per px of it."""
    across, down, narrow = _gradient(light, NARROW)
    wide = _gradient(light, WIDE)[2]
    some = narrow[asked]
    least = max(FAINTEST, NOISY * _noise(light, asked), STRONGEST * np.percentile(some, 98))
    ys, xs = np.nonzero(asked & (narrow > least))
    step = STEPS[np.rint(np.arctan2(down, across)[ys, xs] / (np.pi / 4)).astype(int) % 4]
    at = narrow[ys, xs]
    top = at >= np.maximum(_beside(narrow, ys, xs, step), _beside(narrow, ys, xs, -step))
    ys, xs = ys[top], xs[top]
    square = (narrow[ys, xs] / np.maximum(wide[ys, xs], 1e-9)) ** 2
    blur = np.sqrt(
        np.maximum(WIDE**2 - square * NARROW**2, 0) / np.maximum(square - 1, 1e-6)
    ).astype(np.float64)
    blur = np.minimum(blur, 2 * WIDEST)
    # A px of a smaller picture is the mean of several, which blurs it, too.
    own = np.sqrt(np.maximum(blur**2 * scale**2 - (scale**2 - 1) / 12, 0))
    return Edges(own, scale)


def _gradient(light: F32, sigma: float) -> tuple[F32, F32, F32]:
    """To the right, down, and its length, of a picture blurred by so much; per px."""
    smooth = cv2.GaussianBlur(light, (0, 0), sigma)
    across = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8), np.float32)
    down = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8), np.float32)
    return across, down, np.hypot(across, down)


def _beside(values: F32, ys: np.ndarray, xs: np.ndarray, step: np.ndarray) -> F32:
    """A picture's values one step from some of its pixels; its border's beyond it."""
    height, width = values.shape
    return values[(ys + step[:, 0]).clip(0, height - 1), (xs + step[:, 1]).clip(0, width - 1)]


def _noise(light: F32, asked: Mask) -> float:
    """Standard deviation of the gradient that noise alone has in the narrowly blurred picture."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    fine = cv2.filter2D(light, cv2.CV_32F, kernel)
    deviation = float(np.median(np.abs(fine[asked]))) / 0.6745
    return deviation / (np.sqrt(8 * np.pi) * NARROW**2)
