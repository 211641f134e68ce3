"""The share of the edit and of the photo in each pixel of the view, by the export's rule, coarsely.

The composite keeps the photo wherever nothing moved, so that an object that is bent at one end
shows no seam at the other. The export decides that per pixel; the view by the Gaussians that are
not where they were, on a grid, with the same margin around them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.settings import AS_IN_THE_PHOTO

from ..editor.view import ViewState
from .layer import PosedObject

if TYPE_CHECKING:
    from objectmorpher_core.compose.light.lighting import Lit
    from objectmorpher_core.raster.posed import PosedSplats

CELL = 4  # canvas px, of the grid
TOLERANCE = 0.25  # canvas px: a Gaussian that moved less is where it was
PAD = 32  # cells around the canvas, for what is beside it
FAR = 1e9  # photo px
NOWHERE = np.empty((0, 3))
REACH = 1.2  # x the spacing of the Gaussians, how far around itself each one counts


def build_blend(
    document: Document, moved: Iterable[tuple[PosedObject, Lit]], view: ViewState, touched: F32
) -> F32:
    """(h, w) in [0, 1] on a grid over the canvas: 1 shows the edit, 0 the photo.

    `moved` are the document's moved objects, also hidden ones; `touched`: see `Lights.touched`.
    """
    from objectmorpher_core.compose import composite
    from objectmorpher_core.compose.light.defocus import reach_of
    from objectmorpher_core.compose.order import leaves_a_hole
    from objectmorpher_core.compose.plate.plate import hole_margin

    distance = np.full(touched.shape, FAR, np.float32)  # photo px to what moved
    for own, lit in moved:
        splats, item = own.draft, own.item
        world = splats.means if item.is_visible else NOWHERE
        # What moved leaves a hole, unless a copy of it is still there.
        has_left = leaves_a_hole(document.objects, own.k)
        reach = REACH * splats.rest.spacing_px * max(item.placement.scale, 1.0)
        reach *= document.photo.camera.focal / splats.rest.camera.focal
        reach += reach_of(lit.blur)
        least = max(composite.STILL, TOLERANCE / view.zoom) ** 2
        if item.finish != AS_IN_THE_PHOTO or item.is_visitor:
            least = -1.0  # also what has not moved
        mark = (least, has_left)
        apart = _distance(splats, world, document.photo.camera, view, mark)
        distance = np.minimum(distance, apart - reach)
    margin = document.feather * hole_margin(*document.photo.size)
    ramp = (1 - composite.FEATHER_START) * margin
    blend = np.clip((margin - distance) / ramp, 0, 1).astype(np.float32)
    return np.maximum(blend, touched)


def _distance(
    splats: PosedSplats,
    world: F64,
    camera: Camera,
    view: ViewState,
    mark: tuple[float, bool],
) -> F32:
    """(h, w) photo px from each cell to what moved, on the canvas or a little beside it.

    `mark`: the squared photo px from which on a Gaussian has moved, and whether it has left a hole.
    """
    from .moved_cells import mark_moved

    height, width = -(-view.height // CELL), -(-view.width // CELL)
    free = np.ones((height + 2 * PAD, width + 2 * PAD), np.uint8)
    scale = view.zoom / CELL
    lens = (camera.focal, camera.cx, camera.cy)
    corner = (view.left - PAD / scale, view.top - PAD / scale)
    mark_moved(
        free, splats.rest.lifted.texture.u0, world, lens, corner, scale,
        *mark,
    )  # fmt: skip
    if free.all():
        return np.full((height, width), FAR, np.float32)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)
    return distance[PAD:-PAD, PAD:-PAD] / np.float32(scale)
