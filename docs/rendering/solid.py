"""An ellipsoid with a texture as fine as the photo's pixels, drawn exactly: by its rays.

Every pixel is the mean of many rays, in sRGB values, as a camera that averages over its pixels
would see it. The light is that of nothing: colours do not change with the view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.camera import Camera

AXES = np.array([1.15, 1.0, 0.8])  # world units
CENTRE = np.array([0.0, 0.0, 3.0])
CAMERA = Camera.from_fov(512, 512)
WAVES = 48  # of the texture
FINEST, COARSEST = 4.0, 60.0  # px of the photo, their lengths
CONTRAST = 0.55
RING, LINE = 0.16, 0.055  # world units between dark lines; their share of that
ROWS = 64  # of pixels that are drawn at a time


@dataclass(frozen=True, eq=False)
class Cast:
    """What the rays have found."""

    color: F64  # (h, w, 3) straight, the mean of those that hit
    alpha: F64  # (h, w) share that hit
    cosine: F64  # (h, w) least cosine with which the photo saw what is seen here; < 0: it did not

    @property
    def seen(self) -> Mask:
        """(h, w) whether the photo showed all of the pixel."""
        return (self.alpha == 1) & (self.cosine > 0)


def cast(camera: Camera, motion: F64, rays: int, photo: F32 | None = None) -> Cast:
    """The ellipsoid after the `motion` (4, 4, world) with `rays` x `rays` of them in a pixel.

    With `photo` (H, W, 3) its colours are looked up there, through the exact geometry: the best
    that can be made of the photo.
    """
    parts = [_cast_rows(camera, motion, rays, photo, top) for top in range(0, camera.height, ROWS)]
    arrays = [np.concatenate([p[k] for p in parts]) for k in range(3)]
    return Cast(*arrays)


def _cast_rows(
    camera: Camera, motion: F64, rays: int, photo: F32 | None, top: int
) -> tuple[F64, F64, F64]:
    height = min(ROWS, camera.height - top)
    fine = camera.windowed(0, top, camera.width * rays, height * rays, rays)
    y, x = np.mgrid[: fine.height, : fine.width] + 0.5
    way = fine.unproject(np.column_stack([x.ravel(), y.ravel()]), np.ones(x.size))
    hit, points = _hits(way, motion)
    values = np.zeros((len(way), 5))
    values[hit, :3] = texture(points) if photo is None else _looked_up(photo, points)
    values[hit, 3] = 1.0
    values[:, 4] = np.inf
    values[hit, 4] = -(normals(points) * points).sum(1) / np.linalg.norm(points, axis=1)
    grid = values.reshape(height, rays, camera.width, rays, 5)
    total = grid[..., :4].sum((1, 3))
    color = total[..., :3] / np.maximum(total[..., 3:], 1)
    return color, total[..., 3] / rays**2, grid[..., 4].min((1, 3))


def _hits(way: F64, motion: F64) -> tuple[Mask, F64]:
    """Which rays (n, 3) from the origin hit the moved ellipsoid; where, (k, 3) before the motion.

    In coordinates in which it is the unit sphere at the origin.
    """
    back = np.linalg.inv(motion)
    start = (back[:3, 3] - CENTRE) / AXES
    step = way @ back[:3, :3].T / AXES
    a, b, c = (step**2).sum(1), step @ start, start @ start - 1
    root = b * b - a * c
    hit = root > 0
    reach = (-b[hit] - np.sqrt(root[hit])) / a[hit]
    return hit, (start + reach[:, None] * step[hit]) * AXES + CENTRE


def normals(points: F64) -> F64:
    """Outward, unit (N, 3), at points of the surface before the motion."""
    outward = (points - CENTRE) / AXES**2
    return outward / np.linalg.norm(outward, axis=1, keepdims=True)


def texture(points: F64) -> F64:
    """sRGB (N, 3) of points of the surface: waves through space, and thin dark rings."""
    rng = np.random.default_rng(1)
    px = CENTRE[2] / CAMERA.focal
    length = px * np.exp(rng.uniform(np.log(FINEST), np.log(COARSEST), WAVES))
    ways = rng.normal(size=(WAVES, 3))
    ways *= (2 * np.pi / length / np.linalg.norm(ways, axis=1))[:, None]
    phases, hues = rng.uniform(0, 2 * np.pi, WAVES), rng.uniform(0.3, 1.0, (WAVES, 3))
    total = np.zeros((len(points), 3))
    for way, phase, hue in zip(ways, phases, hues, strict=True):
        total += np.sin(points @ way + phase)[:, None] * hue
    color = 0.5 + 0.5 * np.tanh(CONTRAST * total / np.sqrt(WAVES / 8)) * [1.0, 0.85, 0.7]
    across = (points - CENTRE) @ np.array([0.36, 0.85, 0.38]) / RING
    is_line = np.abs(across - np.round(across)) < 0.5 * LINE
    return np.where(is_line[:, None], 0.08, color)


def _looked_up(photo: F32, points: F64) -> F64:
    from objectmorpher_core.raster.texture import build_levels, sample_texture

    levels = build_levels(photo, np.ones(photo.shape[:2], np.float32), 0, 0)
    return sample_texture(levels, CAMERA.project(points), np.zeros(len(points)))[:, :3]
