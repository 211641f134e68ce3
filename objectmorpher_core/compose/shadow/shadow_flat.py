"""The shadow of a silhouette that is seen from above: the same outline, beside itself.

What lies on a ground that one looks down on, a bowl or a plate, hides its own foot. Its rim is
about as far above the ground everywhere, so that a distant lamp throws its outline unchanged, moved
by that height x the shadow's length. The ground is all around it, not only below.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32
from ...document.settings import Shadow
from .shadow import HARDEST, last_blur, smooth

SOLID = 0.5  # alpha from which on a pixel belongs to the object


@dataclass(frozen=True, eq=False)
class Flat:
    """A silhouette that lies on the ground, seen from straight above; in px of its grid."""

    alpha: F32  # (h, w)
    height: float  # its shorter side in the picture: what lengths of its shadow are told in

    @property
    def base(self) -> float:
        """The row of its lower end."""
        return float(np.flatnonzero((self.alpha > SOLID).any(1))[-1] + 1)

    @property
    def above(self) -> float:
        """Return how far above its base the ground is still seen."""
        return float(np.inf)

    def thrown(self, shadow: Shadow) -> F32:
        """(h, w) what of the light its shadow takes, in [0, 1]."""
        angle, far = np.radians(shadow.direction), shadow.length * self.height
        matrix = np.array([[1, 0, far * np.cos(angle)], [0, 1, far * np.sin(angle)]])
        moved = cv2.warpAffine(self.alpha, matrix, self.alpha.shape[::-1])
        blur = max(last_blur(shadow), HARDEST) * self.height
        return smooth(np.asarray(moved, np.float32), blur)

    def contact(self) -> F32:
        """(h, w) of the dark where it touches the ground: none that one sees."""
        return np.zeros_like(self.alpha)


def lie(alpha: F32) -> Flat:
    """Return a lying object with that silhouette (h, w), some of it solid, seen from above."""
    solid = alpha > SOLID
    sides = [float(np.ptp(np.flatnonzero(solid.any(axis)))) + 1 for axis in (0, 1)]
    return Flat(alpha, min(sides))
