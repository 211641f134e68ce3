"""The kinds of objects: functions of a random generator that return a `PrimitiveBuilder`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..solid import PrimitiveBuilder
from .boxes import boxes
from .busts import busts
from .creatures import creatures
from .extrusions import extrusions
from .figures import figures
from .furniture import furniture
from .lumps import superquadrics
from .padded import padded
from .plants import plants
from .prints import prints
from .rings import rings
from .sheets import sheets
from .vehicles import vehicles
from .vessels import lathe

Family = Callable[[np.random.Generator], PrimitiveBuilder]

# Names and what makes such an object
FAMILIES: dict[str, Family] = {
    "creatures": creatures,
    "figures": figures,
    "busts": busts,
    "lathe": lathe,
    "boxes": boxes,
    "furniture": furniture,
    "rings": rings,
    "plants": plants,
    "vehicles": vehicles,
    "sheets": sheets,
    "superquadrics": superquadrics,
    "extrusions": extrusions,
    "prints": prints,
}
# What is drawn only where it is asked for by name
FURTHER: dict[str, Family] = {"padded": padded}
