"""Three materials to choose from, as settings of the solver.

All the solver knows of a material is how far along the surface a control point is linked to
others (`DeformSettings.stiffness`, x the usual reach). What that does, measured on a round bar
(length 1, radius 0.08) whose one end is held while the other is pulled across by 0.43, and on a
ball pulled at one point by a fifth of its diameter:

    material   reach   bar's end turns   ball: largest stretch   ball: mean share that follows
    soft       0.35    45 degrees        25 %                    0.23
    normal     1       42 degrees        13 %                    0.25
    rigid      2       34 degrees         5 %                    0.30

A soft object gives way where it is pulled; a rigid one passes the pull on, and bends less.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

from ..document.model import DeformSettings


class Rigidity(Enum):
    """The reach of the links of each material, x the usual one."""

    RIGID = 2.0
    NORMAL = 1.0
    SOFT = 0.35


def rigidity_of(settings: DeformSettings) -> Rigidity | None:
    """The material of these settings; None for one of its own."""
    return next((r for r in Rigidity if r.value == settings.stiffness), None)


def with_rigidity(settings: DeformSettings, rigidity: Rigidity) -> DeformSettings:
    """Return the same settings for another material."""
    return replace(settings, stiffness=rigidity.value)
