"""Explicit shapes, fitted to an object in a photo and chosen by evidence.

Analysis by synthesis: a flat sheet, a box, and a round thing (a surface of revolution, a ring
or an ellipsoid) are each drawn as the camera would see them, and their numbers found for which
outline, depth and normals are nearest to the photo's and the shape network's. The one that explains
most gives the object's front and back as far as it explains them; the rest stays free.
"""

from __future__ import annotations

from .recognition import (
    Recognised,
    closed_ring,
    completed,
    flattened,
    looks_drawn,
    recognised,
    rounded,
)
from .rims import Rim, rims_of
from .tableware import laid

__all__ = [
    "Recognised", "Rim", "closed_ring", "completed", "flattened", "laid", "looks_drawn",
    "recognised", "rims_of", "rounded",
]  # fmt: skip
