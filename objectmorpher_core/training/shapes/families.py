"""The kinds of objects; each is a function of a random generator that returns a `Builder`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .solid import Builder

Family = Callable[[np.random.Generator], Builder]


def superquadrics(rng: np.random.Generator) -> Builder:
    """One to four rounded lumps, boxes and pillows that run into one another."""
    built = Builder()
    soft = rng.uniform(0, 0.3) if rng.random() < 0.6 else 0.0
    built.part(0)
    for k in range(rng.integers(1, 5)):
        half = np.exp(rng.normal(-0.5, 0.35, 3))
        at = np.zeros(3) if k == 0 else rng.normal(0, 0.6, 3)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn = turn * np.sign(np.linalg.det(turn))
        side, above = rng.uniform(0.25, 1.3, 2)
        built.superquadric(at, half, side, above, turn, soft=soft)
        if soft == 0.0:
            built.part(k + 1)
    return built


FAMILIES: dict[str, Family] = {"superquadrics": superquadrics}
