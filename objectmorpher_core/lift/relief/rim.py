"""The outlines of a silhouette as lines, along which a surface has its rim."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from ...base.arrays import F64, Mask

SHORTEST = 4  # cells of a rim that is looked at
STAIRS = 1.5  # cells, over which the staircase of an outline is evened


@dataclass(frozen=True, eq=False)
class RimLine:
    """A closed outline of a silhouette: of the object, or of a hole in it."""

    xy: F64  # (n, 2) grid coordinates on the outline itself, evened
    inward: F64  # (n, 2) unit

    @property
    def length(self) -> F64:
        """(n + 1,) cells from its first place."""
        steps = np.linalg.norm(np.roll(self.xy, -1, axis=0) - self.xy, axis=1)
        return np.r_[0.0, np.cumsum(steps)]


def rim_lines(inside: Mask) -> list[RimLine]:
    """Return all outlines of cells (h, w) that are long enough to have a shape."""
    found, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    lines = []
    for ring in found:
        cells = ring[:, 0]
        if len(cells) < SHORTEST:
            continue
        xy = gaussian_filter1d(cells.astype(np.float64), STAIRS, axis=0, mode="wrap")
        way = np.roll(xy, -1, axis=0) - np.roll(xy, 1, axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        # The object lies to one side of all lines, at the centres of its outermost cells.
        away = np.column_stack([-way[:, 1], way[:, 0]])
        side = np.rint(xy + 1.5 * away).astype(int)
        h, w = inside.shape
        beyond = inside[np.clip(side[:, 1], 0, h - 1), np.clip(side[:, 0], 0, w - 1)]
        if beyond.mean() > 0.5:
            away = -away
        lines.append(RimLine(xy + 0.5 * away, -away))
    return lines
