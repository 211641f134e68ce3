"""Rounded lumps, boxes and pillows."""

from __future__ import annotations

import numpy as np

from ..solid import PrimitiveBuilder
from .making import Rng, chance, span


def superquadrics(rng: Rng) -> PrimitiveBuilder:
    """Make one to five superquadrics that run into one another."""
    built = PrimitiveBuilder()
    soft = span(rng, 0, 0.3) if chance(rng, 0.6) else 0.0
    middles: list[np.ndarray] = []
    sizes: list[float] = []
    built.part(0)
    for k in range(rng.integers(1, 6)):
        half = np.exp(rng.normal(-0.5, 0.35, 3))
        at = np.zeros(3)
        if k:  # on the surface of one before it
            way = rng.normal(size=3)
            other = int(rng.integers(k))
            at = middles[other] + way / np.linalg.norm(way) * span(rng, 0.5, 1.0) * sizes[other]
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn = turn * np.sign(np.linalg.det(turn))
        side, above = rng.uniform(0.25, 1.3, 2)
        built.superquadric(at, half, side, above, turn, soft=soft)
        middles.append(at)
        sizes.append(float(half.min()) + 0.3 * float(half.max() - half.min()))
        if soft == 0.0 or chance(rng, 0.15):
            built.part(k + 1)
    return built
