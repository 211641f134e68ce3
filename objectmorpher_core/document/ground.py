"""The ground that an object stands on, from the row of the photo that the horizon is in.

The ground is the plane n.p = k. Its vanishing line is the horizon: with the camera held level,
a ray to the row h runs along it, so n = (0, f, cy - h), made unit, which points down (y is down).
k, the height of the camera above the ground, follows from the lowest point of the object in the
photo: its contact. The unit is the scene's, which one photo does not give: the ratio of heights
and sizes is what counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64
from ..base.camera import Camera

FARTHEST = 40.0  # x the height of the camera: to which depth an object slides
NEAREST = 0.02  # x the same: from which depth on
LEAST_BELOW = 1.0  # px of the photo, of the contact below the horizon


class GroundError(ValueError):
    """There is no such ground; one sentence."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A plane below the camera."""

    normal: F64  # (3,) world, unit, down
    height: float  # world units, of the camera above it; above 0

    def below(self, points: np.ndarray) -> F64:
        """(...) world units by which points (..., 3) are below the ground; negative above it."""
        return points @ self.normal - self.height

    def lowest(self, points: np.ndarray) -> F64:
        """(3,) the point of (N, 3) that is lowest."""
        return np.asarray(points[int((points @ self.normal).argmax())], np.float64)

    def seen_at(self, camera: Camera, xy: np.ndarray) -> F64:
        """(3,) the point of the ground that is seen at image px (2,).

        Above the horizon, and close below it, the farthest one of that column.
        """
        ray = camera.unproject(xy, 1.0)
        down = float(ray @ self.normal)
        most = FARTHEST * self.height
        if down * most < self.height:
            return self.at_depth(camera, float(xy[0]), most)
        return ray * max(self.height / down, NEAREST * self.height)

    def at_depth(self, camera: Camera, x: float, depth: float) -> F64:
        """(3,) the point of the ground that is seen in column `x` px, `depth` along z."""
        depth = float(np.clip(depth, NEAREST * self.height, FARTHEST * self.height))
        across = (x - camera.cx) / camera.focal * depth
        down = (self.height - self.normal[2] * depth) / self.normal[1]
        return np.array([across, down, depth])

    def stood(self, centre: np.ndarray, offsets: np.ndarray) -> F64:
        """(3,) `centre` moved up or down so that the lowest of centre + offsets (N, 3) stands."""
        sunk = float(np.max(offsets @ self.normal) + centre @ self.normal - self.height)
        return np.asarray(centre - sunk * self.normal, np.float64)


def ground_under(points: np.ndarray, camera: Camera, horizon: float) -> Ground:
    """The ground under world points (N, 3) of an object in the photo; `horizon` px.

    Raises GroundError where the object's lowest point is not below the horizon.
    """
    normal = np.array([0.0, camera.focal, camera.cy - horizon])
    normal /= np.linalg.norm(normal)
    depths = points @ normal  # (N,) world units, below the camera
    lowest = int(depths.argmax())
    height = float(depths[lowest])
    if camera.project(points[lowest])[1] - horizon < LEAST_BELOW or height <= 0:
        raise GroundError("the object's lowest point is above the horizon, so it cannot stand")
    return Ground(normal, height)
