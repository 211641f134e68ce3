"""The place of an object's centre, and the placement that takes it to another (DESIGN section 6).

A placement turns and scales an object about its centre, and puts the centre somewhere. As long as
turn and scale stay, every point of the object keeps its offset from the centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F64
from ..base.camera import Camera
from .ground import Ground
from .model import LiftedObject, Placement

NEAREST = 0.02  # x its depth: an object that is held comes no nearer


def centre_of(placement: Placement, lifted: LiftedObject, camera: Camera) -> F64:
    """(3,) world: where the object's centre is. Raises ValueError behind the camera."""
    motion = placement.matrix(lifted, camera)
    return motion[:3, :3] @ lifted.centre + motion[:3, 3]


def with_centre(
    placement: Placement, centre: np.ndarray, lifted: LiftedObject, camera: Camera
) -> Placement:
    """The same turn and scale with the object's centre at `centre` (3,), world."""
    move = camera.project(np.asarray(centre)) - camera.project(lifted.centre)
    depth = (centre[2] - lifted.centre[2]) / (lifted.diameter * lifted.scale)
    return replace(placement, move=(float(move[0]), float(move[1])), depth=float(depth))


@dataclass(frozen=True, eq=False)
class Hold:
    """A placed object, held by one of its points."""

    placement: Placement
    lifted: LiftedObject
    camera: Camera
    point: F64  # (3,) world
    ground: Ground | None = None  # on which the point stays, whatever happens

    @property
    def unit(self) -> float:
        """World units of one of `away`."""
        return self.lifted.diameter * self.lifted.scale

    @property
    def xy(self) -> F64:
        """(2,) image px at which the point is seen before it is moved."""
        return np.asarray(self.camera.project(self.point), np.float64)

    def moved(self, delta: np.ndarray, away: float = 0.0) -> Placement:
        """The point is seen `delta` (2,) image px beside where it was.

        The object is `away` diameters farther; on the ground, farther than where the point is
        seen, in the same column.
        """
        offset = self.point - centre_of(self.placement, self.lifted, self.camera)
        if self.ground is None:
            nearest = NEAREST * self.point[2]
            depth = max(self.point[2] + away * self.unit, nearest, offset[2] + nearest)
            point = self.camera.unproject(self.xy + delta, depth)
        else:
            point = self.ground.seen_at(self.camera, self.xy + delta)
            if away != 0:
                x, depth = float((self.xy + delta)[0]), float(point[2]) + away * self.unit
                point = self.ground.at_depth(self.camera, x, depth)
        return with_centre(self.placement, point - offset, self.lifted, self.camera)
