"""The ellipsoid lifted without error: Gaussians on the true surface, as the relief lays them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import solid

from objectmorpher_core.base.arrays import F32, F64, frozen
from objectmorpher_core.base.poisson_disk import thin_to_spacing
from objectmorpher_core.base.rotations import quats_along
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import LiftedObject, PhotoTexture, Placement
from objectmorpher_core.lift.relief import lifter as relief
from objectmorpher_core.lift.relief.spreading import PACKING
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.texture import TextureLevels, build_levels

RAYS = 5  # by as many in a pixel
REST = np.eye(4)
CANDIDATES = 12  # for a Gaussian, before they are thinned
COLOUR_BLUR = 1.2  # x mean spacing: plain colours, so that neighbours agree


@dataclass(frozen=True, eq=False)
class ExactLift:
    """A lifted object with the photo that it carries."""

    lifted: LiftedObject
    texture: TextureLevels

    def splats(self, motion: F64 = REST) -> PosedSplats:
        """After the `motion` (4, 4, world), a similarity."""
        return PosedSplats(RestSplats(self.lifted, solid.CAMERA), None, motion)


@cache
def photo() -> solid.Cast:
    return solid.cast(solid.CAMERA, REST, RAYS)


@cache
def lift(count: int) -> ExactLift:
    """About `count` Gaussians all around, half of which the photo shows."""
    rng = np.random.default_rng(0)
    points, normals, spacing = _spread(count, rng)
    centre, largest = solid.CENTRE, 2 * float(solid.AXES.max())
    world_from_object = np.diag([largest, largest, largest, 1.0])
    world_from_object[:3, 3] = centre
    sizes = np.array([relief.TANGENT_SIGMA, relief.TANGENT_SIGMA, relief.NORMAL_SIGMA])
    arrays = (
        (points - centre) / largest, quats_along(normals),
        np.tile(sizes * spacing / largest, (len(points), 1)), np.ones(len(points)),
        _colors(points, normals, spacing),
    )  # fmt: skip
    gaussians = Gaussians(*(frozen(array, np.float32) for array in arrays))
    seen = (normals * points).sum(1) < 0
    carried = PhotoTexture(
        frozen(solid.CAMERA.project(points), np.float32), frozen(seen, np.float32),
        np.ones(len(points), np.float32),
    )  # fmt: skip
    lifted = LiftedObject(
        gaussians, carried, gaussians.means[:512], world_from_object, spacing / largest, "exact"
    )
    return ExactLift(lifted, _texture())


def placed(placement: Placement) -> F64:
    """The motion (4, 4) of a placement; every lift's centre is about the ellipsoid's."""
    motion = placement.matrix(lift(20_000).lifted, solid.CAMERA)
    return motion


def _spread(count: int, rng: np.random.Generator) -> tuple[F64, F64, float]:
    """Even points (N, 3), their normals, and the mean spacing, world units."""
    way = rng.normal(size=(3 * CANDIDATES * count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    # a patch of the sphere grows by prod(axes) |n / axes|
    growth = np.linalg.norm(way / solid.AXES, axis=1)
    points = way[rng.random(len(way)) < growth / growth.max()] * solid.AXES + solid.CENTRE
    area = 4 * np.pi * solid.AXES.prod() * growth.mean()
    spacing = float(np.sqrt(area / count))
    order = rng.permutation(len(points))
    points = points[thin_to_spacing(points, spacing * np.sqrt(PACKING), order)]
    return points, solid.normals(points), spacing


def _colors(points: F64, normals: F64, spacing: float) -> F64:
    """(N, 3): the texture, averaged as the relief averages the photo; the back has it, too."""
    blur, around = COLOUR_BLUR * spacing, 24
    rng = np.random.default_rng(0)
    total = np.zeros((len(points), 3))
    for _ in range(around):
        step = rng.normal(0, blur, points.shape)
        near = points + step - (step * normals).sum(1, keepdims=True) * normals
        total += solid.texture(near)
    return total / around


def _texture() -> TextureLevels:
    """The photo's own colours, continued beyond the edge, and its matte."""
    shown = photo()
    _, labels = cv2.distanceTransformWithLabels(
        (shown.alpha == 0).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    inside = shown.alpha > 0
    nearest = np.zeros((labels.max() + 1, 3))
    nearest[labels[inside]] = shown.color[inside]
    colors: F32 = np.where(inside[..., None], shown.color, nearest[labels]).astype(np.float32)
    return build_levels(colors, shown.alpha.astype(np.float32), 0, 0)
