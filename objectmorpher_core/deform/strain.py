"""How much a pose bends and stretches the object, control point by control point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from ..base.threads import FAST
from ..document.model import Pose


@dataclass(frozen=True, eq=False)
class Strain:
    """Dimensionless; all 0 or 1 for a rigid motion."""

    energy: F64  # (M,) share of Eq. 2 over the weighted squares of the links at rest
    most: F64  # (M,) largest stretch along the surface, 1 = none
    least: F64  # (M,) smallest


def measure_strain(points: F64, weights: Sparse, pose: Pose) -> Strain:
    """Strain of `pose` on the links `weights` (M, M) between rest control points (M, 3).

    The surroundings of a control point are mapped by F_i = (sum w e' e^T)(sum w e e^T)^-1, the
    least-squares fit to its links. Its links lie along a surface, so F_i is taken in the plane
    of their two widest directions, and its singular values are the stretches.
    """
    own = frozen(points, np.float64), frozen(pose.points), frozen(pose.rotations)
    before, after, energy = _sums(*frozen_rows(weights), *own)
    squares = np.trace(before, axis1=1, axis2=2)
    spread, axes = np.linalg.eigh(before)  # rising
    widest = np.maximum(spread[:, 2], 1e-300)
    is_line = spread[:, 1] < 1e-9 * widest  # of links all in one line: no second direction
    scale = np.where(np.stack([is_line, np.zeros_like(is_line)], 1), 1.0, spread[:, 1:])
    plane = after @ axes[:, :, 1:] / np.maximum(scale, 1e-300)[:, None, :]  # F V, (M, 3, 2)
    stretches = np.linalg.svd(plane, compute_uv=False)
    stretches[is_line] = stretches[is_line, :1]
    stretches[squares <= 0] = 1.0
    most, least = np.asarray(stretches.T, np.float64)
    return Strain(energy / np.maximum(squares, 1e-300), most, least)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _sums(starts, others, weights, points, moved, rotations):
    """Over the links of each control point: w e e^T and w e' e^T (M, 3, 3), w |e' - R e|^2 (M,)."""
    count = len(points)
    before, after = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    energy = np.zeros(count)
    for i in range(count):
        for k in range(starts[i], starts[i + 1]):
            j, w = others[k], weights[k]
            x, y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            z = points[j, 2] - points[i, 2]
            for a in range(3):
                old = points[j, a] - points[i, a]
                new = moved[j, a] - moved[i, a]
                turned = rotations[i, a, 0] * x + rotations[i, a, 1] * y + rotations[i, a, 2] * z
                energy[i] += w * (new - turned) ** 2
                before[i, a, 0] += w * old * x
                before[i, a, 1] += w * old * y
                before[i, a, 2] += w * old * z
                after[i, a, 0] += w * new * x
                after[i, a, 1] += w * new * y
                after[i, a, 2] += w * new * z
    return before, after, energy
