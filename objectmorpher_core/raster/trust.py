"""How far a turned object is to be believed: what of it is invented, and how unsure its shape is.

A turn shows what the photo did not, and moves what it did by as much as its depth is wrong. Both
are known before anybody sees the truth: the first from where the surface faces, the second from
what the lifter expected of its own errors. Calibrated on solids of known truth, see docs/lifting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .posed import PosedSplats
from .rules import RULES

SIGNS = ("fine", "look closely", "guesswork")
LIMITS = (0.1, 0.2)  # risk, from which on the second and the third are said
UNSAID = 0.1  # x its size, the error of a shape of which nobody said how sure it is
WEIGHT = 1.0  # of what moves wrongly, beside the invented share


@dataclass(frozen=True)
class Trust:
    """In one view of an object."""

    invented: float  # share of the visible object that the photo did not show
    astray: float  # x its size, how far its visible parts are expected to be off
    risk: float  # both together

    @property
    def sign(self) -> str:
        """Of SIGNS."""
        return SIGNS[sum(self.risk >= limit for limit in LIMITS)]


def trust_in(splats: PosedSplats) -> Trust:
    """How far to believe an object that was moved as a whole, or posed, as the camera sees it."""
    rest, lifted = splats.rest, splats.rest.lifted
    linear = splats.linear
    normals = np.linalg.inv(linear).transpose(0, 2, 1) @ rest.normals[:, :, None]
    normals = normals[:, :, 0]
    views = -splats.means / np.linalg.norm(splats.means, axis=1, keepdims=True)
    cosines = (normals * views).sum(1) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    area = np.maximum(cosines, 0) * lifted.is_body
    # What was seen from nearly edge on is not known, either.
    is_seen = (lifted.texture.visibility > 0) & (rest.cosines >= RULES.look_aside * cosines)
    total = max(float(area.sum()), 1e-9)
    invented = float(area[~is_seen].sum()) / total
    # A depth that is wrong shows as far as the line of sight at rest is seen from the side now.
    world = lifted.world_points(rest.means)
    sight = (linear @ (world / np.linalg.norm(world, axis=1, keepdims=True))[:, :, None])[:, :, 0]
    side = np.linalg.norm(np.cross(sight, views), axis=1)
    side /= np.maximum(np.linalg.norm(sight, axis=1), 1e-12)
    astray = (lifted.doubt or UNSAID) * float((side * area).sum()) / total
    return Trust(invented, astray, invented + WEIGHT * astray)
