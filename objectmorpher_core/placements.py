"""The place of an object's centre, and the placement that takes it to another (DESIGN section 6).

A placement turns and scales an object about its centre, and puts the centre somewhere. As long as
turn and scale stay, every point of the object keeps its offset from the centre.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .arrays import F64
from .camera import Camera
from .document import LiftedObject, Placement


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
