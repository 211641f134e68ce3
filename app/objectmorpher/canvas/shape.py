"""Everything about a lifted object that does not depend on its pose, and its preparation."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import (
    Document,
    EditObject,
    Handle,
    LiftedObject,
    Matte,
    Placement,
)
from objectmorpher_core.document.rig import Rig

from .memo import Memo

if TYPE_CHECKING:
    from scipy.spatial import KDTree

    from objectmorpher_core.compose.paint import PaintedShare
    from objectmorpher_core.deform.puppet import Puppet
    from objectmorpher_core.raster.texture import TextureLevels

log = logging.getLogger(__name__)

SMALL = (0, 0, 32, 32)  # px, of the picture that is drawn for practice
AROUND = 64  # px of the texture, to each side of the point that is dragged for practice
REACH = 0.01  # object units that a point is moved for practice


@dataclass(frozen=True, eq=False)
class RestSurface:
    """The solid Gaussians of an object at rest, object frame."""

    tree: KDTree  # of their means
    normals: F64  # (N, 3)
    control_normals: F64  # (M, 3) at the control points


@dataclass(eq=False)
class CanvasShape:
    """An object that can be posed, drawn and picked, with the photo that it carries."""

    puppet: Puppet
    texture: TextureLevels
    rig: Rig  # of the puppet
    matte: Matte  # of the texture
    is_rehearsed: bool = False  # or is being so: nobody else has to

    @cached_property
    def surface(self) -> RestSurface:
        return build_surface(self.puppet.lifted)

    @cached_property
    def paint(self) -> PaintedShare | None:
        """Where the artist has painted the object."""
        from objectmorpher_core.compose.paint import PaintedShare

        return PaintedShare.of(self.matte, self.puppet.lifted)

    def changed_to(self, thing: EditObject) -> CanvasShape:
        """Return the same object with another rig or matte; what does not depend on it is kept."""
        from objectmorpher_core.compose.light.lighting import object_texture

        puppet, texture, matte = self.puppet, self.texture, self.matte
        if thing.rig is not self.rig:
            puppet = puppet.with_rig(thing.rig)
        if thing.matte is not None and thing.matte is not matte:
            if thing.shown is not None and thing.matte.paint is not matte.paint:
                puppet = puppet.painted_as(thing.shown)
            texture, matte = object_texture(thing.matte, thing.lifted), thing.matte
        is_ready = self.is_rehearsed and puppet is self.puppet
        other = CanvasShape(puppet, texture, thing.rig, matte, is_ready)
        if "surface" in vars(self):
            other.surface = self.surface
        return other


def build_surface(lifted: LiftedObject) -> RestSurface:
    from scipy.spatial import KDTree

    body = lifted.body
    tree, normals = KDTree(body.means), body.normals.astype(np.float64)
    return RestSurface(tree, normals, normals[tree.query(lifted.control_points)[1]])


Shapes: TypeAlias = Sequence[tuple[EditObject, CanvasShape]]


def build_shape(camera: Camera, thing: EditObject) -> CanvasShape:
    """A fraction of a second; what only a drag needs is made later. `camera` is the photo's."""
    from objectmorpher_core.compose.light.lighting import object_texture
    from objectmorpher_core.deform.puppet import puppet_of

    assert thing.matte is not None
    texture = object_texture(thing.matte, thing.lifted)
    return CanvasShape(puppet_of(thing, camera), texture, thing.rig, thing.matte)


def build_ready_shape(camera: Camera, thing: EditObject) -> CanvasShape:
    """Build a shape and rehearse it; this takes some seconds and belongs in a thread."""
    shape = build_shape(camera, thing)
    shape.is_rehearsed = True
    try:
        rehearse(shape, camera, thing.placement)
    except Exception:  # it is shown all the same; dragging it shows the message
        log.exception("%s could not be made ready to be dragged", thing.name)
    return shape


def rehearse_lift(matte: Matte, lifted: LiftedObject, camera: Camera) -> None:
    """Compile the kernels of a drag onto the disk, for the process that will drag the fresh lift.

    Without the object's texture, which may take gigabytes: a little of it does.
    """
    x, y = camera.project(lifted.world_points(lifted.control_points[0])).astype(int)
    height, width = matte.alpha.shape
    left, top = (
        int(np.clip(at - AROUND, 0, max(size - 2 * AROUND, 0)))
        for at, size in ((x - matte.left, width), (y - matte.top, height))
    )
    part = slice(top, top + 2 * AROUND), slice(left, left + 2 * AROUND)
    small = Matte(matte.left + left, matte.top + top, matte.alpha[part], matte.foreground[part])
    if (sides := lifted.sides) is not None:  # all between both would be in the texture
        lifted = replace(lifted, sides=sides.placed(small.left, small.box[3] + AROUND))
    rehearse(build_shape(camera, EditObject("", matte=small, lifted=lifted)), camera)


def build_ready(document: Document) -> Shapes:
    """The shapes of all lifted objects, rehearsed; copies share one."""
    camera, built = document.photo.camera, Memo(len(document.objects))

    def shape(thing: EditObject) -> CanvasShape:
        parts = thing.lifted, thing.matte, thing.deform, thing.rig
        return built(lambda: build_ready_shape(camera, thing), *parts)

    return [(thing, shape(thing)) for thing in document.objects if thing.lifted is not None]


def rehearse(shape: CanvasShape, camera: Camera, placement: Placement | None = None) -> None:
    """Does once what a drag does; all that is slow the first time is kept, or compiled.

    In a thread or in another process: it changes nothing that somebody else looks at. The
    object is where `placement` puts it, in the photo of `camera`.
    """
    from objectmorpher_core.raster import tiles
    from objectmorpher_core.raster.sharpening import sharpen

    from .moved_cells import mark_moved

    puppet, texture, placement = shape.puppet, shape.texture, placement or Placement()
    deformer = puppet.deformer
    trial = deformer.with_rig(deformer.rig)  # with a solver of its own
    point = deformer.points[0]
    handles = (Handle(0, point, point + REACH),)
    pose = trial.solve(handles, start=trial.solve(handles, seconds=0.0).pose, seconds=0.0).pose
    splats = (puppet.draft if puppet.has_draft else puppet.posed)(pose, placement)
    seen = tiles.prepare(puppet.posed(pose, placement), camera, camera)
    picture = tiles.draw(tiles.prepare(splats, camera, camera), texture, SMALL)
    tiles.draw_rgba(seen, texture, SMALL)
    sharpen(picture, texture, 1, SMALL, (0.0, 0.0), 1.0)
    free = np.ones((1, 1), np.uint8)
    on_photo = splats.rest.lifted.texture.u0
    mark_moved(free, on_photo, splats.means, (1.0, 0.0, 0.0), (0.0, 0.0), 1.0, 1.0, True)
    x, y = puppet.picture_of(point, pose, placement)
    puppet.pick_in(seen, texture, (x, y), pose, placement)
    puppet.pick((x, y), None, placement, texture)
    shape.surface.tree.query(point)
