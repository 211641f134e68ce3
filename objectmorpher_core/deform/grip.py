"""The hand of a handle: links around it are stiffer.

A load on one point of an elastic sheet makes a spike, however fine the sheet is. A hand takes
hold of a patch, which then moves nearly as one body, and the strain is spread over what is
around it. It reaches through the body and is as large as the limb that it holds: a patch of the
front alone would make a dent in a thick limb, and leave the flesh behind it where it was. Where
two hands meet, each holds its own side.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from .struts import thickness
from .surface_links import Surface

GRIP = 20.0  # x a link's weight, in the middle of the hand
SMALLEST, LARGEST = 0.1, 0.15  # x diameter: a hand's radius, between them as thick as the body is
DEEPEST = 0.6  # x diameter, that a hand reaches through
SHARED = 0.5  # x distance to the next handle: over this much two hands let go towards the middle


def other_sides(handles: F64, surface: Surface, spacing: float, diameter: float) -> F64:
    """(H, 3) where the body ends behind surface points (H, 3); themselves where none is met.

    `spacing` is the control points' mean one; all in the object frame.
    """
    if len(surface.means) == 0:
        return handles
    normals = surface.normals_near(handles)[:, 0]
    depths = thickness(handles, normals, spacing, DEEPEST * diameter, surface)
    return handles - depths[:, None] * normals


def stiffened(points: F64, weights: Sparse, handles: F64, ends: F64, diameter: float) -> F64:
    """Weights (E,) of the links, up to `GRIP` times larger around `handles` (H, 3).

    A hand is what is near the way from its handle to `ends` (H, 3), the other side of the body,
    but for the last bit, which the smallest hand covers. `points` (M, 3) control points;
    `weights` (M, M) symmetric, and so is the result.
    """
    depths = np.linalg.norm(ends - handles, axis=1)
    radii = np.clip(depths, SMALLEST * diameter, LARGEST * diameter)
    shares = 1.0 - np.minimum(SMALLEST * diameter / np.maximum(depths, 1e-300), 1.0)
    distances = _from_segments(points, handles, handles + shares[:, None] * (ends - handles))
    grip = np.maximum(1.0 - (distances / radii[:, None]) ** 2, 0.0) ** 2
    apart = np.linalg.norm(handles[:, None] - handles[None], axis=2)
    meeting = (apart > 1e-6 * diameter) & (apart < radii[:, None] + radii[None])
    for h, other in np.argwhere(meeting):
        nearer = (distances[other] - distances[h]) / (SHARED * apart[h, other])
        grip[h] *= np.clip(nearer, 0.0, 1.0)
    data = weights.data.copy()
    _stiffen(*frozen_rows(weights), frozen(grip), data)
    return data


def _from_segments(points: F64, starts: F64, ends: F64) -> F64:
    """Distances (H, M) of `points` (M, 3) from segments (H, 3) to (H, 3)."""
    ways = ends - starts
    squares = np.maximum((ways * ways).sum(1), 1e-300)
    gaps = points[None] - starts[:, None]  # (H, M, 3)
    shares = np.einsum("hma,ha->hm", gaps, ways) / squares[:, None]
    gaps -= shares.clip(0.0, 1.0)[..., None] * ways[:, None]
    return np.linalg.norm(gaps, axis=2)


@numba.njit(cache=True)
def _stiffen(starts, ends, weights, grip, data):
    for h in range(len(grip)):
        for i in range(len(starts) - 1):
            own = grip[h, i]
            if own == 0.0:
                continue
            for e in range(starts[i], starts[i + 1]):
                data[e] = max(data[e], weights[e] * (1.0 + (GRIP - 1.0) * own * grip[h, ends[e]]))
