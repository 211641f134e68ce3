"""Gaussians for the formats, and what there is to say about two sets of them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from objectmorpher_core.document.gaussians import Gaussians


def gaussians(count: int = 20, seed: int = 7) -> Gaussians:
    """Of an object one unit large, most of them thin."""
    random = np.random.default_rng(seed)
    quats = random.normal(size=(count, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    return Gaussians(
        means=random.normal(size=(count, 3)).astype(np.float32),
        quats=quats.astype(np.float32),
        scales=np.exp(random.normal(-4, 1, (count, 3))).astype(np.float32),
        opacities=random.uniform(0.01, 0.99, count).astype(np.float32),
        colors=random.uniform(0, 1, (count, 3)).astype(np.float32),
    )


def matched(back: Gaussians, cloud: Gaussians) -> Gaussians:
    """`back` in the order of `cloud`; formats may store them in another one."""
    there, here = (np.column_stack([c.means, c.colors, c.opacities]) for c in (back, cloud))
    order = cKDTree(there).query(here)[1]
    assert len(back) == len(cloud)
    assert len(np.unique(order)) == len(cloud), "two Gaussians came back as one"
    return back.select(order)


def turn_between(one: Gaussians, other: Gaussians) -> np.ndarray:
    """(N,) radians between the axes of two sets."""
    near = np.where((one.quats * other.quats).sum(1, keepdims=True) < 0, -1, 1)
    apart = np.linalg.norm(one.quats.astype(float) - near * other.quats, axis=1)
    return 4 * np.arcsin(np.minimum(apart / 2, 1))  # arccos of a dot product loses half the digits
