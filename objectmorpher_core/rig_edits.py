"""Changes of how an object's regions move, as pure functions Document -> Document."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .document import Document
from .edits import EditError
from .rig import Rig, Seam


def set_rig(document: Document, k: int, rig: Rig) -> Document:
    """How the regions of object `k` move; its pose was solved with the old rig and is gone."""
    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before saying how its parts move")
    try:
        rig.check(len(item.lifted.control_points))
    except ValueError as error:
        raise EditError(str(error)) from error
    return document.with_object(k, replace(item, rig=rig, pose=None, base=item.base.at_rest))


def cut(document: Document, k: int, first: np.ndarray, second: np.ndarray) -> Document:
    """Control points `first` and `second` of object `k` do not move each other directly."""
    rig = document.objects[k].rig
    return set_rig(document, k, replace(rig, seams=(*rig.seams, Seam(first, second))))


def glue(document: Document, k: int, first: np.ndarray, second: np.ndarray) -> Document:
    """Control points `first` and `second` of object `k` hang together as neighbours do."""
    rig = document.objects[k].rig
    return set_rig(document, k, replace(rig, seams=(*rig.seams, Seam(first, second, True))))


def make_body(document: Document, k: int, nodes: np.ndarray) -> Document:
    """Control points of object `k` move as one rigid body. They leave the bodies they were in."""
    rig = document.objects[k].rig
    others = (np.setdiff1d(body, nodes) for body in rig.bodies)
    bodies = (*(body for body in others if len(body) > 1), np.unique(nodes))
    return set_rig(document, k, replace(rig, bodies=bodies))


def freeze(document: Document, k: int, nodes: np.ndarray) -> Document:
    """Control points `nodes` of object `k` stay where they are now, whatever is dragged."""
    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before saying how its parts move")
    rig, rest = item.rig, item.lifted.control_points.astype(np.float64)
    places = rig.held_at(rest)
    places[nodes] = rest[nodes] if item.pose is None else item.pose.points[nodes]
    old = np.empty(0, np.int32) if rig.held is None else rig.held
    return set_rig(document, k, _with_held(rig, np.union1d(old, nodes), places - rest))


def thaw(document: Document, k: int, nodes: np.ndarray) -> Document:
    """Control points `nodes` of object `k` are frozen no more."""
    item = document.objects[k]
    if item.lifted is None or item.rig.held is None:
        return document
    left = np.setdiff1d(item.rig.held, nodes)
    rest = item.lifted.control_points.astype(np.float64)
    return set_rig(document, k, _with_held(item.rig, left, item.rig.held_at(rest) - rest))


def _with_held(rig: Rig, held: np.ndarray, shifts: np.ndarray) -> Rig:
    """The rig with these frozen control points; `shifts` (M, 3) of all from rest."""
    own = shifts[held]
    return replace(rig, held=held if len(held) else None, shifts=own if own.any() else None)
