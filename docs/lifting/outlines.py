"""What a turned picture's outline says of it: wobble, torn pieces and holes.

*Wobble* is the total absolute curvature of an outline over that of the outline it should have. A
convex outline has 2 pi, whatever its shape; each dent adds to it what it bends in and out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d
from skimage.measure import find_contours

from objectmorpher_core.base.arrays import F32, F64

SIGMA = 0.01  # x the square root of the area: what is smaller than that is no wobble
STEP = 0.25  # x sigma, between two places of a resampled outline
LEAST = 0.002  # x the area, from which a piece or a hole counts as a part of the outline
SPECK = 6  # px, from which a piece or a hole is one
FRAME = 2.5  # px from the picture's frame, where an outline is its cut and no outline


@dataclass(frozen=True)
class Outline:
    """Of what a coverage covers."""

    curvature: float  # radians, total and absolute, the frame's share left out
    pieces: int  # apart from one another
    holes: int
    torn: float  # share of the area that is not of the largest piece


def outline_of(alpha: F32 | F64) -> Outline:
    """Of a coverage (h, w)."""
    solid = (alpha > 0.5).astype(np.uint8)
    area = float(solid.sum())
    sigma = SIGMA * np.sqrt(max(area, 1.0))
    total = 0.0
    for ring in find_contours(np.pad(alpha.astype(np.float64), 1), 0.5):
        x, y = ring[:, 1], ring[:, 0]
        size = 0.5 * abs(float(np.dot(x[:-1], y[1:]) - np.dot(x[1:], y[:-1])))
        if size >= max(LEAST * area, SPECK):
            total += _curvature(ring - 0.5, sigma, alpha.shape)
    pieces = _sizes(solid, 8)
    holes = _sizes(1 - np.pad(solid, 1), 4)[1:]  # the largest is what is around
    torn = 1 - float(pieces[:1].sum()) / max(area, 1.0)
    return Outline(total, int((pieces >= SPECK).sum()), int((holes >= SPECK).sum()), torn)


def _curvature(ring: F64, sigma: float, shape: tuple[int, ...]) -> float:
    """Of a closed outline (n, 2), rows and columns in px, of a picture of `shape`."""
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
    count = max(16, int(length[-1] / (STEP * sigma)))
    at = np.linspace(0, length[-1], count, endpoint=False)
    step = length[-1] / count
    even = np.column_stack([np.interp(at, length, ring[:, k]) for k in (0, 1)])
    smooth = gaussian_filter1d(even, sigma / step, axis=0, mode="wrap")
    way = np.roll(smooth, -1, axis=0) - smooth
    angle = np.arctan2(way[:, 0], way[:, 1])
    turn = (np.diff(angle, append=angle[0]) + np.pi) % (2 * np.pi) - np.pi
    edge = np.minimum(even, np.array(shape[:2]) - even).min(1) < FRAME
    reach = 2 * int(np.ceil(3 * sigma / step)) + 1
    near = cv2.dilate(np.r_[edge, edge, edge].astype(np.uint8)[None], np.ones((1, reach)))[0]
    return float(np.abs(turn)[near[len(edge) : 2 * len(edge)] == 0].sum())


def _sizes(mask: np.ndarray, ways: int) -> np.ndarray:
    """px of the connected parts of `mask` (h, w) u8, the largest first."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=ways)
    return np.sort(np.asarray(stats)[1:, cv2.CC_STAT_AREA])[::-1]
