"""Handles and rig of an object carried over to another shape of the same picture.

A shape that is lifted anew, or made thicker, is seen at the same places of the photo: a handle
takes hold of what is seen there now, on the same side, and is dragged as far. So does each region
of the rig.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ..base.arrays import F64
from ..document.model import EditObject, Handle, LiftedObject, LiftSettings, Matte

OTHER_SIDE = 1e6  # px: the far side of the object is farther than anything on the near one


def carried_over(
    item: EditObject, matte: Matte, lifted: LiftedObject, shape: LiftSettings
) -> EditObject:
    """`item` with another lift of the same mask; no pose: it has to be solved anew.

    Of two handles that would share a control point the later one is gone.
    """
    changed = item.with_lifted(matte, lifted, shape)
    old = item.lifted
    if old is None:
        return changed
    handles: list[Handle] = []
    for handle in item.handles:
        moved = _carried(handle, old, lifted)
        if all(other.control_point != moved.control_point for other in handles):
            handles.append(moved)
    before = KDTree(_seen_at(old, old.control_points))
    nearest = np.asarray(before.query(_seen_at(lifted, lifted.control_points))[1])
    rig = item.rig.moved_to(nearest)
    if rig.shifts is not None:
        rig = replace(rig, shifts=rig.shifts * (old.scale / lifted.scale))
    return replace(changed, handles=tuple(handles), rig=rig)


def _carried(handle: Handle, old: LiftedObject, new: LiftedObject) -> Handle:
    """`handle` of the old shape on the new one, dragged as far in the world."""
    ratio = old.scale / new.scale
    i = int(_nearest(old, handle.point[None])[0])
    gaps = _seen_at(new, new.gaussians.means) - _seen_at(old, handle.point[None])
    j = int((gaps**2).sum(1).argmin())
    point = new.gaussians.means[j] + (handle.point - old.gaussians.means[i]) * ratio
    index = int(((new.control_points - point) ** 2).sum(1).argmin())
    dragged = (handle.target - handle.point) * ratio
    return replace(handle, control_point=index, point=point, target=point + dragged)


def _nearest(lifted: LiftedObject, points: np.ndarray) -> np.ndarray:
    """Index (n,) of the Gaussian nearest to each of the points (n, 3), object frame."""
    return np.asarray(KDTree(lifted.gaussians.means).query(points)[1])


def _seen_at(lifted: LiftedObject, points: np.ndarray) -> F64:
    """(n, 3) px of the photo in which points (n, 3) are seen, and which side they are on."""
    i = _nearest(lifted, points)
    is_front = (lifted.texture.visibility > 0.5) & (lifted.texture.solidity > 0.5)
    return np.column_stack([lifted.texture.u0[i], OTHER_SIDE * is_front[i]]).astype(np.float64)
