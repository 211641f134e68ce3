"""How the far side of a free form meets its outline: round, and without the outline's own waves.

A photo says where a form ends, tufts and stairs of the outline included, but not how: a network's
pixel is too wide for that. Were the form as thick there as it is farther in, all of that would be
drawn out along the line of sight. So its far side comes up to the front before the outline, as an
ellipse does, at a line that is the outline without what is smaller than the part is wide: what
sticks out beyond it is thin.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...base.arrays import F64
from ...base.poisson_disk import nearest_in
from .body import ReliefBody
from .silhouette import ReliefSilhouette
from .thickness import Thickness

REACH = 0.035  # x extent from the line, over which the far side comes up
EVEN = 0.02  # x extent, standard deviation over which the line has no waves
THIN = 0.2  # x the distance from the outline itself, that the line is away at least
RIM = 0.01  # x extent from the outline, over which it is looked at whether a form closes there
OPEN = -0.3, -0.05  # share more than an ellipse is thick there, from which it does not, and surely
MARGIN = 3.0  # x EVEN, around the grid


def closed(body: ReliefBody) -> ReliefBody:
    """Return `body` with its far side closed at the outline; what is seen stays."""
    outline = body.silhouette
    reach = REACH * outline.extent / outline.cell
    if reach < 1:
        return body
    cells = outline.cells.reshape(-1, 2)
    halves = [side.half(cells).reshape(outline.shape) for side in (body.front, body.back)]
    thick = halves[0] + halves[1]
    weight = outline.inside.astype(np.float64)

    def gathered(field: F64) -> F64:
        return np.asarray(cv2.GaussianBlur(field * weight, (0, 0), reach), np.float64)

    around = np.ones((2 * int(reach) + 1,) * 2, np.uint8)
    widest = np.asarray(cv2.dilate(thick * weight, around), np.float64)
    wide = gathered(widest) / np.maximum(gathered(weight), 1e-6)
    closes = wide * _ellipse(outline.depth / outline.cell / reach)
    rim = np.exp(-outline.depth / (RIM * outline.extent))
    more = gathered(rim * thick) / np.maximum(gathered(rim * closes), 1e-6) - 1
    amount = np.clip((more - OPEN[0]) / (OPEN[1] - OPEN[0]), 0, 1)
    away = _even(outline) / reach
    kept = np.minimum(wide * _ellipse(away) / np.maximum(thick, 1e-6), 1.0)
    kept = 1 - np.where(away < 1, amount * (1 - kept), 0.0)
    kept = kept.ravel()[nearest_in(outline.inside)]
    sides = [
        replace(side, square=_scaled(side, kept, half))
        for side, half in zip((body.front, body.back), halves, strict=True)
    ]
    moved = halves[0] - sides[0].half(cells).reshape(outline.shape)
    return replace(body, middle=body.middle + moved, front=sides[0], back=sides[1])


def _scaled(side: Thickness, kept: F64, half: F64) -> F64:
    """(h, w) the square of `side`, `half` (h, w) px thick, of which `kept` (h, w) is left.

    As steep at a rim as it is, and 0 where it is.
    """
    within = side.towards(kept * half, np.ones(half.shape)).square
    return np.where(side.square > 0, within, side.square * kept**2)


def _ellipse(away: F64) -> F64:
    """Height (h, w) of a quarter of an ellipse, `away` (h, w) from its end, of 1."""
    away = np.clip(away, 0, 1)
    return np.sqrt(away * (2 - away))


def _even(outline: ReliefSilhouette) -> F64:
    """(h, w) cells from the outline without its waves; few where it is beyond that.

    Thin parts keep their outline.
    """
    sigma = EVEN * outline.extent / outline.cell
    pad = int(MARGIN * sigma) + 1
    inside = outline.continued(outline.inside, pad).astype(np.uint8)
    depth, beyond = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (inside, 1 - inside))
    signed = np.asarray(depth - beyond, np.float64)
    radius = cv2.GaussianBlur(outline.continued(outline.radius, pad) / outline.cell, (0, 0), sigma)
    radius /= np.maximum(cv2.GaussianBlur(inside.astype(np.float64), (0, 0), sigma), 1e-6)
    share = np.clip(radius / sigma - 1, 0, 2) / 2
    even = signed + share * (cv2.GaussianBlur(signed, (0, 0), sigma) - signed)
    return np.maximum(even, THIN * np.maximum(signed, 0.0))[pad:-pad, pad:-pad]
