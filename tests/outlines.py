"""What an object covers, drawn by the rasteriser; and flat things that stand on the ground."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.shadow.shadow import StandingObject
from objectmorpher_core.compose.silhouette import Silhouette, fine_grid
from objectmorpher_core.document.placement import ground_normal
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.texture import TextureLevels

DISTANCE = 3.0  # world units


def silhouette(splats: PosedSplats, texture: TextureLevels, camera: Camera) -> Silhouette | None:
    """The object as the photo's `camera` sees it; None where it is not seen."""
    grid = fine_grid(splats, camera)
    if grid is None:
        return None
    drawn = tiles.draw_rgba(tiles.prepare(splats, grid.camera(camera), camera), texture)
    alpha = drawn[..., 3].astype(np.float32) / np.float32(255)
    return Silhouette(alpha, grid.left, grid.top, grid.pitch)


def upright(mask: Mask, camera: Camera, ground: float, across: int = 60) -> F64:
    """(N, 3) points of a board of that outline (H, W) that stands on its lowest edge.

    The ground is seen from `ground` degrees above it; about `across` points are side by side.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    step = max(np.ptp(columns) / across, 0.2)
    x, y = np.meshgrid(
        np.arange(columns[0], columns[-1] + 1, step), np.arange(rows[0], rows[-1] + 1, step)
    )
    x, y = (v[mask[y.astype(int), x.astype(int)]] for v in (x, y))
    normal = ground_normal(camera, None, ground, float(rows[-1]))
    foot = camera.unproject(np.array([camera.cx, rows[-1] + 1.0]), DISTANCE)
    rays = camera.unproject(np.column_stack([x, y]), np.ones(len(x)))
    facing = np.cross([1.0, 0.0, 0.0], normal)  # across the board
    return rays * ((foot @ facing) / (rays @ facing))[:, None]


def standing(mask: Mask, camera: Camera, ground: float = 20.0) -> StandingObject:
    """Such a board."""
    rows = np.flatnonzero(mask.any(1))
    normal = ground_normal(camera, None, ground, float(rows[-1]))
    return StandingObject(upright(mask, camera, ground), normal, camera)
