"""Which point of a drawn object is seen at a place of the view.

The few Gaussians there are drawn once more, on one pixel around that very place, by the renderer's
own rules: a silhouette is where the picture ends, and what shows through a soft edge is picked
where it is the greater part. Beside the object, the nearest pixel of it within reach counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F64, I32, Mask, frozen
from ..base.camera import Camera
from ..base.kernel_files import numba
from . import tiles
from .posed import PosedSplats
from .rules import CUT, CX, CY, EX, EY, QXX, RYY, TILT, WEIGHT, ZX, ZY, Z
from .texture import TextureLevels
from .tiles import Drawable, draw

LEAST_ALPHA = 0.1  # of what can be picked: less is background
NEAR = 16  # Gaussians that are named, at most


@dataclass(frozen=True, eq=False)
class Hit:
    """A place of the surface."""

    xy: F64  # (2,) view px: the place asked for, or the nearest on the object
    depth: float  # world units, along z
    gaussians: I32  # (n,) those that make up the surface there, the weightiest first


def pick(
    drawable: Drawable, texture: TextureLevels, xy: tuple[float, float], reach: float = 0.0
) -> Hit | None:
    """Pick what is seen at `xy`, view px, or within `reach` px of it; None where that is nothing.

    The depth is that of the layer with which alpha, front to back, reaches a half.
    """
    at = np.asarray(xy, dtype=np.float64)
    near = _touching(drawable, at, reach + 2)
    if not len(near):
        return None
    hit = _probe(drawable, texture, at, near)
    if hit is not None or reach <= 0:
        return hit
    for beside in _nearest_pixels(drawable, texture, at, near, reach):
        hit = _probe(drawable, texture, beside, near)
        if hit is not None:
            return hit
    return None


def _touching(drawable: Drawable, at: F64, reach: float) -> I32:
    """Rows whose box comes within `reach` px of a place, in the order of drawing."""
    near = _near(drawable.projected, at[0], at[1], reach)
    if drawable.order is None:
        return near
    is_near = np.zeros(len(drawable.projected), bool)
    is_near[near] = True
    return drawable.order[is_near[drawable.order]].astype(np.int32)


@numba.njit(cache=True, nogil=True)
def _near(rows, x, y, reach):
    """Ascending; in one pass, because the pointer asks for it in every frame."""
    found = np.empty(len(rows), np.int32)
    count = 0
    for i in range(len(rows)):
        is_there = abs(rows[i, CX] - x) <= rows[i, EX] + reach
        if is_there and abs(rows[i, CY] - y) <= rows[i, EY] + reach and rows[i, WEIGHT] > 0:
            found[count] = i
            count += 1
    return found[:count].copy()


def _around(drawable: Drawable, near: I32, corner: F64, size: int) -> Drawable:
    """The Gaussians `near` on a view of `size` px squared whose corner is at `corner`."""
    rows = drawable.projected[near]
    rows[:, CX] -= corner[0]
    rows[:, CY] -= corner[1]
    camera = drawable.camera.windowed(float(corner[0]), float(corner[1]), size, size)
    order = None if drawable.order is None else np.arange(len(near), dtype=np.uint32)
    return replace(drawable, projected=frozen(rows), order=order, camera=camera)


def _probe(drawable: Drawable, texture: TextureLevels, at: F64, near: I32) -> Hit | None:
    """The surface at exactly this place."""
    picture = draw(_around(drawable, near, at - 0.5, 1), texture)
    depth = float(picture.depth[0, 0])
    if picture.alpha[0, 0] < LEAST_ALPHA or not np.isfinite(depth):
        return None
    rows = drawable.projected[near].astype(np.float64)
    dx, dy = at[0] - rows[:, CX], at[1] - rows[:, CY]
    q = rows[:, QXX] * (dx + rows[:, TILT] * dy) ** 2 + rows[:, RYY] * dy**2
    apart = np.abs(rows[:, Z] + rows[:, ZX] * dx + rows[:, ZY] * dy - depth)
    weights = rows[:, WEIGHT] * np.exp(-0.5 * q)
    # Another picture of the surface, or another surface, may lie within the gap: it counts less.
    weights *= (q < rows[:, CUT]) * np.maximum(1 - (apart / drawable.splats.gap) ** 2, 0) ** 2
    best = np.argsort(-weights, kind="stable")[:NEAR]
    return Hit(at, depth, near[best[weights[best] > 0]])


def _nearest_pixels(
    drawable: Drawable, texture: TextureLevels, at: F64, near: I32, reach: float
) -> F64:
    """(n, 2) view px: centres of the object's pixels within `reach`, the nearest first."""
    radius = int(np.ceil(reach))
    corner = np.floor(at) - radius
    side = 2 * radius + 1
    picture = draw(_around(drawable, near, corner, side), texture)
    rows, columns = np.nonzero((picture.alpha >= LEAST_ALPHA) & np.isfinite(picture.depth))
    centres = corner + np.column_stack([columns, rows]) + 0.5
    away = np.linalg.norm(centres - at, axis=1)
    order = np.argsort(away, kind="stable")
    return centres[order[away[order] <= reach]].astype(np.float64)


# Which points of an object's surface are seen, and not behind another part of it.

LONGER_SIDE = 360.0  # px of the picture whose depths tell what hides what
SLACK = 0.04  # x diameter behind the surface that is seen there: still the same surface
LEAST_SEEN_ALPHA = 0.5


def seen_points(
    splats: PosedSplats, texture: TextureLevels, camera: Camera, points: F64, normals: F64
) -> Mask:
    """(M,) whether surface points (M, 3), world, are seen by the photo's `camera`.

    Their `normals` (M, 3), outward, must face the camera, and nothing of the object may be in
    front of them.
    """
    is_facing = (normals * points).sum(1) < 0
    picture_xy = camera.project(points)
    low, high = picture_xy.min(0), picture_xy.max(0)
    zoom = LONGER_SIDE / max(float((high - low).max()), 1.0)
    width, height = (int(v) + 1 for v in np.ceil((high - low) * zoom) + 1)
    view = camera.windowed(float(low[0]), float(low[1]), width, height, zoom)
    picture = tiles.render(splats, texture, view, camera)
    column, row = ((picture_xy - low) * zoom).astype(int).T
    column, row = column.clip(0, width - 1), row.clip(0, height - 1)
    is_there = (picture.alpha[row, column] > LEAST_SEEN_ALPHA) & np.isfinite(
        picture.depth[row, column]
    )
    lifted = splats.rest.lifted
    behind = points[:, 2] - picture.depth[row, column]
    is_hidden = is_there & (behind > SLACK * lifted.diameter * lifted.scale)
    return is_facing & ~is_hidden
