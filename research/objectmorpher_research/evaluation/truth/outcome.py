"""A method's outcome for a case."""

from __future__ import annotations

from dataclasses import dataclass

from objectmorpher_core.base.arrays import F64, RGB


@dataclass(frozen=True, eq=False)
class EditOutcome:
    """A result, and where the thing is in it."""

    pixels: RGB  # (H, W, 3)
    alpha: F64  # (H, W) the thing's coverage
    reached: F64  # (n, 2) px at which the guidance's points are now
