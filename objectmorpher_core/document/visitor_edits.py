"""Taking an object from one photo into another, as pure functions.

The object keeps all that it is made of, and the camera of the photo that it carries. The world is
the frame of whichever photo's camera looks at it: the object is put in the same direction and as
far away as it was in its own photo, which gives it the size that it would have had here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np

from ..base.arrays import F64, frozen
from ..base.camera import Camera
from .edits import free_name
from .model import Document, EditObject, LiftedObject, Matte, Origin, Placement, Prompt
from .placement import Ground, GroundError, centre_of, down_of, ground_under, with_centre
from .settings import USUAL_SHARES

MOST = 0.6  # of the photo's width and height, that an object takes at most when it comes
KEPT = ("mask", "coverage", "matte", "lifted", "prompt", "found", "mixed", "stays_in_front")
BELOW = 0.2  # of the way from the horizon to the photo's lower edge: what stands is nearer
ROUNDS = 4


def departing(document: Document, k: int, light: tuple[float, float, float] | None) -> EditObject:
    """Object `k` as it can be put into another photo; `light`: linear RGB around it in its own."""
    item, photo = document.objects[k], document.photo
    assert item.lifted is not None, "only what is lifted can be taken away"
    origin = item.lifted.origin or Origin(photo.name, photo.camera, light)
    return replace(
        item, lifted=replace(item.lifted, origin=origin), prompt=Prompt(), coverage=None,
        found=None, mixed=None, shaped=None, keys=(), is_visible=True, is_locked=False, layer=0,
        shape=replace(item.shape, hidden=None, nearness=None, horizon=None),
    )  # fmt: skip


def arrived(
    document: Document, visitor: EditObject, posed: Callable[[Placement], F64]
) -> EditObject:
    """A `departing` object where it goes in another photo, in the light that is there.

    `posed` gives its points (N, 3) world for a placement. It stands on the ground where it stood on
    some in its own photo, and is no larger than `MOST` of this one.
    """
    lifted, camera = visitor.lifted, document.photo.camera
    assert lifted is not None
    name = visitor.name
    if name in (taken := {o.name for o in document.objects}):
        name = free_name(name, taken)
    nowhere = frozen(np.zeros(document.photo.size[::-1], bool))
    visitor = replace(visitor, name=name, mask=nowhere, harmony=USUAL_SHARES["harmony"])
    origin = lifted.origin
    assert origin is not None
    own = centre_of(visitor.placement, lifted, origin.camera)
    placement = with_centre(visitor.placement, own, lifted, camera)
    for _ in range(ROUNDS):  # farther away it is seen from another side
        placement = _fitted(placement, lifted, camera, posed)
    ground = ground_for(document, visitor) if lifted.stands or visitor.is_grounded else None
    if ground is not None:
        placement = _stood(placement, lifted, camera, posed(placement), ground)
    lifted = replace(lifted, origin=replace(origin, home=placement))
    return replace(visitor, lifted=lifted, placement=placement, is_grounded=ground is not None)


def with_visitor(document: Document, visitor: EditObject) -> Document:
    """The document with an `arrived` object, which leaves its background as it is."""
    return replace(document, objects=(*document.objects, visitor), refined=None)


def ground_for(document: Document, item: EditObject) -> Ground | None:
    """The ground that an object stands on; None where it would be above the horizon.

    It lies as the object is seen to stand, else as the horizon says. That of a visitor is the
    ground of what is standing in the photo already, if anything is.
    """
    camera, row = document.photo.camera, document.horizon
    horizon = document.photo.size[1] / 2 if row is None else row
    others = [o for o in document.objects if o.lifted is not None and not o.is_visitor]
    standing = [o for o in others if o.lifted is not None and o.lifted.stands]
    owner = next(iter(standing), item) if item.is_visitor else item
    assert owner.lifted is not None
    points = owner.lifted.world_points(owner.lifted.body.means)
    if (down := down_of(owner, document)) is not None:
        height = float((points @ down).max())
        return Ground(down, height) if height > 0 and down[1] > 0 else None
    try:
        return ground_under(points, camera, horizon)
    except GroundError:
        return None


def changes_visitor(before: Document, after: Document) -> EditObject | None:
    """The visitor of `before` whose outline or shape is another one in `after`, if there is one.

    Both are of a photo that is not there to look at. Paint is of neither.
    """
    if len(before.objects) != len(after.objects):
        return None
    for one, other in zip(before.objects, after.objects, strict=True):
        if one.is_visitor and (
            any(getattr(one, n) is not getattr(other, n) for n in KEPT if n != "matte")
            or not _differs_in_paint_alone(one.matte, other.matte)
        ):
            return one
    return None


def _differs_in_paint_alone(one: Matte | None, other: Matte | None) -> bool:
    """Whether two mattes are the same but for what is painted on them."""
    if one is None or other is None:
        return one is other
    names = (f.name for f in fields(one) if f.name != "paint")
    return all(getattr(one, name) is getattr(other, name) for name in names)


def _fitted(
    placement: Placement, lifted: LiftedObject, camera: Camera, posed: Callable[[Placement], F64]
) -> Placement:
    """`placement`, farther away where it is too large, and moved into the picture."""
    centre, points = centre_of(placement, lifted, camera), posed(placement)
    size = np.array([camera.width, camera.height])
    seen = camera.project(points[points[:, 2] > 0])
    low, high = seen.min(0), seen.max(0)
    times = float(((high - low) / (MOST * size)).max())
    if times > 1.0:
        return with_centre(placement, centre * times, lifted, camera)
    step = np.clip(0.0, -low, size - high)
    if not step.any():
        return placement
    at = camera.project(centre) + step
    return with_centre(placement, camera.unproject(at, centre[2]), lifted, camera)


def _stood(
    placement: Placement, lifted: LiftedObject, camera: Camera, points: F64, ground: Ground
) -> Placement:
    """`placement`, as much larger and farther away, which looks the same, as it takes to stand.

    What would be above the ground that is seen goes down to it.
    """
    foot = ground.lowest(points)
    at = np.asarray(camera.project(foot), np.float64)
    horizon = camera.cy - camera.focal * ground.normal[2] / ground.normal[1]
    at[1] = max(at[1], horizon + BELOW * (camera.height - horizon))
    there = ground.seen_at(camera, at)
    times = float(there[2] / foot[2])
    centre = there + times * (centre_of(placement, lifted, camera) - foot)
    return with_centre(replace(placement, scale=placement.scale * times), centre, lifted, camera)
