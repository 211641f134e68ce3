"""The refinement over the composite: seen inside the footprint only, as strongly as is wanted."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Pixels
from ..base.pixels import pixels_from_unit, unit_pixels
from ..document.refinement import Refined
from .blend import differ


def with_refined(photo: Pixels, pixels: Pixels, refined: Refined) -> tuple[Pixels, float]:
    """`pixels` (H, W, 3), an edited `photo`, refined; and the refiner's share of what changed.

    Where the refinement's alpha is 0, the integers stay as they are.
    """
    x0, y0, x1, y1 = refined.box
    weights = refined.weights
    old = pixels[y0:y1, x0:x1]
    base = unit_pixels(old)
    mixed = base + weights[..., None] * (unit_pixels(refined.pixels) - base)
    result = pixels.copy()
    shown = (weights > 0)[..., None]
    result[y0:y1, x0:x1] = np.where(shown, pixels_from_unit(mixed, old.dtype), old)
    whole = int(differ(result, photo).sum())
    is_changed = differ(result[y0:y1, x0:x1], photo[y0:y1, x0:x1])
    total = float(weights[is_changed].sum(dtype=np.float64))
    return result, total / whole if whole else 0.0
