"""A lifted object whose mask was refined: its cut-out and its shape follow, in place.

What the refinement does not concern stays as it is, so that nothing moves that the artist did not
touch. The background follows in `compose.repair`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import KDTree

from .. import compose
from ..base.arrays import F32, F64, I32, Mask, Pixels, Selection, crop
from ..base.camera import Camera
from ..base.progress import Progress, part, silent
from ..base.rotations import matrices_from_quats, quats_from_matrices
from ..compose.plate.plate import plate_cover
from ..compose.plate.repair import Uncovering, refitted_plate
from ..deform.control_points import MIN_COUNT, with_more_points
from ..document.gaussians import Gaussians
from ..document.hold_edits import keeps_pose
from ..document.model import (
    Document,
    EditObject,
    Handle,
    KeyPose,
    LiftedObject,
    LiftSettings,
    Matte,
    PhotoTexture,
    Placement,
    Plate,
)
from ..document.paint import Paint
from ..document.pose import Base, Pose
from ..document.rig import Rig
from ..document.sides import Sides
from ..document.transparency import continued
from ..pictures.image import Picture
from ..segment.mask_edit import as_coverage, is_selected
from ..segment.matting.matte import REACH, band_width
from . import LiftError, LiftSubject, lift_subject, load
from .beyond_frame import cut_out_beyond
from .loose_hair import with_hair_along, with_loose_hair
from .registration.imported import ImportTarget, rematted
from .relief.spreading import BRIM

# The transfer of an object's edits to another shape of the same picture.
#
# A shape that is lifted anew, or made thicker, is seen at the same places of the photo: a handle
# takes hold of what is seen there now, on the same side, and is dragged as far. So does each region
# of the rig. A shape that was refitted to a refined mask has the old one's surface and control
# points wherever the mask did not change: there pose and placement go over as they are.

GUIDES = 4  # old control points that tell where a new one goes
HANDLE_STILL_THERE = (
    2.0  # x spacing of the Gaussians: a handle that is farther off has lost its surface
)
OTHER_SIDE = 1e6  # px: the far side of the object is farther than anything on the near one


def carried_over(
    item: EditObject, matte: Matte, lifted: LiftedObject, shape: LiftSettings
) -> EditObject:
    """`item` with another lift of the same mask.

    Its pose goes over where no handle gives it, or not they alone. Else there is none: it has to
    be solved anew. So has that of a key pose, which goes over in any case. Of two handles that
    would share a control point the later one is gone.
    """
    changed = item.with_lifted(_repainted(matte, item, lifted), lifted, shape)
    old = item.lifted
    if old is None:
        return changed
    before = KDTree(_seen_at(old, old.control_points))
    count = min(GUIDES, len(old.control_points))
    gaps, nearest = before.query(_seen_at(lifted, lifted.control_points), k=count)
    gaps, nearest = gaps.reshape(len(gaps), -1), nearest.reshape(len(gaps), -1)
    rest = old.object_points(lifted.world_points(lifted.control_points.astype(np.float64)))

    def moved(pose: Pose | None) -> Pose | None:
        if pose is None:
            return None
        led = _led(rest, old, pose, gaps, nearest)
        return Pose(lifted.object_points(old.world_points(led.points)), led.rotations)

    def handled(handles: tuple[Handle, ...]) -> tuple[Handle, ...]:
        kept: dict[int, Handle] = {}
        for handle in (_carried(each, old, lifted) for each in handles):
            kept.setdefault(handle.control_point, handle)
        return tuple(kept.values())

    def rigged(rig: Rig) -> Rig:
        rig = rig.moved_to(nearest[:, 0])
        if rig.shifts is None:
            return rig
        return replace(rig, shifts=rig.shifts * (old.scale / lifted.scale))

    def based(base: Base) -> Base:
        return Base(moved(base.pose), handled(base.handles), _among(nearest[:, 0], base.anchors))

    def kept(key: KeyPose) -> KeyPose:
        rig = rigged(replace(item.rig, held=key.held, shifts=key.shifts))
        return KeyPose(
            handled(key.handles), moved(key.pose), key.placement, rig.held, rig.shifts,
            based(key.base),
        )  # fmt: skip

    return replace(
        changed, handles=handled(item.handles), rig=rigged(item.rig), base=based(item.base),
        pose=moved(item.pose) if keeps_pose(item) else None, keys=tuple(map(kept, item.keys)),
    )  # fmt: skip


def _among(nearest: np.ndarray, region: I32 | None) -> I32 | None:
    """Those control points whose `nearest` (M,) old ones are in a region of the old ones."""
    return None if region is None else np.flatnonzero(np.isin(nearest, region)).astype(np.int32)


def refitted(item: EditObject, matte: Matte, lifted: LiftedObject, camera: Camera) -> EditObject:
    """`item` in its refitted shape; a handle on what is no part of it any more is gone.

    `camera` is the photo's.
    """
    old = item.lifted
    assert old is not None, "only a lifted object is refitted"
    rest = lifted.control_points.astype(np.float64)
    gaps, nearest = KDTree(old.control_points).query(rest, k=min(GUIDES, len(old.control_points)))
    gaps, nearest = gaps.reshape(len(rest), -1), nearest.reshape(len(rest), -1)

    def moved(pose: Pose | None) -> Pose | None:
        return None if pose is None else _pose_of(rest, old, pose, gaps, nearest)

    def based(base: Base) -> Base:
        anchors = _among(nearest[:, 0], base.anchors)
        return Base(moved(base.pose), _held(base.handles, lifted), anchors)

    def kept(key: KeyPose) -> KeyPose:
        rig = replace(item.rig, held=key.held, shifts=key.shifts).moved_to(nearest[:, 0])
        placement = _same_motion(key.placement, old, lifted, camera)
        handles = _held(key.handles, lifted)
        return KeyPose(handles, moved(key.pose), placement, rig.held, rig.shifts, based(key.base))

    return replace(
        item, matte=_repainted(matte, item, lifted), contaminated=None, lifted=lifted, shaped=None,
        handles=_held(item.handles, lifted), rig=item.rig.moved_to(nearest[:, 0]),
        pose=moved(item.pose), placement=_same_motion(item.placement, old, lifted, camera),
        base=based(item.base), keys=tuple(map(kept, item.keys)),
    )  # fmt: skip


def _repainted(matte: Matte, item: EditObject, lifted: LiftedObject) -> Matte:
    """`matte` with the paint on `item`, whose shape is `lifted` now.

    Where the invented pictures are others, what was painted on them is gone.
    """
    old, paint = item.lifted, None if item.matte is None else item.matte.paint
    if old is None or paint is None:
        return replace(matte, paint=None) if matte.paint is not None else matte
    reach = HANDLE_STILL_THERE * old.spacing * old.scale
    before = KDTree(old.world_points(old.gaussians.means))
    gaps, nearest = before.query(lifted.world_points(lifted.gaussians.means))
    is_there = gaps < reach
    spots = np.where(is_there[:, None], paint.spots[nearest], 0)
    apart = None if paint.apart is None else is_there & paint.apart[nearest]
    paint, sides = replace(paint, spots=spots, apart=apart), (old.sides, lifted.sides)
    if sides[0] is None or sides[1] is None or not _same_pictures(sides[0], sides[1]):
        paint = Paint((), spots, apart).with_pixels(matte.box, paint.crop(matte.box))
    return replace(matte, paint=paint)


def _same_pictures(one: Sides, other: Sides) -> bool:
    is_there = (one.left, one.top) == (other.left, other.top)
    return is_there and np.array_equal(one.pixels, other.pixels)


def _held(handles: tuple[Handle, ...], lifted: LiftedObject) -> tuple[Handle, ...]:
    """The handles whose surface is still there, each with a control point of its own."""
    surface, nodes = KDTree(lifted.body.means), KDTree(lifted.control_points)
    held: list[Handle] = []
    for handle in handles:
        index = int(nodes.query(handle.point)[1])
        is_there = surface.query(handle.point)[0] <= HANDLE_STILL_THERE * lifted.spacing
        if is_there and all(other.control_point != index for other in held):
            held.append(replace(handle, control_point=index))
    return tuple(held)


def _pose_of(
    rest: F64, old: LiftedObject, pose: Pose, gaps: np.ndarray, nearest: np.ndarray
) -> Pose:
    """The pose that is `_led`; a control point that was there before is exactly where it was."""
    led = _led(rest, old, pose, gaps, nearest)
    points, rotations = led.points.copy(), led.rotations.copy()
    is_old = gaps[:, 0] == 0
    points[is_old] = pose.points[nearest[is_old, 0]]
    rotations[is_old] = pose.rotations[nearest[is_old, 0]]
    return Pose(points, rotations)


def _led(rest: F64, old: LiftedObject, pose: Pose, gaps: np.ndarray, nearest: np.ndarray) -> Pose:
    """The pose of control points at `rest` (M, 3), as their `nearest` (M, G) old ones move.

    It is in the old object's frame; the nearer one is, by the `gaps` (M, G), the more it leads.
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
    return Pose(points, matrices_from_quats(mean / np.linalg.norm(mean, axis=1, keepdims=True)))


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


# A lifted shape refitted to a refined mask, in place.
#
# Lifting anew would draw every Gaussian and control point anew, and with them what is posed by
# them. So the shape of the refined mask takes the old one's place only about where the mask
# changed: there its Gaussians slide along their rays of the photo until both middle sheets meet.

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


BLEND = 2.0  # x band: over so much the old cut-out goes over into the new one


@dataclass(frozen=True, eq=False)
class Lifted:
    """A lifted object, and the selection (H, W) that it is of."""

    selection: Selection
    matte: Matte
    lifted: LiftedObject
    shape: LiftSettings


@dataclass(frozen=True, eq=False)
class Background:
    """The background of a lifted object."""

    plate: Plate
    others: Mask  # (H, W) what other objects hide of it
    inpaint: str  # backend that fills in what is missing
    alpha: Pixels | None = None  # (H, W) of the photo, where it has one


@dataclass(frozen=True, eq=False)
class Refitted:
    """An object in the shape of its refined selection, and what is behind it then."""

    matte: Matte
    lifted: LiftedObject
    plate: Plate | None


def refit(
    was: Lifted,
    scene: ImportTarget,
    behind: Background | None,
    progress: Progress = silent,
    seed: int = 0,
) -> Refitted:
    """Refit an object when the selection of a lifted object is refined to `scene.mask`.

    Raises LiftError, InpaintError.
    """
    matte, lifted = refit_object(was, scene, part(progress, 0.0, 0.9), seed)
    if behind is None:
        return Refitted(matte, lifted, None)
    size = scene.mask.shape[::-1]
    before, after = (behind.others | _covered(one, size) for one in (was.matte, matte))
    pixels = continued(Picture(scene.pixels, behind.alpha), before | after)
    change = Uncovering(pixels, behind.plate, before, after)
    rest = part(progress, 0.9, 1.0)
    plate = refitted_plate(change, compose.load(behind.inpaint), rest, seed + 1)
    return Refitted(matte, lifted, plate)


def background_of(document: Document, k: int, inpaint: str) -> Background | None:
    """Return the background of object `k` and its copies; None before it is filled in."""
    if document.plate is None:
        return None
    matte = document.objects[k].matte
    others = tuple(o for o in document.objects if o.matte is not matte)
    covered = plate_cover(replace(document, objects=others))
    return Background(document.plate, covered, inpaint, document.photo.picture.alpha)


def _covered(matte: Matte, size: tuple[int, ...]) -> Mask:
    """(H, W) what a cut-out hides of a photo of `size` (width, height)."""
    return crop(matte.alpha, matte.box, (0, 0, size[0], size[1])) > 0


def refit_object(
    was: Lifted, scene: ImportTarget, progress: Progress = silent, seed: int = 0
) -> tuple[Matte, LiftedObject]:
    """Cut-out and shape of `scene.mask`, a refined selection of what was lifted.

    An object that came out of a file, or was generated, keeps its shape. Raises LiftError.
    """
    progress(0.0, "Cutting out the object")
    changed = as_coverage(scene.mask) != as_coverage(was.selection)
    if not changed.any():
        return was.matte, was.lifted
    away = cv2.distanceTransform((~changed).astype(np.uint8), cv2.DIST_L2, 5)
    bare = cut_out_beyond(scene.pixels, scene.mask, scene.mixed)
    whole = with_loose_hair(scene.pixels, bare)
    matte = _blended(was.matte, whole, away)
    camera, lifted = scene.camera, was.lifted
    if lifted.middle is None:
        shown = rematted(lifted, matte, camera, seed)
        return matte, replace(shown, backend=lifted.backend)
    lifter = load("relief")  # the only one that knows a middle sheet
    subject = LiftSubject(scene.pixels, camera, is_selected(scene.mask), bare)
    fresh = lift_subject(lifter, subject, was.shape, part(progress, 0.3, 1.0), seed)
    fresh = with_hair_along(fresh, bare, whole, camera, seed)
    spacing = lifted.spacing * lifted.scale * camera.focal / float(lifted.centre[2])
    reach = band_width(camera.width, camera.height) + BRIM * spacing
    return matte, refitted_shape(lifted, fresh, changed, reach)


def _blended(old: Matte, new: Matte, away: F32) -> Matte:
    """`new` near the change and `old` elsewhere; `away` (H, W) px of the photo from the change."""
    height, width = away.shape
    x0, y0, x1, y1 = new.box
    band = band_width(width, height)
    # Beyond the photo's frame it is as far from the change as at the frame.
    rows, columns = np.arange(y0, y1).clip(0, height - 1), np.arange(x0, x1).clip(0, width - 1)
    far = away[np.ix_(rows, columns)]
    share = np.clip((far - REACH * band) / (BLEND * band), 0, 1).astype(np.float32)
    share *= crop(np.ones(old.alpha.shape, np.float32), old.box, new.box)
    alpha = np.asarray(
        new.alpha + share * (crop(old.alpha, old.box, new.box) - new.alpha), np.float32
    )
    own = crop(old.foreground, old.box, new.box)
    foreground = new.foreground + share[..., None] * (own - new.foreground)
    return Matte(new.left, new.top, alpha, np.asarray(foreground, np.float32))
