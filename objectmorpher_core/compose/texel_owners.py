"""Which surface of an object a texel of the photo shows, so that paint on it colours no other.

At rest a texel shows what is nearest to the photo's camera there. Gaussians elsewhere may look it
up as well: those of a soft edge that reaches over what lies behind, and fans out over a side that
comes into view. A stroke on that side must not colour the texel, whose owner is another surface.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ..base.arrays import F32, Mask
from ..base.camera import Camera
from ..base.poisson_disk import nearest_in
from ..raster import tiles
from ..raster.posed import SURFACE_GAP, PosedSplats, RestSplats
from ..raster.texture import TextureLevels
from .blend import Box

PER_SPACING = 2.0  # px of the picture at rest: Gaussians are no finer
SURE = 0.5  # alpha from which a pixel shows the surface


@dataclass(frozen=True, eq=False)
class ShownSurface:
    """What of the surface a picture shows: places at rest, object frame."""

    places: F32  # (h, w, 3) and of the nearest surface, where a pixel shows none
    is_there: Mask  # (h, w)
    depth: F32  # (h, w) world units; 0 where nothing is

    @staticmethod
    def of(
        splats: PosedSplats, texture: TextureLevels, window: Camera, camera: Camera, box: Box | None
    ) -> ShownSurface:
        """As `window` shows it in a `box`; `camera` is the photo's."""
        means = splats.rest.means
        low, size = means.min(0), np.maximum(np.ptp(means, axis=0), 1e-12)
        coloured = splats.painted((means - low) / size)
        drawn = tiles.draw(tiles.prepare(coloured, window, camera), texture, box)
        is_there = drawn.alpha > SURE
        places = drawn.color / np.maximum(drawn.alpha, 1e-6)[..., None] * size + low
        if is_there.any() and not is_there.all():
            places = places.reshape(-1, 3)[nearest_in(is_there)]
        depth = np.where(np.isfinite(drawn.depth), drawn.depth, 0)
        return ShownSurface(places.astype(np.float32), is_there, depth.astype(np.float32))


@dataclass(frozen=True, eq=False)
class TexelOwners:
    """The surface that the photo showed at each place, as finely as Gaussians lie."""

    surface: ShownSurface
    scale: float  # px of the picture for one of the photo
    left: float  # px of the photo, its corner
    top: float
    gap: float  # object units, from which on two places are of different surfaces

    @staticmethod
    def of(rest: RestSplats, texture: TextureLevels) -> TexelOwners:
        """Of all that lies in the photo's part of the `texture`."""
        own = rest.camera
        xy = own.project(rest.lifted.world_points(rest.means))
        low, high = np.floor(xy.min(0)) - 1, np.ceil(xy.max(0)) + 1
        scale = min(1.0, PER_SPACING / rest.spacing_px)
        width, height = (max(int(np.ceil(scale * n)), 1) for n in high - low)
        cx, cy = scale * (own.cx - low[0]), scale * (own.cy - low[1])
        window = Camera(scale * own.focal, cx, cy, width, height)
        at_rest = PosedSplats(rest, None, np.eye(4))
        surface = ShownSurface.of(at_rest, texture, window, own, None)
        left, top = (float(v) for v in low)
        return TexelOwners(surface, scale, left, top, SURFACE_GAP * rest.lifted.spacing)

    def are_others(self, texels: np.ndarray, places: np.ndarray) -> Mask:
        """(...) which texels (..., 2), px of the photo, show another surface than at `places`.

        Those are (..., 3) at rest, object frame.
        """
        at = np.floor((texels - [self.left, self.top]) * self.scale).astype(np.int64)
        height, width = self.surface.is_there.shape
        column, row = at[..., 0], at[..., 1]
        is_inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        column, row = column.clip(0, width - 1), row.clip(0, height - 1)
        away = np.linalg.norm(self.surface.places[row, column] - places, axis=-1)
        return np.asarray(is_inside & self.surface.is_there[row, column] & (away > self.gap))


AROUND = (-1.0, 0.0, 1.0)  # x spacing, to either side of what a Gaussian's mean shows


@dataclass(frozen=True, eq=False)
class Strays:
    """The Gaussians of an object that show what belongs to another surface of it."""

    owners: TexelOwners
    rest: RestSplats
    is_stray: Mask  # (N,) they do, if they show the photo

    @staticmethod
    def of(rest: RestSplats, texture: TextureLevels) -> Strays:
        owners = TexelOwners.of(rest, texture)
        return Strays(owners, rest, owners.are_others(rest.lifted.texture.u0, rest.means))

    def meet(self, painted: Mask, left: int, top: int) -> Mask:
        """(N,) which show texels of another surface that are `painted` (h, w).

        `left`, `top`: px of the photo, their corner.
        """
        found, (height, width) = np.zeros(len(self.rest), bool), painted.shape
        index = np.flatnonzero(self.is_stray)
        for step in itertools.product(AROUND, AROUND):
            texels = self.rest.lifted.texture.u0[index] + self.rest.spacing_px * np.array(step)
            column, row = (np.floor(texels).astype(np.int64) - [left, top]).T
            there = (column >= 0) & (row >= 0) & (column < width) & (row < height)
            there[there] = painted[row[there], column[there]]
            others = self.owners.are_others(texels[there], self.rest.means[index[there]])
            found[index[there][others]] = True
        return found
