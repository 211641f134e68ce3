"""The numbers of a shape that fit the evidence best, from a first guess."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from ...base.arrays import F64
from .drawing import Mesh
from .evidence import Evidence, Misfit

TRIALS = 18  # of the simplex, for each number
HOPELESS = 60.0  # misfit, from which nothing comes of refining
CLOSE = 0.004  # difference of misfits that no longer matters

Build = Callable[[F64], Mesh]


def refined(build: Build, start: F64, steps: F64, evidence: Evidence) -> tuple[F64, Misfit]:
    """Numbers (n,) near `start` and their misfit, by the simplex method (Nelder and Mead 1965).

    `steps` (n,): how far off `start` may well be.
    """

    if (first := evidence.misfit(build(start))).total > HOPELESS:
        return start, first
    best = least(lambda numbers: evidence.misfit(build(numbers)).total, start, steps)
    return best, evidence.misfit(build(best))


def least(cost: Callable[[F64], float], start: F64, steps: F64) -> F64:
    """Numbers (n,) near `start` that cost least, likewise."""
    best, size = np.zeros(len(start)), 1.0
    for _ in range(2):  # begun again where it ended, as it may have collapsed (Kelley 1999)
        simplex = best + size * np.vstack([np.zeros(len(start)), np.eye(len(start))])
        found = minimize(
            lambda change: cost(start + steps * change), best, method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": TRIALS * len(start), "fatol": CLOSE,
                     "xatol": 0.02, "adaptive": True},
        )  # fmt: skip
        best, size = np.asarray(found.x, np.float64), -0.3
    return start + steps * best
