"""What a body leans more than the network sees: of the plane nearest to its front.

A photo hardly tells how far a thing leans. Who must answer so that the mean absolute error is the
least gives the median of what it may be, which is less, whichever way it leans; and what is blended
with an upright silhouette leans less again. What such a blend lacks was measured on 176 views of
made solids and of meshes that the network was not trained on. Where the network sees a lean of more
than about ten degrees it is 1.2 times as much again: the root mean square of the error of the
slopes becomes 0.33 instead of 0.38 to the sides, and 0.33 instead of 0.42 up and down. What seems
to lean less is a shape as often as a lean, and stays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arrays import F64
from ...base.camera import Camera
from .body import ReliefBody

LACKING = 1.2  # x the lean that the network sees ...
LEAST, SURELY = 0.15, 0.25  # ... of slopes from the first on, and all of it from the second on
STEEPEST = 1.0  # slope that a body leans more at most


def leaning(body: ReliefBody, seen: F64, camera: Camera, share: float) -> ReliefBody:
    """Return `body` with what it lacks of the lean of `seen` (h, w), heights of its front, px.

    The slope is of the logarithm of the depth, in which a plane in perspective is nearly one. What
    stands as a prism leans as its outline says. `share` in [0, 1] of that.
    """
    outline, focal = body.silhouette, camera.focal
    if body.standing.prism is not None:
        return body
    tangents = (outline.photo_xy(outline.cells) - [camera.cx, camera.cy]) / focal
    own, away = tangents[outline.inside], np.log(focal - seen[outline.inside])
    middle = own.mean(0)
    own = own - middle
    slope = np.linalg.lstsq(own.T @ own, own.T @ away, rcond=None)[0]
    slope *= share * LACKING * np.clip((np.abs(slope) - LEAST) / (SURELY - LEAST), 0, 1)
    if not slope.any():
        return body
    slope *= min(1.0, STEEPEST / float(np.linalg.norm(slope)))
    return replace(body, middle=focal - (focal - body.middle) * np.exp((tangents - middle) @ slope))
