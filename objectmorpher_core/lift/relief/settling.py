"""Fields over a silhouette without the waves that nobody has seen.

What a network says of what lies behind, and of how the middle of an object runs, is right on the
whole and wavy in detail. A field is settled by fitting a plane to it around each cell, as wide as
the part of the object there; a mean would flatten it towards the outline.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F64
from .silhouette import ReliefSilhouette

WIDTHS = (0.02, 0.05, 0.1)  # x extent, standard deviations over which planes are fitted
OF_RADIUS = 0.3  # x the radius of the part, that the width is
FINE = 4.0  # cells of a blur's standard deviation, beyond which it is found on fewer
STEADY = 0.05  # variance, x the width's own, that keeps a plane level where cells lie in a line


@dataclass(frozen=True, eq=False)
class Settling:
    """Planes over the cells of a silhouette, each cell as much as `weight` (h, w) says."""

    outline: ReliefSilhouette
    weight: F64

    def settled(self, field: F64) -> F64:
        """`field` (h, w) without waves shorter than the part is wide."""
        outline = self.outline
        wanted = np.clip(OF_RADIUS * outline.radius / outline.extent, WIDTHS[0], WIDTHS[-1])
        wanted = np.maximum(self.mean(wanted, WIDTHS[1]), WIDTHS[0])
        level = np.interp(np.log(wanted), np.log(WIDTHS), range(len(WIDTHS)))
        found = np.zeros(field.shape)
        for k, width in enumerate(WIDTHS):
            share = np.maximum(1 - np.abs(level - k), 0)
            if share.any():
                found += share * self._plane(field, width)
        return found

    def mean(self, field: F64, width: float) -> F64:
        """The mean of `field` (h, w) around each cell; `width` x extent, standard deviation."""
        total = self._gathered(field, width)
        return total / np.maximum(self._gathered(np.ones(field.shape), width), 1e-9)

    def multiple(self, field: F64, of: F64, width: float) -> F64:
        """Return the least-squares factor of `field` (h, w) over `of` (h, w) around each cell."""
        square = np.maximum(self._gathered(of**2, width), 1e-9)
        return self._gathered(field * of, width) / square

    def _plane(self, field: F64, width: float) -> F64:
        sigma = self._cells(width)
        y, x = np.indices(field.shape, np.float64) / sigma
        one = np.maximum(self._gathered(np.ones(field.shape), width), 1e-9)
        fields: list[F64] = [x, y, field, x * x, x * y, y * y]
        gathered = (self._gathered(f, width) / one for f in fields)
        mx, my, mean, xx, xy, yy = gathered
        xf, yf = (self._gathered(axis * field, width) / one for axis in (x, y))
        xx, xy, yy = xx - mx**2 + STEADY, xy - mx * my, yy - my**2 + STEADY
        xf, yf, det = xf - mx * mean, yf - my * mean, xx * yy - xy**2
        return mean + ((yy * xf - xy * yf) * (x - mx) + (xx * yf - xy * xf) * (y - my)) / det

    def _cells(self, width: float) -> float:
        return max(width * self.outline.extent / self.outline.cell, 0.5)

    def _gathered(self, field: F64, width: float) -> F64:
        """`field` (h, w) as weighted, blurred; on fewer cells where that is enough."""
        sigma = self._cells(width)
        step = max(1, int(sigma / FINE))
        down, across = field.shape
        weighted = self.weight * field
        if step == 1:
            return np.asarray(cv2.GaussianBlur(weighted, (0, 0), sigma), np.float64)
        size = -(-across // step), -(-down // step)
        few = cv2.resize(weighted, size, interpolation=cv2.INTER_AREA)
        few = cv2.GaussianBlur(few, (0, 0), sigma / step)
        whole = cv2.resize(few, (across, down), interpolation=cv2.INTER_LINEAR)
        return np.asarray(whole, np.float64)
