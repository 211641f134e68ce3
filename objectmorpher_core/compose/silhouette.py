"""What of the picture an object covers, at a resolution that costs a few milliseconds.

Shadow and light follow from it. It depends on the document alone, not on the view: so what the
window shows of them is what is exported.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import F32, F64
from ..camera import Camera
from ..raster import tiles
from ..raster.posed import PosedSplats
from ..raster.texture import TextureLevels
from .blend import Box

FINE = 176  # px, longer side of a silhouette
COARSE = 48  # px, of a sketch
SOLID = 0.5  # of a Gaussian: others lie beside the object, to carry its soft edge
PER_CELL = 1.5  # Gaussians, so that no holes are left
SKETCHED = 4000  # Gaussians in a sketch
AROUND = 2.0  # x the spacing of the Gaussians, how far the object may reach past their middles


@dataclass(frozen=True, eq=False)
class Silhouette:
    """An object's alpha on a grid of its own."""

    alpha: F32  # (h, w) in [0, 1]
    left: float  # photo px, its corner; may be beside the photo
    top: float
    pitch: float  # photo px per px of the grid


def silhouette(splats: PosedSplats, texture: TextureLevels, camera: Camera) -> Silhouette | None:
    """The object as the photo's `camera` sees it; None where it is not seen."""
    box = _box(splats, camera, splats.means)
    if box is None:
        return None
    (left, top), (right, bottom) = box
    pitch = max((right - left) / FINE, (bottom - top) / FINE, 1.0)
    width, height = _cells(right - left, pitch), _cells(bottom - top, pitch)
    window = camera.windowed(left, top, width, height, 1 / pitch)
    drawn = tiles.draw_rgba(tiles.prepare(splats, window, camera), texture)
    alpha = drawn[..., 3].astype(np.float32) / np.float32(255)
    return Silhouette(alpha, left, top, pitch)


def sketch(splats: PosedSplats, camera: Camera) -> Silhouette | None:
    """The same in a millisecond: where some of the Gaussians are, and close around them."""
    solid = np.flatnonzero(splats.rest.lifted.texture.solidity > SOLID)
    means = splats.means[solid[:: max(len(solid) // SKETCHED, 1)]]
    found = _box(splats, camera, means)
    if found is None:
        return None
    (left, top), (right, bottom) = found
    few = float(np.sqrt(PER_CELL * (right - left) * (bottom - top) / len(means)))
    pitch = max((right - left) / COARSE, (bottom - top) / COARSE, few, 1.0)
    width, height = _cells(right - left, pitch), _cells(bottom - top, pitch)
    seen = camera.project(means[means[:, 2] > 0])
    x, y = ((seen - (left, top)) / pitch).T
    is_inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    index = y[is_inside].astype(np.int64) * width + x[is_inside].astype(np.int64)
    count = np.bincount(index, minlength=width * height).reshape(height, width)
    around = cv2.blur(count.astype(np.float32), (3, 3), borderType=cv2.BORDER_CONSTANT)
    usual = float(np.median(around[around > 0])) if len(index) else 1.0
    return Silhouette(np.clip(2 * around / usual, 0, 1).astype(np.float32), left, top, pitch)


def _cells(length: float, pitch: float) -> int:
    """Of a grid, so that they cover `length` photo px."""
    return max(int(np.ceil(length / pitch)), 1)


def _box(
    splats: PosedSplats, camera: Camera, means: F64
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Corners around `means` (N, 3), photo px; none farther beside the photo than that is large."""
    means = means[means[:, 2] > 0]
    if not len(means):
        return None
    seen, size = camera.project(means), np.array([camera.width, camera.height], np.float64)
    zoom = camera.focal / max(float(np.median(means[:, 2])), 1e-9)
    reach = AROUND * splats.rest.spacing * splats.scale * zoom + 2
    low = np.maximum(np.floor(seen.min(0) - reach), -size)
    high = np.minimum(np.ceil(seen.max(0) + reach), 2 * size)
    if (high <= low).any():
        return None
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def sampled(values: F32, corner: tuple[float, float], pitch: float, box: Box) -> F32:
    """A grid (h, w) whose `corner` is at photo px, at the pixels of a `box` of the photo.

    Linear between its pixels, 0 beyond them.
    """
    x0, y0, x1, y1 = box
    padded = np.pad(values, 1)

    def places(first: int, last: int, start: float, count: int) -> tuple[np.ndarray, np.ndarray]:
        at = (np.arange(first, last) + 0.5 - start) / pitch + 0.5  # in the padded grid
        at = np.clip(at, 0, count + 1)
        index = np.minimum(at.astype(np.int64), count)
        return index, (at - index).astype(np.float32)

    rows, down = places(y0, y1, corner[1], values.shape[0])
    columns, across = places(x0, x1, corner[0], values.shape[1])
    above, below = padded[rows], padded[rows + 1]
    lines = above + down[:, None] * (below - above)
    near, far = lines[:, columns], lines[:, columns + 1]
    return np.asarray(near + across * (far - near), np.float32)
