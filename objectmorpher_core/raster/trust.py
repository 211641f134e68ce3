"""How far a turned object is to be believed: what of it is invented, and how unsure its shape is.

A turn shows what the photo did not, and moves what it did by as much as its depth is wrong. Both
are known before anybody sees the truth: the first from where the surface faces, the second from
what the lifter expected of its own errors. The sign is of the first alone: the second is about the
same for all things at one angle, whether they look right or not. See docs/lifting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64
from .posed import PosedSplats

SIGNS = ("fine", "look closely", "guesswork")
# The first was chosen on nine turned photos that were looked at; the second is beyond 50 degrees of
# a ball and about 40 of most photos.
LIMITS = (0.06, 0.2)  # invented, from which on the second and the third are said
EDGE_ON = 0.3  # ratio of the cosines then and now, below which the photo showed too little of it
UNSAID = 0.1  # x its size, the error of a shape of which nobody said how sure it is
ENOUGH = 2000  # Gaussians that are asked
FROM_FILE = "imported"  # the backend of such objects


@dataclass(frozen=True)
class Trust:
    """In one view of an object."""

    invented: float  # share of the visible object that the photo did not show
    astray: float  # x its size, how far its visible parts are expected to be off

    @property
    def sign(self) -> str:
        """Of SIGNS."""
        return SIGNS[sum(self.invented >= limit for limit in LIMITS)]


def trust_in(splats: PosedSplats) -> Trust:
    """How far to believe an object that was moved as a whole, or posed, as the camera sees it.

    One from a file is what its maker says on all sides, so nothing of it is invented.
    """
    rest, lifted = splats.rest, splats.rest.lifted
    if lifted.backend == FROM_FILE:
        return Trust(0.0, 0.0)
    body = np.flatnonzero(lifted.is_body)
    few = body[:: len(body) // ENOUGH + 1]
    linear, means = splats.linear[few], splats.means[few]
    normals = np.linalg.inv(linear).transpose(0, 2, 1) @ rest.normals[few, :, None]
    cosines = _cosines(normals[:, :, 0], -means)
    area = np.maximum(cosines, 0)
    # What was seen from nearly edge on is not known, either.
    is_seen = lifted.texture.visibility[few] > 0
    is_seen &= rest.cosines[few] >= EDGE_ON * cosines
    if lifted.sides is not None and lifted.sides.real is not None:
        is_seen |= lifted.sides.real[few]
    total = max(float(area.sum()), 1e-9)
    invented = float(area[~is_seen].sum()) / total
    # A depth that is wrong shows as far as its line of sight is seen from the side now.
    sight = (linear @ lifted.world_points(rest.means[few])[:, :, None])[:, :, 0]
    side = np.sqrt(np.maximum(1 - _cosines(sight, means) ** 2, 0))
    astray = (lifted.doubt or UNSAID) * float((side * area).sum()) / total
    return Trust(invented, astray)


def _cosines(a: F64, b: F64) -> F64:
    """(n,) of the angles between vectors (n, 3)."""
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return (a * b).sum(1) / np.maximum(lengths, 1e-30)
