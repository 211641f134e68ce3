"""Ways in which files have their axes, and the turns that bring them to ours.

Ours are a camera's: x right, y down, z away from the viewer (DESIGN section 2).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arrays import F64
from ...base.rotations import matrices_from_quats, quats_from_matrices
from ...document.gaussians import Gaussians

HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x: y up and z back, as in glTF and .spz
QUARTER_TURN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # z up and y away: .stl


def half_turned(gaussians: Gaussians) -> Gaussians:
    """Turned by 180 degrees about x, exactly: its own inverse."""
    w, x, y, z = gaussians.quats.T
    means = gaussians.means * np.array([1, -1, -1], np.float32)
    return replace(gaussians, means=means, quats=np.stack([-x, w, -z, y], axis=1))


def turned(gaussians: Gaussians, matrix: F64) -> Gaussians:
    """The Gaussians after a rotation (3, 3) about the origin."""
    axes = matrix @ matrices_from_quats(gaussians.quats.astype(np.float64))
    return replace(gaussians, means=gaussians.means @ matrix.T, quats=quats_from_matrices(axes))
