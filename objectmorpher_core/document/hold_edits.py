"""Changes of what holds an object, and locks it, as pure functions Document -> Document.

A handle that is added, softened, pinned or removed changes what the object wants, and so its pose,
if nothing else is said. Here it is said that the pose stays as it is: it becomes the base from
which the handles move the object from now on (`pose.Base`).
"""

from __future__ import annotations

from dataclasses import fields, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import I32
from .model import Document, EditObject

if TYPE_CHECKING:
    from ..deform.deformer import Deformer

RELEASED = 0.2  # x diameter along the surface: anchors so near to a new handle let go
AROUND = 0.25  # likewise: where nothing else is to move, as much as this goes with a handle


class Stays(Enum):
    """The part of an object that stays in place by itself while a handle is dragged."""

    FAR = "the far side"
    ELSE = "everything else"
    NOTHING = "nothing"


def stays_of(item: EditObject) -> Stays:
    """Return the part of an object that stays by itself."""
    if item.is_held_around:
        return Stays.ELSE
    return Stays.FAR if item.has_auto_anchors else Stays.NOTHING


def keeps_pose(item: EditObject) -> bool:
    """Whether its pose stays as it is where its handles, or what is frozen, do not give it."""
    return item.base.pose is not None or (not item.handles and item.rig.shifts is None)


def set_stays(document: Document, k: int, deformer: Deformer, stays: Stays) -> Document:
    """Object `k` as it is; from now on this of it stays by itself."""
    item = document.objects[k]
    changed = replace(
        item, has_auto_anchors=stays is not Stays.NOTHING, is_held_around=stays is Stays.ELSE
    )
    everything = tuple(range(len(item.handles)))
    return hold(document.with_object(k, changed), k, deformer, everything)


def hold(document: Document, k: int, deformer: Deformer, added: tuple[int, ...] = ()) -> Document:
    """Object `k` held as it is by the handles that it has now, of which some are just `added`.

    Its `deformer` is the one of the rig and the settings that it has now.
    """
    item = document.objects[k]
    is_new = item.pose is None and item.base.is_usual
    if is_new and len(item.handles) < 2 and not item.is_held_around:
        return document
    anchors = _anchors(item, deformer, added)
    handles, base = deformer.held(item.handles, item.pose, anchors)
    return document.with_object(k, replace(item, handles=handles, base=base))


def let_go(document: Document, k: int, deformer: Deformer, handles: tuple[int, ...]) -> Document:
    """Object `k` without the anchors that are near these of its handles, which will be dragged."""
    item = document.objects[k]
    near = [item.handles[h].control_point for h in handles]
    if item.base.anchors is None or not near:
        return document
    anchors = np.intersect1d(item.base.anchors, _beyond(deformer, near, RELEASED))
    if len(anchors) == len(item.base.anchors):
        return document
    held, base = deformer.held(item.handles, item.pose, anchors)
    return document.with_object(k, replace(item, handles=held, base=base))


def _anchors(item: EditObject, deformer: Deformer, added: tuple[int, ...]) -> I32:
    """What stays by itself from now on: what did, but for what is near a new handle.

    A pin does not move, and takes nothing away. The first handles that are to be dragged choose
    the far side anew.
    """
    free = [h.control_point for h in item.handles if not h.is_pin]
    if item.is_held_around:
        return _beyond(deformer, free, AROUND)
    if not item.has_auto_anchors:
        return np.empty(0, np.int32)
    new = [item.handles[h].control_point for h in added]
    if free and set(free) <= set(new) and item.rig.held is None:
        kept, near = deformer.farthest_from(free[0]), free[1:]
    else:
        before = tuple(h for i, h in enumerate(item.handles) if i not in added)
        kept = deformer.anchors(before, item.base)
        near = [node for node in new if node in free]
    return np.intersect1d(kept, _beyond(deformer, near, RELEASED)) if near else kept


def _beyond(deformer: Deformer, nodes: list[int], reach: float) -> I32:
    """Control points farther than `reach` diameters from all `nodes`; none without nodes."""
    if not nodes:
        return np.empty(0, np.int32)
    distances = np.min([deformer.graph.distances_from(node) for node in nodes], axis=0)
    return np.flatnonzero(distances > reach * deformer.diameter).astype(np.int32)


# A locked object is kept from changes by a slip.

# What also a locked object may change in; what it is in a key pose changes nothing of it now.
FREE = ("name", "is_visible", "is_locked", "layer", "keys")
KEPT = tuple(f.name for f in fields(EditObject) if f.name not in FREE)


def set_locked(document: Document, k: int, is_locked: bool) -> Document:
    """Object `k` kept from changes by a slip, or free to be changed."""
    return document.with_object(k, replace(document.objects[k], is_locked=is_locked))


def locked_change(before: Document, after: Document) -> EditObject | None:
    """The locked object of `before` that is changed or gone in `after`, if there is one.

    Its name, whether it is shown, which others it covers, and its key poses are not kept from
    change.
    """
    locked = (own for own in before.objects if own.is_locked)
    return next((own for own in locked if not any(_is_same(own, o) for o in after.objects)), None)


def _is_same(one: EditObject, other: EditObject) -> bool:
    """Whether they differ at most in what also a locked object may change in."""
    return one is other or all(getattr(one, name) is getattr(other, name) for name in KEPT)
