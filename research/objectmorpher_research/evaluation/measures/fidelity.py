"""PSNR, and SSIM of Wang, Bovik, Sheikh, Simoncelli, IEEE TIP 13(4), 2004, eq. 13."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F64, RGB

from ..error import EvaluationError
from .regions import Region, check_pair, weighted_mean

PEAK = 255.0  # of 8 bits
WINDOW, SIGMA = 11, 1.5  # px, Wang et al., section III.B
K1, K2 = 0.01, 0.03  # there too
HALF = WINDOW // 2


def psnr(a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
    """dB per region, of the mean squared error over all channels; infinite where they are equal."""
    check_pair(a, b)
    squared = ((a.astype(np.float64) - b) ** 2).mean(-1)  # (H, W)
    return tuple(_decibels(weighted_mean(squared, region)) for region in regions)


def ssim(a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
    """Return SSIM in [-1, 1] per region: the mean of `ssim_map` where the window fits."""
    inner = ssim_map(a, b)[HALF:-HALF, HALF:-HALF]
    cropped = (r if r is None else r[HALF:-HALF, HALF:-HALF] for r in regions)
    return tuple(weighted_mean(inner, region) for region in cropped)


def ssim_map(a: RGB, b: RGB) -> F64:
    """(H, W): eq. 13 round every pixel with the Gaussian window, the mean of the three channels.

    The outer 5 px see the picture mirrored.
    """
    check_pair(a, b)
    if min(a.shape[:2]) < WINDOW:
        raise EvaluationError(f"SSIM needs {WINDOW} px a side, the picture has {min(a.shape[:2])}")
    x, y = a.astype(np.float64), b.astype(np.float64)
    mean_x, mean_y = _blurred(x), _blurred(y)
    variance_x = _blurred(x * x) - mean_x**2
    variance_y = _blurred(y * y) - mean_y**2
    covariance = _blurred(x * y) - mean_x * mean_y
    c1, c2 = (K1 * PEAK) ** 2, (K2 * PEAK) ** 2
    above = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    below = (mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2)
    return (above / below).mean(-1)


def _blurred(values: F64) -> F64:
    window = (WINDOW, WINDOW)
    return np.asarray(
        cv2.GaussianBlur(values, window, SIGMA, borderType=cv2.BORDER_REFLECT), np.float64
    )


def _decibels(error: float) -> float:
    if error == 0:
        return float("inf")
    return float(10 * np.log10(PEAK**2 / error))
