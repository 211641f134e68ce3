"""The part of the picture that an object covers, at a resolution that costs a few milliseconds.

Shadow and light follow from it. It depends on the document alone, not on the view: so what the
window shows of them is what is exported.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import F32, F64, Mask
from ..base.camera import Camera
from ..base.masks import box_of
from ..raster.posed import PosedSplats
from .blend import Box

FINE = 176  # px, longer side of a silhouette
COARSE = 48  # px, of a sketch
SOLID = 0.5  # of a Gaussian: others lie beside the object, to carry its soft edge
PER_CELL = 1.5  # Gaussians, so that no holes are left
SKETCHED = 4000  # Gaussians in a sketch
AROUND = 2.0  # x the spacing of the Gaussians, how far the object may reach past their middles


Corners = tuple[tuple[float, float], tuple[float, float]]  # photo px


@dataclass(frozen=True, eq=False)
class Silhouette:
    """An object's alpha on a grid of its own."""

    alpha: F32  # (h, w) in [0, 1]
    left: float  # photo px, its corner; may be beside the photo
    top: float
    pitch: float  # photo px per px of the grid


@dataclass(frozen=True)
class SilhouetteGrid:
    """A window on what the photo's camera sees, about an object."""

    left: float  # photo px, its corner; may be beside the photo
    top: float
    pitch: float  # photo px per px of the grid
    width: int
    height: int

    def camera(self, camera: Camera) -> Camera:
        """Return the camera that sees it."""
        return camera.windowed(self.left, self.top, self.width, self.height, 1 / self.pitch)

    def cells(self, means: F64, camera: Camera) -> tuple[np.ndarray, Mask]:
        """Number of the cell (n,) in which each world point (N, 3) is seen; those (N,) that are."""
        is_there = means[:, 2] > 0
        x, y = ((camera.project(means[is_there]) - (self.left, self.top)) / self.pitch).T
        is_inside = (x >= 0) & (y >= 0) & (x < self.width) & (y < self.height)
        index = y[is_inside].astype(np.int64) * self.width + x[is_inside].astype(np.int64)
        is_there[is_there] = is_inside
        return index, is_there


def sketch(splats: PosedSplats, camera: Camera) -> Silhouette | None:
    """The object as the photo's camera sees it; None where it is not seen.

    It takes a millisecond: where some of the Gaussians are, and close around them.
    """
    few = sketched(splats)
    grid = sketch_grid(splats, few, camera)
    if grid is None:
        return None
    index, _ = grid.cells(splats.means[few], camera)
    count = np.bincount(index, minlength=grid.width * grid.height).reshape(grid.height, grid.width)
    around = cv2.blur(count.astype(np.float32), (3, 3), borderType=cv2.BORDER_CONSTANT)
    usual = float(np.median(around[around > 0])) if len(index) else 1.0
    alpha = np.clip(2 * around / usual, 0, 1).astype(np.float32)
    return Silhouette(alpha, grid.left, grid.top, grid.pitch)


def sketched(splats: PosedSplats, most: int = SKETCHED) -> np.ndarray:
    """Which of the Gaussians a sketch is made of, about `most` of those that are solid."""
    solid = np.flatnonzero(splats.rest.lifted.texture.solidity > SOLID)
    return solid[:: max(len(solid) // most, 1)]


def fine_grid(splats: PosedSplats, camera: Camera) -> SilhouetteGrid | None:
    """About all of an object; None where it is not seen."""
    return _grid(_box(splats, camera, splats.means), FINE, 1.0)


def sketch_grid(splats: PosedSplats, few: np.ndarray, camera: Camera) -> SilhouetteGrid | None:
    """About the Gaussians `few`, with a few of them in each cell."""
    box = _box(splats, camera, splats.means[few])
    if box is None:
        return None
    (left, top), (right, bottom) = box
    return _grid(box, COARSE, float(np.sqrt(PER_CELL * (right - left) * (bottom - top) / len(few))))


def _grid(box: Corners | None, most: int, least: float) -> SilhouetteGrid | None:
    """Of at most `most` px, none smaller than `least` px of the photo, nor than one."""
    if box is None:
        return None
    (left, top), (right, bottom) = box
    pitch = max((right - left) / most, (bottom - top) / most, least, 1.0)
    return SilhouetteGrid(
        left, top, pitch, _cells(right - left, pitch), _cells(bottom - top, pitch)
    )


def _cells(length: float, pitch: float) -> int:
    """Of a grid, so that they cover `length` photo px."""
    return max(int(np.ceil(length / pitch)), 1)


def _box(splats: PosedSplats, camera: Camera, means: F64) -> Corners | None:
    """Corners around Gaussians with these `means` (N, 3), see `box_around`."""
    return box_around(means, camera, AROUND * splats.rest.spacing * splats.scale)


def box_around(points: F64, camera: Camera, reach: float) -> Corners | None:
    """Corners around world points (N, 3) that reach so far, world units; photo px.

    None farther beside the photo than that is large; None at all where nothing is seen.
    """
    points = points[points[:, 2] > 0]
    if not len(points):
        return None
    seen, size = camera.project(points), np.array([camera.width, camera.height], np.float64)
    zoom = camera.focal / max(float(np.median(points[:, 2])), 1e-9)
    reach = reach * zoom + 2
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
    rows, down = cell_places(y0, y1, corner[1], pitch, values.shape[0])
    columns, across = cell_places(x0, x1, corner[0], pitch, values.shape[1])
    above, below = padded[rows], padded[rows + 1]
    lines = above + down[:, None] * (below - above)
    near, far = lines[:, columns], lines[:, columns + 1]
    return np.asarray(near + across * (far - near), np.float32)


def cells_bounds(
    values: F32, corner: tuple[float, float], pitch: float, size: tuple[int, int]
) -> Box:
    """x0, y0, x1, y1 px around what of a grid is not 0, in a photo of that size (w, h); else 0s.

    The grid's `corner` is at photo px.
    """
    left, top, right, bottom = box_of(values)
    if left == right:
        return 0, 0, 0, 0
    x0, x1 = (corner[0] + pitch * column for column in (left - 1, right + 1))
    y0, y1 = (corner[1] + pitch * row for row in (top - 1, bottom + 1))
    width, height = size
    return (
        int(np.clip(np.floor(x0), 0, width)), int(np.clip(np.floor(y0), 0, height)),
        int(np.clip(np.ceil(x1), 0, width)), int(np.clip(np.ceil(y1), 0, height)),
    )  # fmt: skip


def cell_places(
    first: int, last: int, start: float, pitch: float, count: int
) -> tuple[np.ndarray, F32]:
    """Return the places of the pixels first..last on an axis of `count` cells, one more each side.

    The cell before each (n,), and how far on the way to the next it is (n,).
    """
    at = (np.arange(first, last) + 0.5 - start) / pitch + 0.5
    at = np.clip(at, 0, count + 1)
    index = np.minimum(at.astype(np.int64), count)
    return index, (at - index).astype(np.float32)
