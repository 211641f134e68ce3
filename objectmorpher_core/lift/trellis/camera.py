"""The camera, in closed form, from the place of each cell in the picture.

The direct linear transform (Hartley & Zisserman, 2nd ed., 4.4 and 7.1), then an RQ decomposition.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.linalg import rq

from ...base.arrays import F64
from ...base.camera import Camera
from .. import LiftError

LEAST = 6  # points that tell a camera


@dataclass(frozen=True, eq=False)
class Framing:
    """The view of an object in a picture."""

    intrinsic: F64  # (3, 3), of a picture whose side is 1, x right and y down
    camera_from_object: F64  # (3, 4) rotation and translation
    points: F64  # (N, 3) object frame, of which the network said where they are seen
    uv: F64  # (N, 2) where, in the picture whose side is 1

    def project(self, points: F64) -> F64:
        """Places (N, 2) in the picture, of points (N, 3)."""
        seen = points @ self.camera_from_object[:, :3].T + self.camera_from_object[:, 3]
        xyw = seen @ self.intrinsic.T
        return xyw[:, :2] / xyw[:, 2:]


def view(points: F64, uv: F64) -> Framing:
    """The camera for which `points` (N, 3) fall on `uv` (N, 2). Raises LiftError."""
    if len(points) < LEAST:
        raise LiftError(f"{len(points)} points are too few to tell how the object is seen")
    to_unit, unit = _normed(points)
    to_square, square = _normed(uv)
    zero, u, v = np.zeros_like(unit), square[:, :1], square[:, 1:2]
    rows = np.concatenate([np.hstack([unit, zero, -u * unit]), np.hstack([zero, unit, -v * unit])])
    values, vectors = np.linalg.eigh(rows.T @ rows)
    if values[1] <= 1e-12 * values[-1]:
        raise LiftError("the object's cells are too flat to tell how it is seen")
    matrix = np.linalg.inv(to_square) @ vectors[:, 0].reshape(3, 4) @ to_unit
    if np.linalg.det(matrix[:, :3]) < 0:  # its sign is free: what is seen is before the camera
        matrix = -matrix
    intrinsic, turn = rq(matrix[:, :3])
    signs = np.diag(np.sign(np.diag(intrinsic)))
    intrinsic, turn = intrinsic @ signs, signs @ turn
    shift = np.linalg.solve(intrinsic, matrix[:, 3])
    pose = np.column_stack([turn, shift]).astype(np.float64)
    return Framing(intrinsic / intrinsic[2, 2], pose, points, uv)


def _normed(points: F64) -> tuple[F64, F64]:
    """The similarity (d + 1, d + 1) that centres and scales points (N, d), and what it gives."""
    middle = points.mean(0)
    size = max(float(np.sqrt(((points - middle) ** 2).sum(1).mean())), 1e-12)
    width = points.shape[1]
    matrix = np.eye(width + 1) * np.sqrt(width) / size
    matrix[:width, width] = -middle * np.sqrt(width) / size
    matrix[width, width] = 1.0
    return matrix, np.column_stack([points, np.ones(len(points))]) @ matrix.T


def pose_in(camera: Camera, points: F64, xy: F64) -> F64 | None:
    """(4, 4) world from object for which `camera` sees `points` (N, 3) at photo px `xy` (N, 2).

    None where there is none with all of them in front.
    """
    inner = np.array([[camera.focal, 0, camera.cx], [0, camera.focal, camera.cy], [0, 0, 1.0]])
    try:
        fits, turn, shift = cv2.solvePnP(points, xy, inner, None, flags=cv2.SOLVEPNP_SQPNP)
        turn, shift = cv2.solvePnPRefineLM(points, xy, inner, None, turn, shift)
    except cv2.error:
        return None
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
    depths = points @ matrix[2, :3] + matrix[2, 3]
    return matrix if fits and np.isfinite(matrix).all() and depths.min() > 0 else None
