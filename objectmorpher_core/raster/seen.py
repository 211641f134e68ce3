"""Which points of an object's surface are seen, and not behind another part of it."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64, Mask
from ..base.camera import Camera
from . import tiles
from .posed import PosedSplats
from .texture import TextureLevels

LONGER_SIDE = 360.0  # px of the picture whose depths tell what hides what
SLACK = 0.04  # x diameter behind the surface that is seen there: still the same surface
LEAST_ALPHA = 0.5


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
    is_there = (picture.alpha[row, column] > LEAST_ALPHA) & np.isfinite(picture.depth[row, column])
    lifted = splats.rest.lifted
    behind = points[:, 2] - picture.depth[row, column]
    is_hidden = is_there & (behind > SLACK * lifted.diameter * lifted.scale)
    return is_facing & ~is_hidden
