"""Facts about a lifted object's surface at its control points and handles; remembered."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.document.model import Document

from .derived import Derived
from .memo import Memo
from .shape import RestSurface

if TYPE_CHECKING:
    from objectmorpher_core.deform.symmetry import MirrorPlane

AROUND = 12  # Gaussians whose normals make a handle's


class SurfaceFacts:
    """Facts about a surface, each computed when it is first asked for."""

    def __init__(self, derived: Derived) -> None:
        self._derived = derived
        self._seen, self._influences, self._mirrors = Memo(), Memo(), Memo()

    def surface(self, document: Document, k: int) -> RestSurface:
        return self._derived.shape(document.photo, document.objects[k]).surface

    def turn_of(self, document: Document, k: int) -> F64:
        """(3, 3) the rotation that takes directions of the object frame into the world."""
        thing = document.objects[k]
        assert thing.lifted is not None
        matrix = thing.placement.matrix(thing.lifted, document.photo.camera)
        linear = matrix[:3, :3] @ thing.lifted.world_from_object[:3, :3]
        return linear / np.cbrt(np.linalg.det(linear))

    def normal_at(self, document: Document, k: int, point: np.ndarray) -> F64:
        """(3,) world, unit: outward at a rest surface point (3,), as it is posed and placed."""
        thing = document.objects[k]
        assert thing.lifted is not None
        surface = self.surface(document, k)
        near = surface.tree.query(point, min(AROUND, len(surface.normals)))[1]
        normal = surface.normals[np.atleast_1d(near)].sum(0)
        if thing.pose is not None:
            deformer = self._derived.shape(document.photo, thing).puppet.deformer
            motion = deformer.skin_points(np.asarray(point), thing.pose).linear[0]
            normal = np.linalg.solve(motion.T, normal)
        normal = self.turn_of(document, k) @ normal
        return normal / np.linalg.norm(normal)

    def seen(self, document: Document, k: int) -> Mask:
        """(M,) which control points are on the side that is seen."""
        return self._seen(lambda: self._find_seen(document, k), self._derived.posed(document, k))

    def _find_seen(self, document: Document, k: int) -> Mask:
        from objectmorpher_core.raster.picking import seen_points

        thing = document.objects[k]
        assert thing.lifted is not None
        normals = self.surface(document, k).control_normals
        if thing.pose is not None:
            normals = (thing.pose.rotations @ normals[..., None])[..., 0]
        points = self._derived.control_places(document, k)
        normals = normals @ self.turn_of(document, k).T
        texture = self._derived.shape(document.photo, thing).texture
        splats = self._derived.posed(document, k)
        return seen_points(splats, texture, document.photo.camera, points, normals)

    def spacing(self, document: Document, k: int) -> float:
        """Image px between neighbouring control points, where the object is."""
        thing = document.objects[k]
        assert thing.lifted is not None
        deformer = self._derived.shape(document.photo, thing).puppet.deformer
        depth = float(np.median(self._derived.control_places(document, k)[:, 2]))
        scale = thing.lifted.scale * thing.placement.scale
        return deformer.graph.mean_spacing * scale * document.photo.camera.focal / depth

    def influence(self, document: Document, k: int, h: int) -> F64:
        """(M,) how much each control point goes along with handle `h`, 1 = as far as it does."""
        thing = document.objects[k]
        deformer = self._derived.shape(document.photo, thing).puppet.deformer
        handle = thing.handles[h]
        return self._influences(
            lambda: deformer.influence(thing.handles, h, thing.footing, thing.pose),
            deformer, handle, thing.handles, thing.pose, thing.footing.anchors,
        )  # fmt: skip

    def mirror(self, document: Document, k: int) -> MirrorPlane:
        """The object's mirror plane at rest, object frame; else an upright one through it."""
        thing = document.objects[k]
        assert thing.lifted is not None
        return self._mirrors(lambda: _find_mirror(document, k), thing.lifted)


def _find_mirror(document: Document, k: int) -> MirrorPlane:
    from objectmorpher_core.deform.symmetry import find_mirror, plane_through

    lifted = document.objects[k].lifted
    assert lifted is not None
    sight = lifted.world_from_object[:3, :3].T @ lifted.centre
    across = lifted.world_from_object[:3, :3].T @ np.array([1.0, 0.0, 0.0])
    found = find_mirror(lifted.body.means, sight, across)
    if found is not None:
        return found
    return plane_through(lifted.object_points(lifted.centre), across)
