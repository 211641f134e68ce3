"""How a moved object is joined to the photo, in numbers that the artist chooses."""

from __future__ import annotations

import math
from dataclasses import dataclass

MOST_SHADOW = 4.0  # x the object's height, length of its shadow
# Of an object that is harmonised.
USUAL_HARMONY, USUAL_RELIGHT, USUAL_GRAIN, USUAL_DEFOCUS = 0.8, 0.75, 1.0, 1.0
LEAST_FEATHER, MOST_FEATHER = 0.25, 3.0  # x the usual width of the blend


@dataclass(frozen=True)
class Shadow:
    """The soft shadow that a moved object casts on the ground below it, see compose/shadow/shadow.py."""

    strength: float = 0.0  # in [0, 1], of the light that it takes; 0: there is none
    direction: float = 20.0  # degrees, where it falls: 0 to the right, 90 towards the viewer
    length: float = 0.6  # x the object's height in the picture
    softness: float = 0.4  # in [0, 1]: how blurred its far end is
    contact: float = 0.7  # in [0, 1]: how dark the ground is right below the object
    colour: tuple[float, float, float] = (0.02, 0.02, 0.04)  # sRGB in [0, 1], near black
    ground: float | None = None  # degrees above it from which one looks; None: by the horizon

    def check(self) -> None:
        """Raises ValueError where a number makes no sense."""
        if self.ground is not None and not 0 <= self.ground <= 90:
            raise ValueError(f"a ground seen from {self.ground:g} degrees is not 0 to 90 above it")
        shares = {"strength": self.strength, "softness": self.softness, "contact": self.contact}
        for name, value in shares.items():
            if not 0 <= value <= 1:
                raise ValueError(f"a shadow's {name} of {value:g} is not between 0 and 1")
        if not 0 <= self.length <= MOST_SHADOW:
            raise ValueError(f"a shadow's length of {self.length:g} is not 0 to {MOST_SHADOW:g}")
        if not math.isfinite(self.direction):
            raise ValueError("a shadow's direction is not a number of degrees")
        if not all(0 <= channel <= 1 for channel in self.colour):
            raise ValueError("a shadow's colour is not between 0 and 1")
