"""What the Pose tool does now, and which of its marks are shown: neither saved nor undone."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class PoseMode(Enum):
    """What dragging over the object does, in the order of the panel."""

    DRAG = "Drag"
    FREEZE = "Freeze"
    STIFFEN = "Stiffen"
    BODY = "Rigid group"
    CUT = "Cut"
    GLUE = "Glue"


BRUSHES = (PoseMode.FREEZE, PoseMode.STIFFEN, PoseMode.BODY)  # they paint with the round brush


@dataclass(eq=False)
class PoseView:
    """Mutable: the tool and its panel write it."""

    mode: PoseMode = PoseMode.DRAG
    stiffness: float = 4.0  # x the usual one, of what is painted with Stiffen
    has_ring: bool = True  # around the selected handle
    has_anchors: bool = True
    has_regions: bool = True
    has_influence: bool = False
