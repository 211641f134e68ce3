"""Key poses of an animation, as pure functions Document -> Document.

A key pose is what each lifted object looked like when the pose was added. An object that is lifted
later, or anew, has the pose that it has now wherever it has no key pose of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..base.arrays import F64, same_values
from .edits import EditError
from .model import Document, EditObject, KeyPose
from .pose import Pose

MOST = 12


def count_keys(document: Document) -> int:
    """How many key poses there are."""
    return max((len(item.keys) for item in document.objects), default=0)


def add_key(document: Document) -> Document:
    """The pose of all objects as a further key pose, after the others. Raises EditError."""
    count = count_keys(document)
    if not any(item.lifted is not None for item in document.objects):
        raise EditError("lift an object before keeping its pose")
    if count >= MOST:
        raise EditError(f"an animation has at most {MOST} key poses")
    return _changed(document, lambda item: (*_keys(item, count), _now(item)))


def replace_key(document: Document, number: int) -> Document:
    """Key pose `number`, from 0, is the pose that the objects have now."""
    count = count_keys(document)

    def put(item: EditObject) -> tuple[KeyPose, ...]:
        keys = _keys(item, count)
        return (*keys[:number], _now(item), *keys[number + 1 :])

    return _changed(document, put)


def remove_key(document: Document, number: int) -> Document:
    """Without key pose `number`, from 0."""
    return _changed(document, lambda item: item.keys[:number] + item.keys[number + 1 :])


def at_key(document: Document, number: int) -> Document:
    """Every object as it is in key pose `number`, from 0."""
    return _at_key(document, number, range(len(document.objects)))


def free_at_key(document: Document, number: int) -> Document:
    """The same, but for what is locked: it stays as it is."""
    free = [k for k, item in enumerate(document.objects) if not item.is_locked]
    return _at_key(document, number, free)


def _at_key(document: Document, number: int, chosen: Iterable[int]) -> Document:
    for k in chosen:
        item = document.objects[k]
        if number >= len(item.keys):
            continue
        now, key = _now(item), item.keys[number]
        if not (_is_same(now, key) and same_values(now.base, key.base)):
            document = document.with_object(k, _posed(item, key))
    return document


def off_key(document: Document, number: int) -> int | None:
    """The first object that is not as it is in key pose `number`, from 0; None: all are."""
    for k, item in enumerate(document.objects):
        if number < len(item.keys) and not _is_same(_now(item), item.keys[number]):
            return k
    return None


def with_keys(document: Document, moments: Sequence[Document]) -> Document:
    """The document whose key poses are the `moments`, which differ from it in pose and place."""
    objects = tuple(
        item if item.lifted is None
        else replace(item, keys=tuple(_now(moment.objects[k]) for moment in moments))
        for k, item in enumerate(document.objects)
    )  # fmt: skip
    return replace(document, objects=objects)


def with_keys_again(document: Document, k: int, again: Callable[[Document], Document]) -> Document:
    """Object `k`, whose shape is another one, with the key poses that `again` makes of its pose."""
    item = document.objects[k]

    def made(key: KeyPose) -> KeyPose:
        there = again(document.with_object(k, _posed(item, key))).objects[k]
        return replace(key, handles=there.handles, pose=there.pose, base=there.base)

    return document.with_object(k, replace(item, keys=tuple(map(made, item.keys))))


def is_at_key(document: Document, number: int) -> bool:
    """Whether the objects are as they are in key pose `number`, from 0."""
    return off_key(document, number) is None


def _now(item: EditObject) -> KeyPose:
    rig = item.rig
    return KeyPose(item.handles, item.pose, item.placement, rig.held, rig.shifts, item.base)


def _posed(item: EditObject, key: KeyPose) -> EditObject:
    """What was frozen since stays where it is in the key pose."""
    was, held = key.held, item.rig.held
    is_alike = was is not None and held is not None and np.array_equal(was, held)
    shifts = key.shifts if is_alike else _shifts(item, key.pose)
    return replace(
        item, handles=key.handles, pose=key.pose, placement=key.placement, base=key.base,
        rig=replace(item.rig, shifts=shifts),
    )  # fmt: skip


def _shifts(item: EditObject, pose: Pose | None) -> F64 | None:
    """(P, 3) object units, from rest, of what is frozen where `pose` has it; None: at rest."""
    held = item.rig.held
    if pose is None or held is None or item.lifted is None:
        return None
    shifts = pose.points[held] - item.lifted.control_points[held]
    return shifts if shifts.any() else None


def _is_same(one: KeyPose, other: KeyPose) -> bool:
    """Whether pose, handles and place hold equal values, as they do in a session that was read."""
    return (
        one.placement == other.placement
        and same_values(one.pose, other.pose)
        and same_values(one.handles, other.handles)
    )


def _keys(item: EditObject, count: int) -> tuple[KeyPose, ...]:
    """As many as there are; an object that is newer than some has its pose of now there."""
    return item.keys + (_now(item),) * (count - len(item.keys))


def _changed(document: Document, change: Callable[[EditObject], tuple[KeyPose, ...]]) -> Document:
    objects = tuple(
        item if item.lifted is None else replace(item, keys=change(item))
        for item in document.objects
    )
    return replace(document, objects=objects)
