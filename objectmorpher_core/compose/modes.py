"""How an object's colours are mixed with what lies behind it, as the layers of a paint program.

The formulas are those of the W3C's Compositing and Blending, which OpenRaster's `svg:` names mean,
for an opaque backdrop and a premultiplied picture; `shaders/modes.glsl` is their twin. Adobe's
soft light differs from this one a little on backdrops darker than a quarter.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import F32
from ..document.settings import MULTIPLY, NORMAL, SCREEN

DARK = np.float32(0.25)  # from which on soft light brightens by the square root


def mixed(below: F32, colour: F32, alpha: F32, mode: str) -> F32:
    """Premultiplied `colour` (h, w, 3) of `alpha` (h, w) over the opaque `below` (h, w, 3)."""
    if mode == NORMAL:
        return colour + (1 - alpha)[..., None] * below
    if mode == MULTIPLY:
        return below * ((1 - alpha)[..., None] + colour)
    if mode == SCREEN:
        return below + colour * (1 - below)
    tilt = 2 * colour - alpha[..., None]  # of the colour from middle grey, times alpha
    bright = np.where(below <= DARK, ((16 * below - 12) * below + 4) * below, np.sqrt(below))
    return below + tilt * np.where(tilt <= 0, below - below * below, bright - below)


def over(below: F32, above: F32, mode: str) -> F32:
    """Two premultiplied pictures (h, w, 4), `above` mixed with what of `below` is there."""
    cover, alpha = below[..., 3:], above[..., 3]
    if mode == NORMAL:
        return above + (1 - alpha)[..., None] * below
    straight = below[..., :3] / np.maximum(cover, 1e-6)
    colour = cover * mixed(straight, above[..., :3], alpha, mode) + (1 - cover) * above[..., :3]
    return np.dstack([colour, alpha + (1 - alpha) * below[..., 3]])
