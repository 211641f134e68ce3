"""The kinds of objects; each is a function of a random generator that returns a `Builder`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..solid import Builder
from .boxes import boxes
from .creatures import creatures
from .figures import figures
from .furniture import furniture
from .lumps import superquadrics
from .rings import rings
from .vehicles import vehicles
from .vessels import lathe

Family = Callable[[np.random.Generator], Builder]

# Names and what makes such an object
FAMILIES: dict[str, Family] = {
    "creatures": creatures,
    "figures": figures,
    "lathe": lathe,
    "boxes": boxes,
    "furniture": furniture,
    "rings": rings,
    "vehicles": vehicles,
    "superquadrics": superquadrics,
}

__all__ = ["FAMILIES", "Family"]
