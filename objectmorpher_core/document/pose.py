"""Handles and poses: the user's wishes for an object's control points, and where they start."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import F64, I32, freeze
from ..base.rotations import vector_from_matrix


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
        freeze(self, point=np.float64, target=np.float64, turn=np.float64)

    @property
    def turned(self) -> F64:
        """Its turn (3,); none where it turns as it comes."""
        return np.zeros(3) if self.turn is None else self.turn

    def pinned(self, is_pin: bool, pose: Pose | None) -> Handle:
        """Return the handle as a pin, held as it is turned in `pose`, or free to be dragged."""
        if is_pin == self.is_pin:
            return self
        turn = turn_at(pose, self.control_point) if self.turn is None else self.turn
        return replace(self, is_pin=is_pin, turn=turn if is_pin else None)


@dataclass(frozen=True, eq=False)
class Pose:
    """The deformed control points: paper's p'_i and R_i."""

    points: F64  # (M, 3) object frame
    rotations: F64  # (M, 3, 3)

    def __post_init__(self) -> None:
        freeze(self, points=np.float64, rotations=np.float64)


@dataclass(frozen=True, eq=False)
class Base:
    """The base of a set of handles: the pose when the set last changed, and the parts that stay.

    The pose is the one in which the handles are where they were then; they change it by no more
    than they have moved since. So a handle that is added, softened or removed changes nothing.
    """

    pose: Pose | None = None  # None: the object at rest
    handles: tuple[Handle, ...] = ()  # as they were in that pose
    anchors: I32 | None = None  # control points that stay as they are in it; None: chosen anew

    def __post_init__(self) -> None:
        freeze(self, anchors=np.int32)

    @property
    def is_usual(self) -> bool:
        """Whether the object moves from rest, with anchors that choose themselves."""
        return self.pose is None and self.anchors is None

    @property
    def at_rest(self) -> Base:
        """Return the same anchors, at rest."""
        return Base(anchors=self.anchors)


UNHELD = Base(anchors=np.empty(0, np.int32))  # from rest; nothing stays by itself


def turn_at(pose: Pose | None, control_point: int) -> F64:
    """The rotation vector (3,) of a control point; of one at rest without a pose."""
    return np.zeros(3) if pose is None else vector_from_matrix(pose.rotations[control_point])
