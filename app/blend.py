"""Where the view shows the edit and where the photo: the export's own rule, quick and coarse.

The composite keeps the photo wherever nothing moved, so that an object that is bent at one end
shows no seam at the other. The export decides that per pixel; the view by the Gaussians that are
not where they were, on a grid, with the same margin around them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.arrays import F32, F64
from objectmorpher_core.document import Document

from .view import View

if TYPE_CHECKING:
    from .derived import Derived

CELL = 4  # canvas px, of the grid
TOLERANCE = 0.25  # canvas px: a Gaussian that moved less is where it was
REACH = 1.2  # x the spacing of the Gaussians, how far around itself each one counts


def build_blend(derived: Derived, document: Document, view: View) -> F32:
    """(h, w) in [0, 1] on a grid over the canvas: 1 shows the edit, 0 the photo."""
    from objectmorpher_core.compose import composite
    from objectmorpher_core.compose.order import leaves_a_hole
    from objectmorpher_core.compose.plate import hole_margin

    height, width = -(-view.height // CELL), -(-view.width // CELL)
    distance = np.full((height, width), 1e9, np.float32)  # photo px to what moved
    camera = document.photo.camera
    for k, thing in enumerate(document.objects):
        if thing.lifted is None or not thing.is_moved:
            continue
        splats = derived.draft(document, k)
        rest = splats.rest.lifted.texture.u0.astype(np.float64)
        now = camera.project(splats.means) if thing.is_visible else None
        points = _moved_points(rest, now, max(composite.STILL, TOLERANCE / view.zoom))
        if not leaves_a_hole(document.objects, k):  # a copy of it is still there
            points = rest[:0] if now is None else now
        reach = REACH * splats.rest.spacing_px * max(thing.placement.scale, 1.0)
        if len(points):
            distance = np.minimum(distance, _distance(points, view, (height, width)) - reach)
    margin = document.feather * hole_margin(*document.photo.size)
    ramp = (1 - composite.FEATHER_START) * margin
    blend = np.clip((margin - distance) / ramp, 0, 1).astype(np.float32)
    return np.maximum(blend, derived.lights.touched(document, view, CELL))


def _moved_points(rest: F64, now: F64 | None, tolerance: float) -> F64:
    """Image px (N, 2) that Gaussians moved from and to; all of `rest` where none is shown now."""
    if now is None:
        return rest
    is_moved = ~(np.linalg.norm(now - rest, axis=1) <= tolerance)
    return np.concatenate([rest[is_moved], now[is_moved]])


def _distance(points: F64, view: View, shape: tuple[int, int]) -> F32:
    """(h, w) photo px from each cell to the nearest of the points on the canvas or beside it."""
    pad = 32  # cells around the canvas, for points beside it
    cells = np.floor(view.canvas_from_image(points) / CELL).astype(np.int64) + pad
    height, width = shape[0] + 2 * pad, shape[1] + 2 * pad
    inside = ((cells >= 0) & (cells < (width, height))).all(1)
    free = np.ones((height, width), np.uint8)
    free[cells[inside, 1], cells[inside, 0]] = 0
    if free.all():
        return np.full(shape, 1e9, np.float32)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, 5)
    return distance[pad:-pad, pad:-pad] * (CELL / view.zoom)
