"""How an object's colours are mixed with what lies behind it, as the layers of a paint program.

The formulas are those of the W3C's Compositing and Blending, which OpenRaster's `svg:` names mean,
for an opaque backdrop and a premultiplied picture; `shaders/blend_modes.glsl` is their twin.
Adobe's soft light differs from this one a little on backdrops darker than a quarter.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import F32
from ..document.bounds import MULTIPLY, NORMAL, SCREEN

DARK = np.float32(0.25)  # from which on soft light brightens by the square root


def mixed(below: F32, colour: F32, alpha: F32, mode: str) -> F32:
    """Premultiplied `colour` (h, w, 3) of `alpha` (h, w) over the opaque `below` (h, w, 3)."""
    through = (1 - alpha)[..., None]
    if mode == NORMAL:
        result = colour + through * below
    elif mode == MULTIPLY:
        result = below * (through + colour)
    elif mode == SCREEN:
        result = below + colour * (1 - below)
    else:
        tilt = 2 * colour - alpha[..., None]  # of the colour from middle grey, times alpha
        bright = np.where(below <= DARK, ((16 * below - 12) * below + 4) * below, np.sqrt(below))
        result = below + tilt * np.where(tilt <= 0, below - below * below, bright - below)
    return np.asarray(result, np.float32)


def over(below: F32, above: F32, mode: str) -> F32:
    """Two premultiplied pictures (h, w, 4), `above` mixed with what of `below` is there."""
    cover, alpha = below[..., 3:], above[..., 3]
    covering = above + (1 - alpha)[..., None] * below
    if mode != NORMAL:
        straight = np.asarray(below[..., :3] / np.maximum(cover, 1e-6), np.float32)
        colour = mixed(straight, above[..., :3], alpha, mode)
        covering[..., :3] = cover * colour + (1 - cover) * above[..., :3]
    return np.asarray(covering, np.float32)
