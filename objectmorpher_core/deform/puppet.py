"""A lifted object made ready to be moved: everything derived from the lift, computed once."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock

import numpy as np

from ..base.arrays import F64, I32
from ..base.camera import Camera
from ..document.gaussians import Gaussians
from ..document.model import EditObject, LiftedObject, PhotoTexture, Placement, Pose
from ..document.rig import Rig
from ..document.settings import DeformSettings
from ..raster import tiles
from ..raster.picking import pick
from ..raster.posed import PosedSplats, RestSplats
from ..raster.reference import Picture3D
from ..raster.texture import TextureLevels
from ..raster.tiles import Drawable
from .deformer import Deformer
from .resampling import Split, split_stretched, thinned
from .skinning import Skinned

DRAFT = 8_000  # solid Gaussians of a picture that must be quick
PICK_STEPS = 8  # Newton steps of the inverse motion; three are usual
EXACT, CLOSE = 1e-9, 1e-6  # object units by which it may miss: at once, and after all steps


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
        self._lock = Lock()
        self._deformer: Deformer | None = None
        self._similar: Deformer | None = None  # of the same object with another rig

    @property
    def deformer(self) -> Deformer:
        """The object's graph and solver; made when the object is first deformed.

        By one thread: another one that asks meanwhile waits for it.
        """
        with self._lock:
            if self._deformer is None:
                self._deformer, self._similar = self._build_deformer(), None
            return self._deformer

    def _build_deformer(self) -> Deformer:
        if self._similar is not None and self._rig is not None:
            return self._similar.with_rig(self._rig)
        return Deformer(self.lifted, self._settings, self._rig)

    def with_rig(self, rig: Rig) -> Puppet:
        """Return the same object with another rig; whatever does not depend on it is kept."""
        other = copy.copy(self)
        other._rig, other._lock = rig, Lock()
        other._similar, other._deformer = self._deformer or self._similar, None
        return other

    def painted_as(self, lifted: LiftedObject) -> Puppet:
        """Return the same object painted as `lifted`: with its plain colours and visibility."""
        other = copy.copy(self)
        other.lifted, other._rest = lifted, self._rest.changed_to(lifted)
        vars(other).pop("_draft_rest", None)
        other._lock = Lock()
        return other

    def posed(self, pose: Pose | None, placement: Placement) -> PosedSplats:
        """The object's Gaussians in the world after `pose`, then `placement`."""
        if pose is None or not self._settings.is_splitting:
            return self._posed_whole(pose, placement)
        whole = self.deformer.skin_gaussians(pose)
        split = split_stretched(self.lifted.gaussians, whole.linear)
        if len(split.parents) == len(whole.points):
            return self._posed_whole(pose, placement)
        lifted = self._lifted_of(split)
        # Pieces keep their parent's motion: were each skinned by itself, those of a Gaussian
        # stretched beyond the limit of its Jacobian would move apart farther than they reach.
        linear = whole.linear[split.parents]
        offsets = lifted.gaussians.means - self.lifted.gaussians.means[split.parents]
        points = whole.points[split.parents] + (linear @ offsets[:, :, None])[:, :, 0]
        matrix = placement.matrix(self.lifted, self.camera)
        return PosedSplats(RestSplats(lifted, self.camera), Skinned(points, linear), matrix)

    @property
    def has_draft(self) -> bool:
        """Whether `draft` is less work than `posed`."""
        return self._draft_rest is not None

    def draft(self, pose: Pose | None, placement: Placement) -> PosedSplats:
        """Return a draft of about `DRAFT` wider Gaussians, with the object's place and look."""
        assert self._draft_rest is not None, "it has few Gaussians"
        return self._moved(*self._draft_rest, pose, placement)

    @cached_property
    def _draft_rest(self) -> tuple[RestSplats, I32] | None:
        """The wider Gaussians and which ones they are; None where there are few anyway."""
        if (fewer := thinned(self.lifted, DRAFT)) is None:
            return None
        lifted, chosen = fewer
        return RestSplats(lifted, self.camera), chosen

    def _posed_whole(self, pose: Pose | None, placement: Placement) -> PosedSplats:
        """The Gaussians as they were lifted, none of them split."""
        return self._moved(self._rest, None, pose, placement)

    def _moved(
        self, rest: RestSplats, chosen: I32 | None, pose: Pose | None, placement: Placement
    ) -> PosedSplats:
        """`rest` are the `chosen` ones of the object's Gaussians, or all."""
        matrix = placement.matrix(self.lifted, self.camera)
        motion = None if pose is None else self.deformer.gaussians_motion(pose, chosen)
        return PosedSplats(rest, motion, matrix)

    def _lifted_of(self, split: Split) -> LiftedObject:
        """The object of these pieces at rest; each looks where it is in the photo."""
        lifted, parents = self.lifted, split.parents
        texture = lifted.texture
        pieces = lifted.world_points(split.gaussians.means)
        whole = lifted.world_points(lifted.gaussians.means)[parents]
        camera = self._rest.camera
        u0 = texture.u0[parents] + (camera.project(pieces) - camera.project(whole))
        sides = None if lifted.sides is None else lifted.sides.select(parents).moved(pieces - whole)
        own = PhotoTexture(u0, texture.visibility[parents], texture.solidity[parents])
        return replace(lifted, gaussians=split.gaussians, texture=own, sides=sides)

    def posed_gaussians(self, pose: Pose | None, placement: Placement) -> Gaussians:
        """The object's solid Gaussians after the edit, in the photo camera's frame (y down)."""
        splats = self._posed_whole(pose, placement)
        motion = splats.linear @ self.lifted.world_from_object[:3, :3]
        moved = self.lifted.gaussians.moved(splats.means, motion)
        return moved.select(self.lifted.is_body)

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
        """The surface point seen at photo px `xy`, on the deformed object; None beside it."""
        splats = self._posed_whole(pose, placement)
        drawable = tiles.prepare(splats, self.camera, self.camera)
        return self.pick_in(drawable, texture, xy, pose, placement)

    def pick_in(
        self,
        drawable: Drawable,
        texture: TextureLevels,
        xy: tuple[float, float],
        pose: Pose | None,
        placement: Placement,
        reach: float = 0.0,
    ) -> SurfacePoint | None:
        """Pick in a view of the object that is projected already.

        `xy` in px of the view; within `reach` px beside the object its nearest point counts. The
        depth there gives the world point; the motion is inverted by Newton's method from the
        Gaussians that are seen.
        """
        hit = pick(drawable, texture, xy, reach)
        if hit is None:
            return None
        world = drawable.camera.unproject(hit.xy, hit.depth)
        target = self.unplaced(world, placement)
        if pose is None:
            return SurfacePoint(target, world, hit.depth)
        return SurfacePoint(self._unskinned(target, hit.gaussians, pose), world, hit.depth)

    def _unskinned(self, target: F64, seen: I32, pose: Pose) -> F64:
        """Rest point (3,) that the pose moves to `target` (3,), both in the object frame."""
        best, best_gap = target, np.inf
        for start in self.lifted.gaussians.means[seen].astype(np.float64):
            point = start
            for _ in range(PICK_STEPS):
                skinned = self.deformer.skin_points(point, pose)
                miss = skinned.points[0] - target
                gap = float(np.linalg.norm(miss))
                if gap < best_gap:
                    best, best_gap = point, gap
                if gap < EXACT:
                    return point
                step = np.linalg.lstsq(skinned.linear[0], miss, rcond=1e-6)[0]
                reach = 2.0 * self.lifted.spacing / max(float(np.linalg.norm(step)), 1e-12)
                point = point - step * min(1.0, reach)
            if best_gap < CLOSE:
                break
        return best


def puppet_of(item: EditObject, camera: Camera) -> Puppet:
    """The puppet of a lifted object of the document, with its paint."""
    lifted = item.shown
    assert lifted is not None, "only a lifted object can be moved"
    return Puppet(lifted, item.deform, camera, item.rig)
