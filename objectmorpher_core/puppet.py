"""A lifted object made ready to be moved: everything derived from the lift, computed once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from .arrays import F64
from .camera import Camera
from .deform.deformer import Deformer
from .deform.splitting import Split, split_stretched
from .document import DeformSettings, EditObject, LiftedObject, PhotoTexture, Placement, Pose, Rig
from .gaussians import Gaussians
from .raster import tiles
from .raster.posed import PosedSplats, RestSplats
from .raster.reference import Picture3D
from .raster.texture import TextureLevels

PICK_NEIGHBOURS = 12  # Gaussians near the picked point of which the best fitting is inverted
PICK_STEPS = 8  # Newton steps of the inverse motion; three are usual
LEAST_ALPHA = 0.1  # of a pixel that can be picked: less is background


@dataclass(frozen=True, eq=False)
class SurfacePoint:
    """A point of an object's surface that is seen at a pixel."""

    rest: F64  # (3,) object frame, where it was in the photo
    world: F64  # (3,) where it is now
    depth: float  # world units, along z


class Puppet:
    """Poses, draws and picks one lifted object. Costly to make, cheap to use."""

    def __init__(
        self,
        lifted: LiftedObject,
        settings: DeformSettings,
        camera: Camera,
        rig: Rig | None = None,
    ) -> None:
        """`camera` is the photo's."""
        self.lifted = lifted
        self.camera = camera
        self._settings = settings
        self._rig = rig
        self._rest = RestSplats(lifted, camera)

    @cached_property
    def deformer(self) -> Deformer:
        """The object's graph and solver; made when the object is first deformed."""
        return Deformer(self.lifted, self._settings, self._rig)

    def posed(self, pose: Pose | None, placement: Placement) -> PosedSplats:
        """The object's Gaussians in the world after `pose`, then `placement`."""
        if pose is None or not self._settings.is_splitting:
            return self._posed_whole(pose, placement)
        whole = self.deformer.skin_gaussians(pose)
        split = split_stretched(self.lifted.gaussians, whole.linear)
        if len(split.parents) == len(whole.points):
            return self._posed_whole(pose, placement)
        lifted = self._lifted_of(split)
        pieces = lifted.gaussians
        skinned = self.deformer.skin_points(pieces.means, pose, pieces.normals)
        matrix = placement.matrix(self.lifted, self.camera)
        return PosedSplats(RestSplats(lifted, self.camera), skinned, matrix)

    def _posed_whole(self, pose: Pose | None, placement: Placement) -> PosedSplats:
        """The Gaussians as they were lifted, none of them split."""
        matrix = placement.matrix(self.lifted, self.camera)
        motion = None if pose is None else self.deformer.gaussians_motion(pose)
        return PosedSplats(self._rest, motion, matrix)

    def _lifted_of(self, split: Split) -> LiftedObject:
        """The object of these pieces at rest; each looks where it is in the photo."""
        lifted, parents = self.lifted, split.parents
        texture = lifted.texture
        pieces = self.camera.project(lifted.world_points(split.gaussians.means))
        whole = self.camera.project(lifted.world_points(lifted.gaussians.means))
        u0 = texture.u0[parents] + (pieces - whole[parents])
        own = PhotoTexture(u0, texture.visibility[parents], texture.solidity[parents])
        return replace(lifted, gaussians=split.gaussians, texture=own)

    def posed_gaussians(self, pose: Pose | None, placement: Placement) -> Gaussians:
        """The object's solid Gaussians after the edit, in the photo camera's frame (y down)."""
        splats = self._posed_whole(pose, placement)
        motion = splats.linear @ self.lifted.world_from_object[:3, :3]
        moved = self.lifted.gaussians.moved(splats.means, motion)
        return moved.select(self.lifted.texture.solidity > 0.5)

    def draw(
        self, pose: Pose | None, placement: Placement, texture: TextureLevels, camera: Camera
    ) -> Picture3D:
        """The object as `camera` (a window of the photo's camera) sees it."""
        return tiles.render(self.posed(pose, placement), texture, camera, self.camera)

    def picture_of(self, point: np.ndarray, pose: Pose | None, placement: Placement) -> F64:
        """Photo px (2,) at which a rest surface point (3,), object frame, is seen."""
        return self.camera.project(self.world_point(point, pose, placement))

    def world_point(self, point: np.ndarray, pose: Pose | None, placement: Placement) -> F64:
        """World position (3,) of a rest surface point (3,), object frame."""
        if pose is not None:
            point = self.deformer.skin_points(point, pose).points[0]
        matrix = placement.matrix(self.lifted, self.camera)
        return matrix[:3, :3] @ self.lifted.world_points(point) + matrix[:3, 3]

    def unplaced(self, world: np.ndarray, placement: Placement) -> F64:
        """Object-frame position (3,) of a world point once the placement is taken back."""
        inverse = np.linalg.inv(placement.matrix(self.lifted, self.camera))
        return self.lifted.object_points(inverse[:3, :3] @ world + inverse[:3, 3])

    def pick(
        self,
        xy: tuple[float, float],
        pose: Pose | None,
        placement: Placement,
        texture: TextureLevels,
    ) -> SurfacePoint | None:
        """The surface point seen at photo px `xy`, on the deformed object; None beside it.

        The pixel is rendered alone; its depth gives the world point. Back in the rest frame, the
        skinning is inverted by Newton's method from the nearest Gaussian's own motion.
        """
        window = self.camera.windowed(xy[0] - 0.5, xy[1] - 0.5, 1, 1)
        splats = self._posed_whole(pose, placement)
        picture = tiles.render(splats, texture, window, self.camera)
        depth = float(picture.depth[0, 0])
        if picture.alpha[0, 0] < LEAST_ALPHA or not np.isfinite(depth):
            return None
        world = self.camera.unproject(np.array(xy), depth)
        if pose is None:
            return SurfacePoint(self.unplaced(world, placement), world, depth)
        rest = self._unskinned(self.unplaced(world, placement), world, splats, pose)
        return SurfacePoint(rest, world, depth)

    def _unskinned(self, target: F64, world: F64, splats: PosedSplats, pose: Pose) -> F64:
        """Rest point (3,) that the pose moves to `target` (3,), both in the object frame."""
        means = self.lifted.gaussians.means.astype(np.float64)
        facing = np.flatnonzero(splats.means[:, 2] > 0)
        _, near = KDTree(splats.means[facing]).query(world, k=min(PICK_NEIGHBOURS, len(facing)))
        best, best_gap = None, np.inf
        for start in facing[np.atleast_1d(near)]:
            point = means[start]
            for _ in range(PICK_STEPS):
                skinned = self.deformer.skin_points(point, pose)
                miss = skinned.points[0] - target
                if np.linalg.norm(miss) < 1e-9:
                    break
                step = np.linalg.lstsq(skinned.linear[0], miss, rcond=1e-6)[0]
                reach = 2.0 * self.lifted.spacing / max(float(np.linalg.norm(step)), 1e-12)
                point = point - step * min(1.0, reach)
            gap = float(np.linalg.norm(self.deformer.skin_points(point, pose).points[0] - target))
            if gap < best_gap:
                best, best_gap = point, gap
            if best_gap < 1e-6:
                break
        assert best is not None
        return best


def puppet_of(item: EditObject, camera: Camera) -> Puppet:
    """The puppet of a lifted object of the document."""
    assert item.lifted is not None, "only a lifted object can be moved"
    return Puppet(item.lifted, item.deform, camera, item.rig)
