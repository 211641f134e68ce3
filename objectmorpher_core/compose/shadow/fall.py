"""What a shadow falls on beside the plane ground: other objects, and what a depth map shows.

The light is parallel. So a place at some height above the ground lies in shadow exactly where the
ground, that the light through it would meet, lies in the shadow of what is higher than it. The
ground's shadow is made for a few such heights, and each place looks between two of them.

A lift knows no distance: every object is lifted at the same one. What stands in the shadow of a
thing is taken to stand on the same ground, and so much farther or nearer; where the thing is seen
to stand on it, both touch there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from ...base.arrays import F32, F64, Mask
from ...document.settings import Shadow
from ..silhouette import SilhouetteGrid, box_around
from .shadow import BAND, FINE, SPRAY, FlatShadow, Shade, StandingObject, opacity, trimmed
from .shadow_fit import regressed

HEIGHTS = (0.0, BAND, 0.2, 0.4, 0.6, 0.8, 1.0)  # x the caster's, above the ground
ROUGH = (0.0, 0.5, 1.0)  # the same, of a sketch
TERMINATOR = 0.2  # cosine with the light's way, over which a surface turns out of it
AT_FOOT = 0.08  # x the caster's height: what is seen so near its foot may carry it
FLAT = 0.06  # x the caster's height: what rises less is the ground
FARTHEST = 40.0  # x as far as the foot: no shadow is seen there
LOOKED = 24  # places across the ground before a foot, and as many along it
EIGHTH = 8  # one point in so many is enough to find where a shadow is
ROOM = 0.15  # x the caster's height, around those at least
FEWEST = 4  # Gaussians that must be seen there


@dataclass(frozen=True, eq=False)
class Caster:
    """An object and the shadow that it throws."""

    shadow: Shadow
    standing: StandingObject
    horizon: float | None = None  # px, where it is known
    cells: int = FINE
    seen: F32 | None = None  # (h, w) the photo's inverse depth, see `Document.depth`

    @cached_property
    def shade(self) -> Shade | None:
        """What falls on the ground, and on what rises from it; None where nothing does."""
        if self._flat is None:
            return None
        plain = self._flat.shade(self.shadow, self.standing, self.horizon)
        if self.seen is None or min(self.standing.depth, self.standing.foot[2]) <= 0:
            return plain
        if (corners := self._box) is None or (scale := self._scale()) is None:
            return plain
        (left, top), (right, bottom) = corners
        pitch = max((right - left) / self.cells, (bottom - top) / self.cells, 1.0)
        width, height = (int(np.ceil(a / pitch)) + 1 for a in (right - left, bottom - top))
        grid = SilhouetteGrid(left, top, pitch, width, height)
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        xy = np.column_stack([left + pitch * x.ravel(), top + pitch * y.ravel()])
        rays = self.standing.camera.unproject(xy, np.ones(len(xy)))
        inverse = np.maximum((self._seen_at(xy) - scale[1]) / scale[0], 1e-9)
        places, is_plain = self._met(rays, 1 / inverse)
        if is_plain.all():
            return plain
        alpha = self._opacity(*places).reshape(height, width)
        is_far = 1 / inverse > FARTHEST * self.standing.foot[2]
        alpha[is_far.reshape(height, width)] = 0
        return trimmed(alpha, grid, self.shadow.colour)

    def _seen_at(self, xy: np.ndarray) -> F64:
        """(N,) what the depth map says at photo px (N, 2)."""
        assert self.seen is not None
        size = np.array([self.standing.camera.width, self.standing.camera.height])
        x, y = (xy * self.seen.shape[::-1] / size - 0.5).T
        return map_coordinates(self.seen, [y, x], np.float64, order=1, mode="nearest")

    def _scale(self) -> tuple[float, float] | None:
        """Factor and shift of the inverse depth, by the ground before the foot; None: unknown."""
        standing, camera = self.standing, self.standing.camera
        foot, size = standing.foot, standing.height
        across = size * np.linspace(-1, 1, LOOKED)
        nearer = size * np.linspace(AT_FOOT, 1, LOOKED)
        way = np.cross(standing.normal, [1.0, 0.0, 0.0])
        a, b = (v.ravel()[:, None] for v in np.meshgrid(across, nearer))
        ground = foot + a * [1.0, 0.0, 0.0] + b * way
        ground += ((standing.depth - ground @ standing.normal)[:, None]) * standing.normal
        ground = ground[ground[:, 2] > 0.1 * foot[2]]
        xy = camera.project(ground)
        inside = ((xy > 0) & (xy < [camera.width, camera.height])).all(1)
        if inside.sum() < LOOKED:
            return None
        inverse = 1 / ground[inside, 2]
        basis = np.column_stack([inverse * foot[2], np.ones(len(inverse))])
        seen = self._seen_at(xy[inside])
        unit = max(float(np.ptp(seen)), 1e-9)
        found, _, _ = regressed(basis, seen / unit, np.ones(len(seen)))
        factor, shift = float(found[0]) * unit * foot[2], float(found[1]) * unit
        return (factor, shift) if factor > 0 else None

    def _met(self, rays: F64, depth: F64) -> tuple[tuple[F64, F64], Mask]:
        """Where the light through the surface at a `depth` (N,) on `rays` meets the ground (N, 3).

        How high above it the surface is (N,), and which of it is the ground itself.
        """
        standing = self.standing
        slope = rays @ standing.normal
        high = standing.depth - depth * slope
        on_ground = standing.depth / np.maximum(slope, 1e-6)
        risen = np.clip(np.abs(high) / (FLAT * standing.height) - 1, 0, 1) ** 2
        met = depth[:, None] * rays + high[:, None] * standing.ray(self.shadow)
        met += (1 - risen)[:, None] * (on_ground[:, None] * rays - met)
        return (met, high * risen), risen == 0

    def reaches(self, points: F64) -> bool:
        """Whether its shadow may be seen on an object of these points (N, 3)."""
        own, other = self._box, box_around(points, self.standing.camera, 0.0)
        if own is None or other is None:
            return False
        return all(own[0][a] < other[1][a] and other[0][a] < own[1][a] for a in (0, 1))

    def on(self, points: F64, normals: F64, body: F64) -> F32:
        """(N,) in [0, 1], how much of the shadow falls on an object's surface.

        Its `points` and outward `normals` (N, 3) are the world's; `body` (M, 3): what is solid.
        """
        times = self._beside(body)
        if times is None or self._flat is None:
            return np.zeros(len(points), np.float32)
        ray = self.standing.ray(self.shadow)
        facing = np.clip(-(normals @ ray) / (TERMINATOR * np.linalg.norm(ray)), 0, 1)
        high = self.standing.depth - times * (points @ self.standing.normal)
        met = times * points + high[:, None] * ray
        return (self._opacity(met, high) * facing).astype(np.float32)

    @cached_property
    def _box(self) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Around most of what lies between the object and where its shadow falls, photo px."""
        few = self.standing.lit(self.shadow)[::EIGHTH]
        room = max(ROOM, self.standing.room(self.shadow))
        return box_around(few, self.standing.camera, room * self.standing.height)

    def _beside(self, points: F64) -> float | None:
        """X its distance, how far away another object is; None where it has no ground with this."""
        standing, camera = self.standing, self.standing.camera
        foot, seen = standing.foot, points[points[:, 2] > 0]
        if foot[2] <= 0 or not len(seen):
            return None
        reach = AT_FOOT * standing.height * camera.focal / foot[2]
        away = np.abs(camera.project(seen) - camera.project(foot)).max(1)
        if (near := away < reach).sum() >= FEWEST:  # it stands on it
            return float(foot[2] / np.percentile(seen[near, 2], SPRAY))
        depth = float(np.percentile(points @ standing.normal, 100 - SPRAY))
        return standing.depth / depth if min(depth, standing.depth) > 0 else None

    @cached_property
    def _flat(self) -> FlatShadow | None:
        return FlatShadow.of(self.shadow, self.standing, self.cells)

    @cached_property
    def _volume(self) -> F32:
        """(levels, h, w) how opaque it is where the light would meet the ground."""
        assert self._flat is not None
        standing, shadow, grid = self.standing, self.shadow, self._flat.grid
        levels = [self._flat.alpha]
        for share in self._heights[1:-1]:
            far = standing.far(shadow, grid, share * standing.height)
            levels.append(opacity(shadow, far, 0.0))
        return np.stack([*levels, np.zeros_like(self._flat.alpha)])

    @property
    def _heights(self) -> tuple[float, ...]:
        return HEIGHTS if self.cells >= FINE else ROUGH

    def _opacity(self, met: F64, high: F64) -> F32:
        """(N,) how opaque it is `high` (N,) above where its light meets the ground (N, 3)."""
        found = np.zeros(len(met), np.float32)
        assert self._flat is not None
        grid, heights = self._flat.grid, self._heights
        there = np.flatnonzero(met[:, 2] > 0)
        xy = self.standing.camera.project(met[there])
        x, y = ((xy - (grid.left, grid.top)) / grid.pitch - 0.5).T
        level = np.interp(
            high[there] / self.standing.height, heights, np.arange(len(heights), dtype=np.float64)
        )
        found[there] = map_coordinates(self._volume, [level, y, x], order=1, mode="constant")
        return found
