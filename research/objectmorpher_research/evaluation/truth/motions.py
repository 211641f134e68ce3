"""True edits: how the points of a solid move, and where one would take hold of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F64, I32
from objectmorpher_core.base.rotations import matrix_from_vector, turn_matrix

RIGID = ("turn", "tilt", "depth", "scale")  # the whole thing moves as one
SPATIAL = ("turn", "tilt", "depth", "bend out")  # what happens in depth: the 3-D categories
IN_PLANE = ("scale", "bend in", "stretch")


@dataclass(frozen=True)
class Rigid:
    """A user's placement of the whole thing: scaled and turned about its middle, then moved."""

    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)  # degrees: yaw, pitch, roll
    scale: float = 1.0
    away: float = 0.0  # x its distance, that it goes away from the camera


@dataclass(frozen=True)
class TruthEdit:
    """An edit of one category; `amount` in degrees, as a factor, or as a share of the distance."""

    category: str
    amount: float
    limb: str = ""
    is_deep: bool = False  # of a limb: it is raised towards the viewer, not in the picture's plane

    @property
    def rigid(self) -> Rigid | None:
        """Return it as a motion of the whole thing; None where it deforms."""
        if self.category == "turn":
            return Rigid(turn=(self.amount, 0.0, 0.0))
        if self.category == "tilt":
            return Rigid(turn=(0.0, self.amount, 0.0))
        if self.category == "depth":
            return Rigid(away=self.amount)
        return Rigid(scale=self.amount) if self.category == "scale" else None


@dataclass(frozen=True, eq=False)
class PlacedSolid:
    """A solid where it stands in the world."""

    points: F64  # (V, 3) world
    parts: I32  # (V,)
    limb: tuple[tuple[int, ...], F64, F64] | None  # its parts, pivot and tip (3,), world

    @property
    def centre(self) -> F64:
        """(3,) the middle of its box, about which it turns."""
        return 0.5 * (self.points.min(0) + self.points.max(0))

    @property
    def extent(self) -> F64:
        """(3,)"""
        return np.ptp(self.points, axis=0)

    @property
    def axis(self) -> int:
        """0 or 1: it is longer across, or upright."""
        return int(self.extent[1] >= self.extent[0])


def moved(motion: TruthEdit, body: PlacedSolid) -> F64:
    """(V, 3) where its points go, world."""
    centre, around = body.centre, body.points - body.centre
    if (rigid := motion.rigid) is not None:
        turned = around @ turn_matrix(*rigid.turn).T * rigid.scale
        return turned + centre * (1 + rigid.away)
    if motion.category == "limb":
        return _raised(motion, body)
    along, length = body.axis, float(body.extent[body.axis])
    if motion.category == "stretch":
        result = around.copy()
        result[:, along] *= motion.amount
        return result + centre
    if motion.category == "twist":
        return _twisted(around, along, length, motion.amount) + centre
    across = 2 if motion.category == "bend out" else 1 - along
    return _bent(around, along, across, length, motion.amount) + centre


def _bent(around: F64, along: int, across: int, length: float, degrees: float) -> F64:
    """Along an arc of so many degrees; its middle stays."""
    radius = length / np.radians(degrees)
    angle, far = around[:, along] / radius, around[:, across] + radius
    result = around.copy()
    result[:, along], result[:, across] = far * np.sin(angle), far * np.cos(angle) - radius
    return result


def _twisted(around: F64, along: int, length: float, degrees: float) -> F64:
    """Its ends turned against each other by so many degrees."""
    angle = np.radians(degrees) * around[:, along] / length
    u, v = (around[:, k] for k in range(3) if k != along)
    result = around.copy()
    turned = iter((np.cos(angle) * u - np.sin(angle) * v, np.sin(angle) * u + np.cos(angle) * v))
    for k in range(3):
        if k != along:
            result[:, k] = next(turned)
    return result


def _raised(motion: TruthEdit, body: PlacedSolid) -> F64:
    assert body.limb is not None
    parts, pivot, tip = body.limb
    axis = np.array([0.0, 0.0, 1.0])
    if motion.is_deep:  # about what is across the limb in the picture
        way = (tip - pivot)[:2] / np.linalg.norm((tip - pivot)[:2])
        axis = np.array([-way[1], way[0], 0.0])
    turn = matrix_from_vector(axis * np.radians(motion.amount))
    result = body.points.copy()
    own = np.isin(body.parts, parts)
    result[own] = (result[own] - pivot) @ turn.T + pivot
    return result


def grips(motion: TruthEdit, body: PlacedSolid) -> tuple[F64, int]:
    """Return the grips (n, 3), world, and how many more points stay in place.

    What is seen there in the picture is meant. Points in a line would not tell whether the thing
    rolls about it: a bend and a twist are held at both edges.
    """
    centre, along = body.centre, body.axis
    if motion.category == "limb":
        assert body.limb is not None
        _, pivot, tip = body.limb
        return np.stack([pivot + share * (tip - pivot) for share in (0.5, 0.95)]), 4
    unit = np.eye(3)[along] * body.extent[along]
    if motion.category == "stretch":
        return np.stack([centre - 0.47 * unit, centre + 0.47 * unit]), 0
    side = np.eye(3)[1 - along] * body.extent[1 - along]
    edges = [centre + a * unit + b * side for a in (-0.43, 0.43) for b in (-0.35, 0.35)]
    if motion.category == "twist":
        return np.stack([*edges, centre]), 0
    return np.stack([*edges, *(centre + share * unit for share in (-0.22, 0.0, 0.22))]), 0
