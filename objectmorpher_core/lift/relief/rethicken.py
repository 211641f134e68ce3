"""Another thickness for an object that is lifted already: at once, while a slider is dragged.

Every Gaussian slides along its own ray of the photo, its distance from the middle sheet times a
factor: z' = z_m + k (z - z_m). So the photo at rest stays what it was, and the same Gaussians
carry the same pieces of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.arrays import F32, F64
from ...base.camera import Camera
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject
from .. import LiftError


def with_thickness(lifted: LiftedObject, camera: Camera, factor: float) -> LiftedObject:
    """`lifted` thicker by `factor`; `camera` is the photo's.

    Raises LiftError for an object without a middle sheet: an imported one.
    """
    if lifted.middle is None:
        raise LiftError("only an object that was lifted from the photo has a thickness")
    world = lifted.world_points(lifted.gaussians.means.astype(np.float64))
    middle = lifted.middle.astype(np.float64)
    moved, linear = _slid(world, middle, camera.focal, factor)
    points = lifted.world_points(lifted.control_points.astype(np.float64))
    nearest = _nearest(lifted.control_points, lifted.gaussians.means)
    nodes, _ = _slid(points, middle[nearest], camera.focal, factor)
    centre = 0.5 * (moved.min(0) + moved.max(0))
    largest = float((moved.max(0) - moved.min(0)).max())
    world_from_object = np.diag([largest, largest, largest, 1.0])
    world_from_object[:3, 3] = centre
    gaussians = _in_world(lifted).moved(moved, linear)
    gaussians = Gaussians(
        ((gaussians.means - centre) / largest).astype(np.float32), gaussians.quats,
        gaussians.scales / np.float32(largest), gaussians.opacities, gaussians.colors,
    )  # fmt: skip
    # The same surface drawn out or in: each piece shows what it did.
    still, sides = np.zeros_like(moved), lifted.sides
    return replace(
        lifted,
        sides=None if sides is None else sides.moved(still, linear),
        gaussians=gaussians,
        control_points=((nodes - centre) / largest).astype(np.float32),
        world_from_object=world_from_object,
        spacing=lifted.spacing * lifted.scale / largest,
    )


def _slid(points: F64, middle: F64, focal: float, factor: float) -> tuple[F64, F64]:
    """World points (n, 3) after the slide, and its Jacobian (n, 3, 3) there.

    p' = s p with s = k + (1 - k) z_m / z, so dp' / dp = s 1 + p (grad s)^T.
    """
    x, y, z = points.T
    share = factor + (1 - factor) * middle[:, 0] / z
    across, down = middle[:, 1] * focal / z, middle[:, 2] * focal / z  # d z_m / d x, d y
    along = -(across * x + down * y) / z
    slope = np.stack([across, down, along - middle[:, 0] / z], -1) * ((1 - factor) / z)[:, None]
    linear = share[:, None, None] * np.eye(3) + points[:, :, None] * slope[:, None, :]
    return share[:, None] * points, linear


def _nearest(points: F32, means: F32) -> np.ndarray:
    """Index (m,) of the mean (N, 3) nearest to each of the points (m, 3)."""
    from scipy.spatial import KDTree

    return np.asarray(KDTree(means).query(points)[1])


def _in_world(lifted: LiftedObject) -> Gaussians:
    """The Gaussians in the world, at rest; the relief's frame is not turned against it."""
    return replace(
        lifted.gaussians,
        means=lifted.world_points(lifted.gaussians.means).astype(np.float32),
        scales=lifted.gaussians.scales * np.float32(lifted.scale),
    )
