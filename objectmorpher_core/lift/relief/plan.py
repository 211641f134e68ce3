"""Level ground as a camera above it sees it: the plan of what stands there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F64
from ...base.camera import Camera
from .silhouette import Silhouette

CAMERA_HEIGHT = 0.75  # x extent, in the photo: how far below the horizon things usually stand
LEAST_BELOW = 0.1  # x height of the photo that ground must be below the horizon to tell something


@dataclass(frozen=True, eq=False)
class Plan:
    """The camera's height above the ground is the unit."""

    camera: Camera
    horizon: float  # px, the row of the photo it lies in

    @staticmethod
    def under(silhouette: Silhouette, camera: Camera, horizon: float | None, row: float) -> Plan:
        """The ground that the object touches about `row` px.

        `horizon` None: not known. A photo is seldom taken from much lower than a thing is large.
        """
        if horizon is None:
            horizon = row - max(row - camera.cy, CAMERA_HEIGHT * silhouette.extent)
        return Plan(camera, horizon)

    @property
    def down(self) -> tuple[float, float]:
        """Cosine and sine of the angle by which the camera looks down."""
        rise = self.camera.cy - self.horizon
        length = float(np.hypot(self.camera.focal, rise))
        return self.camera.focal / length, rise / length

    def is_seen(self, y: F64) -> bool:
        """Whether the ground in rows `y` (n,) px is so far below the horizon that it tells."""
        return bool(y.min() - self.horizon >= LEAST_BELOW * self.camera.height)

    def facing(self, y: F64) -> F64:
        """Forward distance over depth (...) on the rays of rows `y` px; forward is level."""
        cosine, sine = self.down
        return cosine - sine * (y - self.camera.cy) / self.camera.focal

    def on_ground(self, x: F64, y: F64) -> tuple[F64, F64]:
        """Across and forward (n,) of the ground seen at px (n,) below the horizon."""
        cosine, sine = self.down
        depth = 1 / (cosine * (y - self.camera.cy) / self.camera.focal + sine)
        return depth * (x - self.camera.cx) / self.camera.focal, depth * self.facing(y)

    def foot(self, x: F64, y: F64, row: float) -> F64:
        """Column px in which the plumb line through px (...) crosses `row`."""
        return self.camera.cx + (x - self.camera.cx) * self.facing(np.array(row)) / self.facing(y)
