"""The same Gaussians in plain colours, which is what others have.

As the lifter colours them: the photo, averaged over each one's surroundings. And *fitted*: so that
the picture at rest is as near to the photo as it gets. The picture is linear in the colours, and
what is missing at a Gaussian's place is added to it again and again (van Cittert's iteration),
without a limit to the colours: training against the photo could do no more with that geometry.
"""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.lift.relief.lifter import bilinear
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.raster.texture import TextureLevels

STEPS = 40  # beyond, nothing is gained


def lifted_colors(splats: PosedSplats) -> F64:
    """(N, 3) as the lifter chose them."""
    return splats.rest.lifted.gaussians.colors.astype(np.float64)


def fitted_colors(
    rest: PosedSplats, texture: TextureLevels, camera: Camera, photo: np.ndarray, where: Mask
) -> F64:
    """(N, 3) that show `photo` (H, W, 3) at rest, the best of all steps in the pixels `where`."""
    carried = rest.rest.lifted.texture
    at, seen = carried.u0.astype(np.float64) - 0.5, carried.visibility[:, None]
    colors = best = lifted_colors(rest)
    least = np.inf
    for _ in range(STEPS):
        shown = tiles.render(rest.painted(colors), texture, camera, camera).color
        missing = np.where(where[..., None], photo - shown, 0.0)
        error = float((missing**2).sum())
        if error < least:
            best, least = colors, error
        colors = colors + bilinear(missing, at) * seen
    return best
