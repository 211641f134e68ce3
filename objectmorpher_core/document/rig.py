"""The rig: regions of an object that are cut apart, glued together, rigid, frozen or stiffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64, I32, freeze, frozen


@dataclass(frozen=True, eq=False)
class Seam:
    """Two regions of an object that are cut apart, or glued together."""

    first: I32  # control points
    second: I32
    is_glued: bool = False

    def __post_init__(self) -> None:
        freeze(self, first=np.int32, second=np.int32)


@dataclass(frozen=True, eq=False)
class Rig:
    """The artist's rig of an object's regions. Control points by index."""

    seams: tuple[Seam, ...] = ()
    bodies: tuple[I32, ...] = ()  # groups that move as one rigid body, disjoint
    held: I32 | None = None  # frozen: no handle moves them
    stiffness: F64 | None = None  # (M,) of each control point, 1 = usual
    shifts: F64 | None = None  # (P, 3) object units, of `held` from rest; None: they are at rest

    def __post_init__(self) -> None:
        object.__setattr__(self, "bodies", tuple(frozen(b, np.int32) for b in self.bodies))
        freeze(self, held=np.int32, shifts=np.float64, stiffness=np.float64)

    def is_held(self, node: int) -> bool:
        """Whether a control point is frozen."""
        return self.held is not None and bool((self.held == node).any())

    def held_at(self, rest: np.ndarray) -> F64:
        """(M, 3) where frozen control points stay, the others at `rest` (M, 3)."""
        points = np.array(rest, np.float64)
        if self.shifts is not None:
            points[self.held] += self.shifts
        return points

    def check(self, count: int) -> None:
        """Raises ValueError where this is no rig of `count` control points."""
        sides = [side for seam in self.seams for side in (seam.first, seam.second)]
        held = () if self.held is None else (self.held,)
        for region in (*sides, *self.bodies, *held):
            if region.ndim != 1 or len(region) == 0:
                raise ValueError("a region of the rig holds no control point")
            if region.min() < 0 or region.max() >= count:
                raise ValueError(f"the rig names a control point beyond the object's {count}")
        if self.shifts is not None:
            if self.held is None or self.shifts.shape != (len(self.held), 3):
                raise ValueError("the rig does not say where each frozen control point is")
            if not np.isfinite(self.shifts).all():
                raise ValueError("a frozen control point is not at a finite place")
        for seam in self.seams:
            if np.intersect1d(seam.first, seam.second).size:
                raise ValueError("the two sides of a seam share a control point")
        members = np.concatenate([*self.bodies, np.empty(0, np.int32)])
        if len(np.unique(members)) < len(members):
            raise ValueError("two rigid bodies share a control point")
        if self.stiffness is not None:
            if self.stiffness.shape != (count,):
                raise ValueError(f"{self.stiffness.shape} stiffnesses for {count} control points")
            if not ((self.stiffness > 0) & (self.stiffness < np.inf)).all():
                raise ValueError("a control point's stiffness is not above 0")

    def moved_to(self, nearest: np.ndarray) -> Rig:
        """The rig of other control points, whose `nearest` (M',) old ones are these."""

        def own(region: np.ndarray) -> I32:
            return np.flatnonzero(np.isin(nearest, region)).astype(np.int32)

        seams = (Seam(own(s.first), own(s.second), s.is_glued) for s in self.seams)
        held = None if self.held is None else own(self.held)
        shifts = None
        if held is not None and self.held is not None and self.shifts is not None:
            order = np.argsort(self.held)
            shifts = self.shifts[order[np.searchsorted(self.held[order], nearest[held])]]
        return Rig(
            tuple(s for s in seams if len(s.first) and len(s.second)),
            tuple(body for body in map(own, self.bodies) if len(body) > 1),
            held if held is not None and len(held) else None,
            None if self.stiffness is None else self.stiffness[nearest],
            shifts if shifts is not None and len(shifts) else None,
        )
