"""All of a lifted object that does not depend on its pose, and how it is made ready beforehand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.document import Document, EditObject, Handle, Photo

if TYPE_CHECKING:
    from objectmorpher_core.puppet import Puppet
    from objectmorpher_core.raster.texture import TextureLevels

SMALL = (0, 0, 32, 32)  # px, of the picture that is drawn for practice


@dataclass(eq=False)
class Shape:
    """What poses, draws and picks the object, and the photo that it carries."""

    puppet: Puppet
    texture: TextureLevels
    is_rehearsed: bool = False  # or is being so: nobody else has to


def build_shape(photo: Photo, thing: EditObject) -> Shape:
    """A fraction of a second; what only a drag needs is made later."""
    from objectmorpher_core.compose.composite import object_texture
    from objectmorpher_core.puppet import puppet_of

    assert thing.matte is not None
    return Shape(puppet_of(thing, photo.camera), object_texture(thing.matte))


def build_ready(document: Document) -> dict[int, Shape]:
    """The shapes of all lifted objects, rehearsed; those of copies are one."""
    shapes: dict[int, Shape] = {}
    for k, thing in enumerate(document.objects):
        if thing.lifted is None:
            continue
        shape = build_shape(document.photo, thing)
        shape.is_rehearsed = True
        rehearse(document.photo, thing, shape)
        shapes[k] = shape
    return shapes


def rehearse(photo: Photo, thing: EditObject, shape: Shape) -> None:
    """Does once what a drag's first frame does; all that is slow about it is kept.

    In a thread: it changes nothing that somebody else looks at.
    """
    from objectmorpher_core.raster import tiles
    from objectmorpher_core.raster.sharpening import sharpen

    from .moved_cells import mark_moved

    puppet, camera = shape.puppet, photo.camera
    deformer = puppet.deformer
    trial = deformer.with_rig(deformer.rig)  # with a solver of its own
    point = deformer.points[0]
    pose = trial.solve((Handle(0, point, point),), start=trial.rest(), seconds=0.0).pose
    splats = (puppet.draft if puppet.has_draft else puppet.posed)(pose, thing.placement)
    whole = puppet.posed(pose, thing.placement)
    drawables = [tiles.prepare(each, camera, camera) for each in (whole, splats)]
    picture = tiles.draw(drawables[-1], shape.texture, SMALL)
    tiles.draw_rgba(drawables[0], shape.texture, SMALL)
    sharpen(picture, shape.texture, 1, SMALL, (0.0, 0.0), 1.0)
    free = np.ones((1, 1), np.uint8)
    texture, world = splats.rest.lifted.texture, splats.means
    mark_moved(free, texture.u0, world, (1.0, 0.0, 0.0), (0.0, 0.0), 1.0, 1.0, True)
    middle = np.array(camera.project(puppet.world_point(point, pose, thing.placement)))
    puppet.pick_in(drawables[0], shape.texture, (middle[0], middle[1]), pose, thing.placement)
