"""The transfer of an object's edits to another shape of the same picture.

A shape that is lifted anew, or made thicker, is seen at the same places of the photo: a handle
takes hold of what is seen there now, on the same side, and is dragged as far. So does each region
of the rig. A shape that was refitted to a refined mask has the old one's surface and control points
wherever the mask did not change: there pose and placement go over as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ..base.arrays import F64
from ..base.camera import Camera
from ..base.rotations import matrices_from_quats, quats_from_matrices
from ..document.model import EditObject, Handle, LiftedObject, LiftSettings, Matte, Placement
from ..document.pose import Pose

GUIDES = 4  # old control points that tell where a new one goes
STILL_THERE = 2.0  # x spacing of the Gaussians: a handle that is farther off has lost its surface
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


def refitted(item: EditObject, matte: Matte, lifted: LiftedObject, camera: Camera) -> EditObject:
    """`item` in its refitted shape; a handle on what is no part of it any more is gone.

    `camera` is the photo's.
    """
    old = item.lifted
    assert old is not None, "only a lifted object is refitted"
    rest = lifted.control_points.astype(np.float64)
    gaps, nearest = KDTree(old.control_points).query(rest, k=min(GUIDES, len(old.control_points)))
    gaps, nearest = gaps.reshape(len(rest), -1), nearest.reshape(len(rest), -1)
    return replace(
        item, matte=matte, contaminated=None, lifted=lifted, shaped=None,
        handles=_held(item.handles, lifted), rig=item.rig.moved_to(nearest[:, 0]),
        pose=None if item.pose is None else _pose_of(rest, old, item.pose, gaps, nearest),
        placement=_same_motion(item.placement, old, lifted, camera),
    )  # fmt: skip


def _held(handles: tuple[Handle, ...], lifted: LiftedObject) -> tuple[Handle, ...]:
    """The handles whose surface is still there, each with a control point of its own."""
    surface, nodes = KDTree(lifted.body.means), KDTree(lifted.control_points)
    held: list[Handle] = []
    for handle in handles:
        index = int(nodes.query(handle.point)[1])
        is_there = surface.query(handle.point)[0] <= STILL_THERE * lifted.spacing
        if is_there and all(other.control_point != index for other in held):
            held.append(replace(handle, control_point=index))
    return tuple(held)


def _pose_of(
    rest: F64, old: LiftedObject, pose: Pose, gaps: np.ndarray, nearest: np.ndarray
) -> Pose:
    """The pose of control points at `rest` (M, 3), as their `nearest` (M, G) old ones move.

    One that was there before is exactly where it was; `gaps` (M, G) object units.
    """
    weights = 1.0 / np.maximum(gaps, 1e-9) ** 2
    weights /= weights.sum(1, keepdims=True)
    turns = pose.rotations[nearest]
    offsets = rest[:, None] - old.control_points[nearest]
    led = (turns @ offsets[..., None])[..., 0] + pose.points[nearest]
    points = (weights[..., None] * led).sum(1)
    quats = quats_from_matrices(pose.rotations)[nearest]
    quats *= np.where((quats * quats[:, :1]).sum(2, keepdims=True) < 0, -1.0, 1.0)
    mean = (weights[..., None] * quats).sum(1)
    rotations = matrices_from_quats(mean / np.linalg.norm(mean, axis=1, keepdims=True))
    is_old = gaps[:, 0] == 0
    points[is_old] = pose.points[nearest[is_old, 0]]
    rotations[is_old] = pose.rotations[nearest[is_old, 0]]
    return Pose(points, rotations)


def _same_motion(
    placement: Placement, old: LiftedObject, new: LiftedObject, camera: Camera
) -> Placement:
    """The placement that moves `new`, whose centre is elsewhere, as it moved `old`."""
    if placement.is_identity:
        return placement
    motion = placement.matrix(old, camera)
    target = motion[:3, :3] @ new.centre + motion[:3, 3]
    across, down = camera.project(target) - camera.project(new.centre)
    depth = (target[2] - new.centre[2]) / (new.diameter * new.scale)
    return replace(placement, move=(float(across), float(down)), depth=float(depth))


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
