"""An object's thickness by the medial structure of its silhouette: limbs are round.

Every largest disc that fits into the silhouette is a cross-section of a ball (the medial axis
transform, Blum 1967): the union of those balls is round wherever the silhouette is a limb. A disc
that is large for the object is flattened, so that a body does not become a balloon. What is
found is the half-thickness squared, which is smooth where the thickness itself is not: at the rim.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from ...base.arrays import F32, F64
from ...base.camera import Camera
from ...base.kernel_files import numba
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject
from .. import LiftError
from .canvas import bilinear
from .cuts import Cuts
from .silhouette import ReliefSilhouette, is_covered

# Another thickness for an object that is lifted already: at once, while a slider is dragged.
#
# Every Gaussian slides along its own ray of the photo, its distance from the middle sheet times a
# factor: z' = z_m + k (z - z_m). So the photo at rest stays what it was, and the same Gaussians
# carry the same pieces of it.


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


FULL_BODY = 0.6  # x extent: radius of the disc that becomes a ball 0.7 times as deep as wide
RIM_SLOPE = 5.0  # tangent of the angle, before FULLNESS, at which the surface leaves the rim
FULLNESS = 1.2  # makes up for the thickness that the slope takes away
SMOOTH = 1.5  # cells
MARGIN = 8  # cells around the grid, so that its end is not seen in what is smoothed


@dataclass(frozen=True, eq=False)
class Thickness:
    """Half-thickness t = FULLNESS (sqrt(q + c^2) - c) px over a silhouette's grid.

    At a rim with slope |grad q| the surface leaves at the slope |grad q| / 2c: never at a right
    angle, where the photo sees it edge-on and has no pixels to show when it turns.
    """

    square: F64  # (h, w) q px^2; below 0 outside, so that 0 is on the outline
    crease: F64  # (h, w) c px
    cuts: Cuts | None = None  # between cells that are not of one surface

    @staticmethod
    def of(silhouette: ReliefSilhouette) -> Thickness:
        cell = silhouette.cell
        depth = silhouette.continued(silhouette.depth, MARGIN) / cell  # cells
        radius = silhouette.continued(silhouette.radius, MARGIN) / cell
        inside = depth > 0
        largest = FULL_BODY * silhouette.extent / cell
        flatness = 1 / (1 + (radius / largest) ** 2)  # squared ratio of depth to width
        square = _balls(depth, flatness)
        outside = _mirrored(np.where(inside, square, 0.0), inside)
        square = np.where(inside, np.maximum(square, 1e-6), outside)
        square = cv2.GaussianBlur(square, (0, 0), SMOOTH)
        weight = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), 3 * SMOOTH)
        slope = cv2.GaussianBlur(flatness * radius * inside, (0, 0), 3 * SMOOTH)
        crease = np.maximum(slope / np.maximum(weight, 1e-6), 0.25) / RIM_SLOPE
        own = slice(MARGIN, -MARGIN)
        return Thickness(
            np.asarray(square[own, own] * cell**2, np.float64), crease[own, own] * cell
        )

    @staticmethod
    def balls(silhouette: ReliefSilhouette) -> F64:
        """(h, w) px^2, height squared of the union of the balls of all discs that fit into it."""
        depth = silhouette.continued(silhouette.depth, MARGIN) / silhouette.cell
        square = _balls(depth, np.ones(depth.shape)) * silhouette.cell**2
        return np.asarray(square[MARGIN:-MARGIN, MARGIN:-MARGIN], np.float64)

    def times(self, factor: F64) -> Thickness:
        """Thicker by `factor` (h, w)."""
        return Thickness(self.square * factor**2, self.crease * factor, self.cuts)

    def mean_with(self, grid_xy: F64) -> Thickness:
        """The mean with its own image, of which `grid_xy` (h, w, 2) are the places."""
        at = grid_xy.reshape(-1, 2)
        h, w = self.square.shape
        is_in = (at >= 0).all(1) & (at <= [w - 1, h - 1]).all(1)
        image = bilinear(self.square, at).reshape(h, w)
        both = is_in.reshape(h, w) & (image > 0) & (self.square > 0)
        return Thickness(
            np.where(both, 0.5 * (image + self.square), self.square), self.crease, self.cuts
        )

    def mixed(self, half: F64, share: F64) -> Thickness:
        """Return a thickness of `half` (h, w) px up to the outline, where `share` (h, w) is 1."""
        square = self.square + share * ((half / FULLNESS) ** 2 - self.square)
        return Thickness(square, self.crease * (1 - share), self.cuts)

    def towards(self, half: F64, share: F64) -> Thickness:
        """Return a thickness of `half` (h, w) px where `share` (h, w) is 1, as steep at a rim."""
        wanted = (half / FULLNESS + self.crease) ** 2 - self.crease**2
        return Thickness(self.square + share * (wanted - self.square), self.crease, self.cuts)

    def sample(self, grid_xy: F64, cell: float) -> tuple[F64, F64]:
        """Half-thickness (N,) px and its gradient (N, 2) at grid coordinates (N, 2)."""
        q, c, qx, qy, cx, cy = bilinear(self._fields, grid_xy).T
        root = _root(q, c)
        slope = [(0.5 * dq + c * dc) / root - dc for dq, dc in ((qx, cx), (qy, cy))]
        return FULLNESS * np.maximum(root - c, 0.0), (FULLNESS / cell) * np.stack(slope, -1)

    def half(self, grid_xy: F64) -> F64:
        """Half-thickness (N,) px alone."""
        q, c = bilinear(self._fields[..., :2], grid_xy).T
        return FULLNESS * np.maximum(_root(q, c) - c, 0.0)

    @cached_property
    def _fields(self) -> F64:
        """(h, w, 6) q, c and what both grow by from cell to cell, across and down."""
        gradient = np.gradient if self.cuts is None else self.cuts.gradient
        (qdy, qdx), (cdy, cdx) = (gradient(f) for f in (self.square, self.crease))
        return np.stack([self.square, self.crease, qdx, qdy, cdx, cdy], -1)


def _root(square: F64, crease: F64) -> F64:
    return np.sqrt(np.maximum(square, 0) + np.maximum(crease, 1e-3) ** 2)


def _mirrored(field: F64, inside: np.ndarray) -> F64:
    """What `field` (h, w), 0 outside, is outside when it falls on through 0 at the outline."""
    reach = 2 * int(np.ceil(2 * SMOOTH)) + 1
    near = cv2.blur(inside.astype(np.float64), (reach, reach))
    mean = cv2.blur(field, (reach, reach)) / np.maximum(near, 1e-9)
    return np.where(near > 1e-6, -mean * (1 - near), 0.0)


@numba.njit(cache=True)
def _balls(depth, flatness):
    """(h, w) cells^2: height squared of the union of all discs' balls, each flattened."""
    height, width = depth.shape
    top = np.zeros((height, width))
    for i in range(height):
        for j in range(width):
            r = depth[i, j]
            if r <= 0 or is_covered(depth, i, j):
                continue
            reach = int(r)
            for a in range(max(i - reach, 0), min(i + reach + 1, height)):
                for b in range(max(j - reach, 0), min(j + reach + 1, width)):
                    value = flatness[i, j] * (r * r - (a - i) ** 2 - (b - j) ** 2)
                    if value > top[a, b]:
                        top[a, b] = value
    return top
