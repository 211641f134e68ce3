"""A lifted shape refitted to a refined mask, in place.

Lifting anew would draw every Gaussian and control point anew, and with them what is posed by them.
So the shape of the refined mask takes the old one's place only about where the mask changed: there
its Gaussians slide along their rays of the photo until both middle sheets meet.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scipy.spatial import KDTree

from ..base.arrays import F32, F64, Mask
from ..deform.control_points import MIN_COUNT, with_more_points
from ..document.gaussians import Gaussians
from ..document.model import LiftedObject, PhotoTexture
from . import LiftError

MEETING = 3.0  # x reach: how far beyond it the two middle sheets are compared
NEIGHBOURS = 16  # places of comparison that a Gaussian's slide is the mean of
COMPARED = 4000  # Gaussians that are compared at most
STILL_THERE = 2.0  # x spacing: a control point that is farther off has lost its surface


def refitted_shape(
    old: LiftedObject, fresh: LiftedObject, changed: Mask, reach: float
) -> LiftedObject:
    """`old` with the Gaussians of `fresh` within `reach` px of what `changed` (H, W) of its mask.

    Both were lifted from one photo, by a lifter that knows a middle sheet. Control points stay
    where their surface does. Raises LiftError where too little is left.
    """
    assert old.middle is not None and fresh.middle is not None, "a relief has a middle sheet"
    away = cv2.distanceTransform((~changed).astype(np.uint8), cv2.DIST_L2, 5)
    from_change = [_at(away, lifted.texture.u0) for lifted in (old, fresh)]
    stays, comes = from_change[0] >= reach, from_change[1] < reach
    meeting = np.flatnonzero(stays & (from_change[0] < MEETING * reach))
    slide = _slide(old, fresh, meeting if len(meeting) else np.flatnonzero(stays), comes)
    added, middle = _slid(fresh, comes, slide, old)
    kept = old.gaussians.select(stays)
    gaussians = Gaussians(
        *(
            np.concatenate([getattr(kept, name), getattr(added, name)])
            for name in ("means", "quats", "scales", "opacities", "colors")
        )
    )
    textures = (old.texture, stays), (fresh.texture, comes)
    texture = PhotoTexture(
        *(
            np.concatenate([getattr(part, name)[chosen] for part, chosen in textures])
            for name in ("u0", "visibility", "solidity")
        )
    )
    lifted = replace(
        old, gaussians=gaussians, texture=texture,
        sides=None if old.sides is None else old.sides.select(stays).followed_by(int(comes.sum())),
        middle=np.concatenate([old.middle[stays], middle]),
    )  # fmt: skip
    return with_control_points(lifted, old.control_points)


def with_control_points(lifted: LiftedObject, points: F32) -> LiftedObject:
    """`lifted` with those `points` (M, 3) that its surface still has, and more where it is new."""
    body = lifted.body
    if len(body) < MIN_COUNT:
        raise LiftError(f"the object has {len(body)} Gaussians left, too few to be moved")
    off = KDTree(body.means).query(points)[0]
    gap = float(np.median(KDTree(points).query(points, k=2)[0][:, 1]))
    kept = points[off <= max(STILL_THERE * lifted.spacing, 0.5 * gap)]
    more = with_more_points(kept, body.means, gap)
    if len(more) < MIN_COUNT:
        raise LiftError("too little of the object is left to be moved")
    return replace(lifted, control_points=more)


def _at(field: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """`field` (H, W) at photo px (N, 2), clamped to the photo."""
    height, width = field.shape
    column, row = np.floor(xy).astype(int).T
    return field[row.clip(0, height - 1), column.clip(0, width - 1)]


def _slide(old: LiftedObject, fresh: LiftedObject, compared: np.ndarray, comes: np.ndarray) -> F64:
    """(n,) world units in depth from the middle sheet of `fresh` to that of `old`.

    Of the Gaussians of `fresh` that come: as it is at those of `old` that are `compared`, nearby.
    """
    assert old.middle is not None and fresh.middle is not None
    wanted = fresh.texture.u0[comes].astype(np.float64)
    if not len(compared):
        return np.zeros(len(wanted))
    compared = compared[:: len(compared) // COMPARED + 1]
    at = old.texture.u0[compared].astype(np.float64)
    near = KDTree(fresh.texture.u0).query(at)[1]
    own = fresh.middle[near].astype(np.float64)
    depth = own[:, 0] + (own[:, 1:] * (at - fresh.texture.u0[near])).sum(1)
    difference = old.middle[compared, 0] - depth
    count = min(NEIGHBOURS, len(at))
    gaps, near = KDTree(at).query(wanted, k=count)
    gaps, near = gaps.reshape(-1, count), near.reshape(-1, count)
    weights = 1.0 / np.maximum(gaps, 0.5)
    return (weights * difference[near]).sum(1) / weights.sum(1)


def _slid(
    fresh: LiftedObject, comes: np.ndarray, slide: F64, old: LiftedObject
) -> tuple[Gaussians, F32]:
    """The Gaussians of `fresh` that come, in the frame of `old`, and their middle sheet (n, 3).

    Neither frame is turned against the world.
    """
    assert fresh.middle is not None
    gaussians, middle = fresh.gaussians.select(comes), fresh.middle[comes].astype(np.float64)
    world = fresh.world_points(gaussians.means.astype(np.float64))
    ratio = (1.0 + slide / world[:, 2])[:, None]
    sizes = gaussians.scales * (ratio * fresh.scale / old.scale)
    moved = replace(
        gaussians, means=old.object_points(world * ratio).astype(np.float32),
        scales=sizes.astype(np.float32),
    )  # fmt: skip
    middle[:, 0] += slide
    return moved, middle.astype(np.float32)
