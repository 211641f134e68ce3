"""Regions of a picture in which a measure is taken: everywhere, inside a mask, outside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB

from ..error import EvaluationError

Region = F64 | None  # (H, W) weights in [0, 1]; None: the whole picture
# Measures two pictures (H, W, 3) of one size, once for every region.
Measure = Callable[[RGB, RGB, Sequence[Region]], tuple[float, ...]]


def weighted_mean(values: F64, region: Region) -> float:
    """Mean of (h, w) values over a region of any size; nan where the region has no part in it.

    The region is averaged down to the values' grid, so that a whole region gives the plain mean.
    """
    if region is None:
        return float(values.mean())
    height, width = values.shape
    weights = region
    if region.shape != values.shape:
        weights = cv2.resize(region, (width, height), interpolation=cv2.INTER_AREA)
    total = float(weights.sum())
    return float((values * weights).sum() / total) if total > 0 else float("nan")


def check_pair(a: RGB, b: RGB) -> None:
    """Raises EvaluationError unless both are 8-bit RGB of one size."""
    if a.shape != b.shape:
        sizes = f"{a.shape[1]} x {a.shape[0]} px and {b.shape[1]} x {b.shape[0]} px"
        raise EvaluationError(f"two pictures of different sizes cannot be compared: {sizes}")
    assert a.dtype == b.dtype == np.uint8 and a.ndim == 3
