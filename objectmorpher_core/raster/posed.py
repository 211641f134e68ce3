"""Gaussians where the edit has put them: what every renderer reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numba
import numpy as np

from ..arrays import F32, F64, frozen
from ..camera import Camera
from ..deform.skinning import Skinned
from ..document import LiftedObject
from ..threads import in_threads

SURFACE_GAP = 2.5  # x spacing: samples farther apart in depth are different surfaces
TEXTURE_GAP = 3.0  # x spacing in the photo: likewise for what they show of it


@dataclass(frozen=True, eq=False)
class PosedSplats:
    """World-space Gaussians of one object, with what each carries of the photo."""

    means: F64  # (N, 3) world
    linear: F64  # (N, 3, 3) F, motion of the surroundings of each mean, world from rest world
    rest_covariances: F64  # (N, 3, 3) Sigma, world, at rest
    rest_pictures: F64  # (N, 2, 3) J0 Sigma: covariance of the rest picture with the rest world
    normals: F64  # (N, 3) outward at rest, world, unit
    rest_cosines: F64  # (N,) of the normal with the direction to the camera, at rest
    u0: F32  # (N, 2) px in the photo
    visibility: F32  # (N,) 1 = seen in the photo
    solidity: F32  # (N,)
    colors: F32  # (N, 3)
    opacities: F32  # (N,)
    gap: float  # world units, see SURFACE_GAP
    texture_gap: float  # px of the photo, see TEXTURE_GAP
    rest_zoom: F64  # (N,) focal / depth at rest, px per world unit

    def __len__(self) -> int:
        return len(self.means)


class SplatPoser:
    """Poses one lifted object. The constructor does what depends on the rest shape only."""

    def __init__(self, lifted: LiftedObject, camera: Camera) -> None:
        """`camera` is the photo's."""
        gaussians = lifted.gaussians
        self._rotation_scale = lifted.world_from_object[:3, :3]
        self._translation = lifted.world_from_object[:3, 3]
        linear = self._rotation_scale
        self._covariances = frozen(linear @ gaussians.covariances() @ linear.T)
        means = lifted.world_points(gaussians.means.astype(np.float64))
        jacobians = projection_jacobians(means, camera.focal)
        self._pictures = frozen(jacobians @ self._covariances)
        normals = gaussians.normals.astype(np.float64) @ linear.T
        self._normals = frozen(normals / np.linalg.norm(normals, axis=1, keepdims=True))
        self._cosines = frozen(-(self._normals * means).sum(1) / np.linalg.norm(means, axis=1))
        self._zoom = frozen(camera.focal / means[:, 2])
        self._lifted = lifted
        self._identity = frozen(np.broadcast_to(np.eye(3), (len(means), 3, 3)))
        self._spacing = lifted.spacing * lifted.scale  # world units
        self._spacing_px = self._spacing * float(np.median(self._zoom))

    def rest(self, placement: np.ndarray) -> PosedSplats:
        """The undeformed object after the world motion `placement` (4, 4)."""
        means = self._lifted.gaussians.means.astype(np.float64)
        return self.pose(Skinned(means, self._identity), placement)

    def pose(self, skinned: Skinned, placement: np.ndarray) -> PosedSplats:
        """`skinned` in the object frame, then the world motion `placement` (4, 4)."""
        world = self._rotation_scale
        motion = placement[:3, :3]
        texture, gaussians = self._lifted.texture, self._lifted.gaussians
        scale = float(np.cbrt(np.linalg.det(motion)))
        before, offset = motion @ world, motion @ self._translation + placement[:3, 3]
        means, linears = np.empty(skinned.points.shape), np.empty(skinned.linear.shape)
        inputs: tuple[Any, ...] = (
            frozen(skinned.points), frozen(skinned.linear), frozen(before), frozen(offset),
            frozen(np.linalg.inv(world)), means, linears,
        )  # fmt: skip
        in_threads(lambda first, last: _move(first, last, *inputs), len(means))
        return PosedSplats(
            means=means,
            linear=linears,
            rest_covariances=self._covariances,
            rest_pictures=self._pictures,
            normals=self._normals,
            rest_cosines=self._cosines,
            u0=texture.u0,
            visibility=texture.visibility,
            solidity=texture.solidity,
            colors=gaussians.colors,
            opacities=gaussians.opacities,
            gap=SURFACE_GAP * self._spacing * scale,
            texture_gap=TEXTURE_GAP * self._spacing_px,
            rest_zoom=self._zoom,
        )


@numba.njit(cache=True, nogil=True)
def _move(first, last, points, linear, before, offset, after, means_out, linear_out):
    """Rows first..last: means = before x + offset, linear = before F after."""
    half = np.empty((3, 3))
    for i in range(first, last):
        for a in range(3):
            mean = offset[a]
            for b in range(3):
                mean += before[a, b] * points[i, b]
                half[a, b] = (
                    before[a, 0] * linear[i, 0, b]
                    + before[a, 1] * linear[i, 1, b]
                    + before[a, 2] * linear[i, 2, b]
                )
            means_out[i, a] = mean
        for a in range(3):
            for b in range(3):
                linear_out[i, a, b] = (
                    half[a, 0] * after[0, b] + half[a, 1] * after[1, b] + half[a, 2] * after[2, b]
                )


def projection_jacobians(points: np.ndarray, focal: float) -> F64:
    """d image px / d world (N, 2, 3) at world points (N, 3): the J of EWA splatting."""
    x, y, z = points.T
    jacobians = np.zeros((len(points), 2, 3))
    jacobians[:, 0, 0] = jacobians[:, 1, 1] = focal / z
    jacobians[:, 0, 2] = -focal * x / z**2
    jacobians[:, 1, 2] = -focal * y / z**2
    return jacobians


@dataclass(frozen=True, eq=False)
class TextureLevels:
    """The object's straight colours and alpha, with halved copies for minification."""

    levels: tuple[F32, ...]  # each (h, w, 4), level l halved l times
    left: float  # px in the photo, corner of the crop
    top: float


def build_levels(foreground: F32, alpha: F32, left: float, top: float) -> TextureLevels:
    """Texture from straight `foreground` (h, w, 3) in [0, 1] and `alpha` (h, w).

    `left`, `top`: px in the photo of the crop's corner, which may lie outside it.
    """
    level = np.dstack([foreground, alpha]).astype(np.float32)
    levels = [level]
    while min(level.shape[:2]) >= 4 and len(levels) < 8:
        height, width = level.shape[:2]
        padded = cv2.copyMakeBorder(level, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
        size = (padded.shape[1] // 2, padded.shape[0] // 2)
        level = cv2.resize(padded, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        levels.append(level)
    return TextureLevels(tuple(frozen(v) for v in levels), left, top)
