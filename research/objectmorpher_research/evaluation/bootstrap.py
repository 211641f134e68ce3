"""Confidence intervals by the percentile bootstrap (Efron & Tibshirani 1993, chapter 13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RESAMPLES = 10_000
NORMAL = 1.96  # deviations on either side hold 95 % of a normal distribution


@dataclass(frozen=True)
class Estimate:
    """A figure, and where the interval is known, that of 95 %."""

    value: float
    low: float | None = None
    high: float | None = None


def mean_with_interval(values: Sequence[float], seed: int = 0) -> Estimate:
    """The mean of one value a picture; what is not a number is left out, fewer than two have no
    interval, nor have infinite ones."""
    numbers = np.array([v for v in values if not np.isnan(v)], np.float64)
    if not len(numbers):
        return Estimate(float("nan"))
    mean = float(numbers.mean())
    if len(numbers) < 2 or not np.isfinite(mean):
        return Estimate(mean)
    random = np.random.default_rng(seed)
    drawn = random.integers(0, len(numbers), (RESAMPLES, len(numbers)))
    low, high = np.quantile(numbers[drawn].mean(1), (0.025, 0.975))
    return Estimate(mean, float(low), float(high))
