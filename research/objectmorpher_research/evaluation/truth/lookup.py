"""Values of an image between its pixels, at any number of places."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, U8

AT_ONCE = 30_000  # places: cv2.remap takes fewer than 32,768 rows


def looked_up(
    image: F32 | U8, at: F64, how: int = cv2.INTER_LINEAR, border: int = cv2.BORDER_CONSTANT
) -> F64:
    """(n, channels) of an image (h, w) or (h, w, c) at its px (n, 2), 0 in the first's middle.

    `how` and `border` are OpenCV's.
    """
    x, y = at.astype(np.float32).T
    channels = 1 if image.ndim == 2 else image.shape[2]
    parts = [
        cv2.remap(
            image, x[k : k + AT_ONCE, None], y[k : k + AT_ONCE, None], how, borderMode=border
        ).reshape(-1, channels)
        for k in range(0, len(x), AT_ONCE)
    ]
    return np.concatenate(parts).astype(np.float64) if parts else np.zeros((0, channels))


def triplanar(look: Callable[[F64], F64], at: F64, normals: F64) -> F64:
    """(n, 3) of a picture laid around places (n, 3) with normals (n, 3) from three sides.

    `look` gives the colours (n, 3) of places (n, 2) in the picture's plane.
    """
    weights = np.abs(normals) ** 4
    weights /= np.maximum(weights.sum(1, keepdims=True), 1e-12)
    total = np.zeros((len(at), 3))
    for axis, (u, v) in enumerate(((2, 1), (0, 2), (0, 1))):
        total += weights[:, axis, None] * look(at[:, [u, v]])
    return total
