"""A flat sheet that looks like the photo: a plane from the network's front and normals."""

from __future__ import annotations

import numpy as np

from ...base.arrays import F64
from .evidence import NORMAL_ERROR, TAIL, Evidence, Misfit

ROUNDS = 8
STEEPEST = 0.25  # cosine to the ray, below which a sheet is not turned


def fit_flat(evidence: Evidence) -> tuple[F64, Misfit]:
    """The plane (3,), of which inverse depth is the product with (x, y, 1) tangents."""
    own = evidence.sure
    rays = np.concatenate([evidence.grid.tangents[own], np.ones((own.sum(), 1))], 1)
    inverse, error = 1 / evidence.depth[own], evidence.error[own]
    mean = float(np.median(inverse))
    weight = np.ones(len(rays))
    normals, heed = evidence.normal[own], np.ones(len(rays))
    plane = np.array([0.0, 0.0, mean])
    off = apart = np.zeros(len(rays))
    for _ in range(ROUNDS):
        # A plane's normal is that of its inverse depths; a unit one, times its distance.
        scaled = weight / error / mean
        towards = -(normals * heed[:, None]).sum(0) / heed.sum()
        towards /= np.linalg.norm(towards)
        pull = len(rays) * heed.mean() / NORMAL_ERROR**2 / np.linalg.norm(plane) ** 2
        system = (rays * scaled[:, None] ** 2).T @ rays + pull * np.eye(3)
        wanted = (rays * scaled[:, None] ** 2).T @ inverse
        plane = np.linalg.solve(system, wanted + pull * towards * np.linalg.norm(plane))
        off = (rays @ plane - inverse) / error / mean
        weight = 1 / (1 + (off / TAIL) ** 2)
        unit = plane / np.linalg.norm(plane)
        apart = np.linalg.norm(normals + unit, axis=1) / NORMAL_ERROR
        heed = 1 / (1 + (apart / TAIL) ** 2) ** 2
    depth, normal = ((r**2 / (1 + (r / TAIL) ** 2)).mean() for r in (off, apart))
    return plane, Misfit(0.0, float(depth), float(normal), 0.0)
