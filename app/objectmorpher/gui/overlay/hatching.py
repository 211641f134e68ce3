"""Hatch lines over a region that is the union of equal discs."""

from __future__ import annotations

import numpy as np

from objectmorpher_core.base.arrays import F64


def hatch(centres: F64, radius: float, angle: float, step: float) -> F64:
    """Lines (S, 2, 2) px at `angle` degrees, `step` px apart, within discs around (N, 2) px.

    The lines lie on one grid for the whole picture, so that those of neighbouring discs join.
    """
    if len(centres) == 0:
        return np.empty((0, 2, 2))
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    across = np.array([-along[1], along[0]])
    u, v = centres @ along, centres @ across
    first = np.ceil((v - radius) / step).astype(int)
    last = np.floor((v + radius) / step).astype(int)
    disc = np.repeat(np.arange(len(centres)), last - first + 1)
    line = np.concatenate([np.arange(a, b + 1) for a, b in zip(first, last, strict=True)])
    half = np.sqrt(np.maximum(radius**2 - (line * step - v[disc]) ** 2, 0.0))
    low, high = u[disc] - half, u[disc] + half
    order = np.lexsort((low, line))
    line, low, high = line[order], low[order], high[order]
    pieces: list[list[float]] = []
    for row, start, end in zip(line.tolist(), low.tolist(), high.tolist(), strict=True):
        if pieces and pieces[-1][0] == row and start <= pieces[-1][2]:
            pieces[-1][2] = max(pieces[-1][2], end)
        else:
            pieces.append([row, start, end])
    rows = np.array(pieces)
    ends = rows[:, 1:, None] * along + (rows[:, :1, None] * step) * across
    return ends.astype(np.float64)
