"""The constants and the small formulas that make up the picture's definition.

Renderers differ in how they loop; everything that decides a colour is here or in `reference`.
The scalar functions are compiled by numba and called from `tiles`; `reference` writes the same
formulas with numpy.
"""

from __future__ import annotations

import numba
import numpy as np

CUTOFF = 7.0  # squared Mahalanobis distance beyond which a Gaussian is 0
TAIL = float(np.exp(-CUTOFF / 2))  # subtracted, so that the kernel ends without a step
FILTER = 0.15  # px^2 added to the screen covariance, so that no Gaussian falls between pixels
RIDGE = 1e-6  # x trace, added to the covariance before inversion
NEAR = 1e-3  # x the object's gap: nothing nearer to the camera is drawn

# The kernels' sum is about 2 where the surface is whole (spacing 1, sigma 0.6).
SURFACE_LEVEL = 0.5  # kernel sum at which the surface ends
EDGE_WIDTH = 1.0  # px, width of the antialiased edge there

# Facing: cosine between normal and view ray. Fronts fade until 0.25 beyond grazing, backs begin
# at grazing: at rest every front counts fully and no back at all. The brim, which stands around
# the silhouette of the photo and carries its soft edge, faces along the rim; it counts while the
# rim is still the silhouette.
FACING_RAMP = 0.25
BRIM_START = 0.22
BRIM_END = 0.42

# Where the motion magnifies the photo, the matte's edge would become a translucent band: from
# MATTE_START on the surface's own edge takes over from the matte's, wholly at MATTE_END.
MATTE_START = 0.55
MATTE_END = 0.35

# Stretch: smallest magnification of the photo by the motion, 1 at rest. Below STREAK_START the
# photo's pixels begin to show as streaks, below STREAK_END they are not used.
STREAK_START = 0.40
STREAK_END = 0.18


SAME_POINT = 1.0  # px of the photo: layers that look this close together are one surface


@numba.njit(cache=True, nogil=True)
def ramp(value: float, zero: float, one: float) -> float:
    """0 at `zero`, 1 at `one`, smooth between and constant beyond (either may be larger)."""
    t = min(max((value - zero) / (one - zero), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@numba.njit(cache=True, nogil=True)
def facing_weight(cosine: float, is_seen: float, solidity: float) -> float:
    """Weight of a Gaussian whose normal makes this cosine with the direction to the camera."""
    front = min(max((cosine - FACING_RAMP * (1.0 - is_seen)) / FACING_RAMP + 1.0, 0.0), 1.0)
    return solidity * front + (1.0 - solidity) * ramp(abs(cosine), BRIM_END, BRIM_START)


@numba.njit(cache=True, nogil=True)
def coverage(total: float, slope: float) -> float:
    """Share of a pixel that is inside the surface whose kernel sum is `total`.

    The surface ends where the sum falls to SURFACE_LEVEL; the sum's gradient `slope` (per px)
    says how far that is, so the edge is one pixel wide at any scale.
    """
    return min(max(0.5 + (total - SURFACE_LEVEL) / (EDGE_WIDTH * slope + 1e-6), 0.0), 1.0)
