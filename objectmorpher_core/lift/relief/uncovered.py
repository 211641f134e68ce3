"""A picture of the part of an object that another one stands before.

Beside a cup a Gaussian of its saucer would carry the cup's rim along: it does not show the photo.
What lies beneath the cup cannot. Both have a picture instead, in which the photo goes on up to the
very line where the parts meet, and beyond it what the saucer looks like elsewhere. The cup's own
end carries the photo: where it shows some of the saucer, the saucer is beside it.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...base.arrays import F64, U8, Mask
from ...base.camera import Camera
from ...document.model import LiftedObject, Matte
from ...document.sides import Sides
from ...raster.posed import projection_jacobians
from .body import FRONT, ReliefBody
from .canvas import bilinear
from .colours import fill_in
from .sides import GAP
from .spreading import SurfacePoints

LONGEST = 1600.0  # px, longer side of the picture
AROUND = 4.0  # x mean spacing, that it shows around its Gaussians
MIXED = 0.4  # x mean spacing beside the line where parts meet, in which the photo shows both
APART = 2.0  # x mean spacing beyond that line, from which colours of what is like it count
EDGE_ON = 0.1  # of a normal towards the camera: what is seen so is not in the picture
COVERED = 0.5  # of the matte, from which the photo shows the object
FEWEST = 3  # Gaussians


def with_uncovered(
    lifted: LiftedObject,
    surface: SurfacePoints,
    spacing: float,
    body: ReliefBody,
    matte: Matte,
    camera: Camera,
) -> LiftedObject:
    """`lifted` with a picture of its part that another one of its `body` stands before.

    Its Gaussians are the points of the `surface`, a mean `spacing` px apart.
    """
    is_hidden = surface.is_front & ~surface.is_seen & ~surface.is_brim
    is_hidden &= surface.normals[:, 2] > EDGE_ON
    is_end = is_hidden & _is_nearest(surface, body)
    own = np.flatnonzero(is_hidden & ~is_end)
    if len(own) < FEWEST:
        return lifted
    pixels, scale, first = _picture(surface, own, spacing, body, matte)
    left, top = matte.left, matte.box[3] + GAP
    world = lifted.world_points(lifted.gaussians.means[own])
    count, texture = len(lifted.gaussians), lifted.texture
    at, slopes = np.zeros((count, 2), np.float32), np.zeros((count, 2, 3), np.float32)
    zoom = np.zeros(count, np.float32)
    at[own] = scale * (texture.u0[own] - first) + [left, top]
    slopes[own] = projection_jacobians(world, scale * camera.focal)
    zoom[own] = scale * camera.focal / world[:, 2]
    visibility = np.where(is_end, np.float32(1), texture.visibility)
    return replace(
        lifted,
        texture=replace(texture, visibility=visibility),
        sides=Sides(pixels, left, top, at, slopes, zoom),
    )


def _is_nearest(surface: SurfacePoints, body: ReliefBody) -> Mask:
    """(N,) which points are of the part that stands before another, not beneath it."""
    outline, inner, behind = body.silhouette, body.overlaps, body.behind
    assert inner is not None and behind is not None, "parts are known"
    at = outline.grid_xy(surface.xy)
    stands = bilinear(behind.stands.astype(np.float32), at) > 0.5
    off = np.abs(surface.height - body.height(surface.xy, FRONT))
    return np.asarray(stands & (off <= np.abs(surface.height - bilinear(inner.beneath, at))))


def _picture(
    surface: SurfacePoints, own: np.ndarray, spacing: float, body: ReliefBody, matte: Matte
) -> tuple[U8, float, F64]:
    """(h, w, 3) sRGB for the points `own` (n,), its px per px of the photo, and its corner."""
    outline, behind, xy = body.silhouette, body.behind, surface.xy[own]
    assert behind is not None, "parts are known"
    first = np.floor(xy.min(0) - AROUND * spacing)
    size = np.ceil(xy.max(0) + AROUND * spacing) - first
    scale = min(1.0, LONGEST / float(size.max()))
    width, height = np.maximum(np.ceil(scale * size), 2).astype(int)
    # Centres of its pixels, px of the photo.
    places = (np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) + 0.5) / scale + first
    looks = (places - [matte.left, matte.top] - 0.5).astype(np.float32)
    colors, alpha = (
        cv2.remap(
            image, looks[..., 0], looks[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        for image in (matte.foreground, matte.alpha)
    )
    grid = outline.grid_xy(places).astype(np.float32)
    part = (outline.inside & ~behind.stands).astype(np.float32)
    is_part = cv2.remap(part, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR) > 0.5
    away, within = (
        cv2.distanceTransform(beyond.astype(np.uint8), cv2.DIST_L2, 5) / scale
        for beyond in (~is_part, is_part)
    )
    known = (within > MIXED * spacing + 0.5 * outline.cell) & (alpha > COVERED)
    column, row = np.floor(scale * (xy - first)).astype(int).T
    far = away[row, column] > APART * spacing
    row, column = row[far], column[far]
    like = surface.color_xy[own[far]] - [matte.left, matte.top] - 0.5
    colors[row, column], known[row, column] = bilinear(matte.foreground, like), True
    filled = fill_in(np.asarray(colors, np.float32), known)
    return np.rint(255 * filled.clip(0, 1)).astype(np.uint8), scale, first
