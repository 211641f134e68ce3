"""The fringe of a cut-out, in which hairs, blur and light from behind mix with its own colours.

What turns into view there is as what is farther in. A bright tip of a hair, drawn out over a whole
side, looks like nothing.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32
from .silhouette import largest_disc

LONGEST = 400  # px, longer side of the picture in which its width is found
MIXED = 0.03, 0.97  # alpha of what is soft
CRISP = (
    1.0  # px of that, across an edge as crisp as any: of drawn solids 0.7 to 1, of photos 4 to 8
)
DEEP = 8.0  # x what is soft beyond that: light from behind reaches farther in than softness does
AROUND = 0.03  # x the root of the area, along the outline: what is as wide
MOST = 0.08  # x the root of the area
OF_RADIUS, THIN = 0.35, 2.0  # x the radius of a limb, at most; px, of what is as thin as a hair


def inwardness(alpha: F32) -> F32:
    """(h, w) how far a pixel of a matte `alpha` (h, w) is inside its fringe: 0 at the outline.

    From 1 on it shows the object's own colours.
    """
    scale = min(1.0, LONGEST / max(alpha.shape))
    size = max(1, round(alpha.shape[1] * scale)), max(1, round(alpha.shape[0] * scale))
    small = np.asarray(cv2.resize(alpha, size, interpolation=cv2.INTER_AREA), np.float32)
    solid = np.pad((small > 0.5).astype(np.uint8), 1)
    root = float(np.sqrt(solid.sum()))
    if root == 0:
        return np.ones(alpha.shape, np.float32)
    away = cv2.distanceTransform(solid, cv2.DIST_L2, 5)[1:-1, 1:-1].astype(np.float64)
    soft = ((small > MIXED[0]) & (small < MIXED[1])).astype(np.float32)
    edge = cv2.morphologyEx(solid[1:-1, 1:-1], cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    area, length = (
        cv2.GaussianBlur(part, (0, 0), AROUND * root)
        for part in (soft, 0.5 * edge.astype(np.float32))  # both sides of an edge are in it
    )
    deep = np.clip(DEEP * (area / np.maximum(length, 1e-3) - CRISP), 1e-3, MOST * root)
    deep = np.minimum(deep, np.maximum(OF_RADIUS * largest_disc(away), THIN))
    inward = (away / deep).clip(0, 1).astype(np.float32)
    return np.asarray(cv2.resize(inward, alpha.shape[::-1]), np.float32)
