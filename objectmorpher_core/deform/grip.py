"""The hand of a handle: links around it are stiffer.

A load on one point of an elastic sheet makes a spike, however fine the sheet is. A hand takes
hold of a patch, which then moves nearly as one body, and the strain is spread over what is
around it. Where two hands meet, each holds its own side.
"""

from __future__ import annotations

import numba
import numpy as np

from ..arrays import F64, Sparse, frozen, frozen_rows

GRIP = 20.0  # x a link's weight, in the middle of the hand
RADIUS = 0.1  # x diameter, of the patch
SHARED = 0.5  # x distance to the next handle: over this much two hands let go towards the middle


def stiffened(points: F64, weights: Sparse, handles: F64, diameter: float) -> F64:
    """Weights (E,) of the links, up to `GRIP` times larger around `handles` (H, 3).

    `points` (M, 3) control points; `weights` (M, M) symmetric, and so is the result.
    """
    distances = np.linalg.norm(points[None] - handles[:, None], axis=2)  # (H, M)
    grip = np.maximum(1.0 - (distances / (RADIUS * diameter)) ** 2, 0.0) ** 2
    apart = np.linalg.norm(handles[:, None] - handles[None], axis=2)
    meeting = (apart > 1e-6 * diameter) & (apart < 2 * RADIUS * diameter)
    for h, other in np.argwhere(meeting):
        nearer = (distances[other] - distances[h]) / (SHARED * apart[h, other])
        grip[h] *= np.clip(nearer, 0.0, 1.0)
    data = weights.data.copy()
    _stiffen(*frozen_rows(weights), frozen(grip), data)
    return data


@numba.njit(cache=True)
def _stiffen(starts, ends, weights, grip, data):
    for h in range(len(grip)):
        for i in range(len(starts) - 1):
            own = grip[h, i]
            if own == 0.0:
                continue
            for e in range(starts[i], starts[i + 1]):
                data[e] = max(data[e], weights[e] * (1.0 + (GRIP - 1.0) * own * grip[h, ends[e]]))
