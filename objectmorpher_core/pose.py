"""What the user asks of an object's control points, and where they go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import F64, frozen


@dataclass(frozen=True, eq=False)
class Handle:
    """A point of the rest surface and where it must be."""

    control_point: int  # nearest control point; two handles never share one
    point: F64  # (3,) object frame, the surface point that was clicked
    target: F64  # (3,) object frame; equal to `point` for a pin that was never dragged
    is_pin: bool = False
    turn: F64 | None = None  # (3,) rotation vector, radians, any angle; None: as it comes
    softness: float = 0.0  # 0: met exactly; 1: gives as much as the object itself does

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", frozen(self.point, np.float64))
        object.__setattr__(self, "target", frozen(self.target, np.float64))
        if self.turn is not None:
            object.__setattr__(self, "turn", frozen(self.turn, np.float64))


@dataclass(frozen=True, eq=False)
class Pose:
    """The deformed control points: paper's p'_i and R_i."""

    points: F64  # (M, 3) object frame
    rotations: F64  # (M, 3, 3)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, np.float64))
        object.__setattr__(self, "rotations", frozen(self.rotations, np.float64))
