"""A ring that looks like the photo: a round tube about an axis, as a doughnut, a tyre, a bracelet.

What is seen of one is between two outlines, both nearly ellipses: the outer one's half axes are the
sums of the ring's radius, foreshortened along one, and of the tube's; the hole's are the
differences.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F64
from .drawing import Mesh
from .evidence import STRIDE, Evidence, Misfit, least
from .solids import AROUND, FINE, tube

LEAST_HOLE = 0.01  # x the filled outline's area
CENTRAL = 0.35  # x the outline's half axis, that a hole's middle may be off
STEPS = np.array([0.03, 0.03, 0.1, 0.1, 0.05, 0.1, 0.2])  # of the numbers of a ring
HALF_MOMENT = 2.0  # standard deviations that an ellipse's half axis is


def fit_ring(evidence: Evidence) -> tuple[Mesh, Misfit] | None:
    """The best ring; None where nothing has a hole amid it."""
    found = _ellipses(evidence)
    if found is None:
        return None
    (middle, way, half), hole = found
    radius, thick = 0.5 * (half[0] + hole[0]), 0.5 * (half[0] - hole[0])
    lean = float(np.arcsin(np.clip(0.5 * (half[1] + hole[1]) / radius, 0.1, 0.99)))
    depth = float(np.median(evidence.depth[evidence.sure]))

    def builder(sign: float):
        def build(numbers: F64, around: int = AROUND) -> Mesh:
            x, y, turn, more, wide, width, height = numbers
            centre = np.append(middle + radius * np.array([x, y]), 1.0)
            cosine, sine = np.cos(turn), np.sin(turn)
            along = np.array([[cosine, -sine], [sine, cosine]]) @ [-way[1], way[0]]
            forward = centre / np.linalg.norm(centre)
            flat = np.append(along, 0.0) - forward * (forward[:2] @ along)
            flat /= np.linalg.norm(flat)
            own = sign * (lean + more)
            axis = np.cos(own) * flat + np.sin(own) * forward
            sizes = depth * np.array([radius * np.exp(wide), thick * np.exp(width), 0.0])
            sizes[2] = sizes[1] * np.exp(height)
            return tube(depth * centre, axis, sizes, around)

        return build

    fits = []
    for sign in (1.0, -1.0):
        build = builder(sign)
        best = np.zeros(7)
        for _ in range(2):  # seven numbers take longer than the others' do
            best = least(lambda own, b=build: evidence.misfit(b(own)).total, best, STEPS)
        fits.append((build(best, FINE), evidence.misfit(build(best))))
    return min(fits, key=lambda fit: fit[1].total)


Ellipse = tuple[F64, F64, F64]  # middle (2,) tangents, unit long axis (2,), half axes (2,)


def _ellipses(evidence: Evidence) -> tuple[Ellipse, F64] | None:
    """Of the filled outline, and the half axes (2,) of its hole likewise; None without a hole."""
    fine = evidence.fine.astype(np.uint8)
    rings, _ = cv2.findContours(fine, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(fine), rings, -1, 1, cv2.FILLED)
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(filled - fine, connectivity=4)
    areas = np.asarray(stats)[1:, cv2.CC_STAT_AREA]
    if not len(areas) or areas.max() < LEAST_HOLE * filled.sum():
        return None
    outer, inner = (
        _ellipse(np.argwhere(part)[:, ::-1].astype(np.float64))
        for part in (filled > 0, np.asarray(pieces) == 1 + int(np.argmax(areas)))
    )
    if np.linalg.norm(outer[0] - inner[0]) > CENTRAL * outer[2][1]:
        return None
    step = evidence.grid.step / STRIDE
    middle = np.array(evidence.grid.start) + step * (outer[0] - STRIDE // 2)
    return (middle, outer[1], step * outer[2]), step * inner[2]


def _ellipse(cells: F64) -> Ellipse:
    """The ellipse with the moments of cells (n, 2)."""
    values, axes = np.linalg.eigh(np.cov((cells - cells.mean(0)).T))
    half = HALF_MOMENT * np.sqrt(np.maximum(values[::-1], 1e-9))
    return cells.mean(0), axes[:, 1], half
