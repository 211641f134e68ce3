"""An edit as moving pictures: how it came about, the object turning, or its key poses in turn.

Each frame is the composite of a document, as an export is. Between two poses the handles go their
way and the object is solved anew, so that it bends as it would under the hand.

The document may be that of a smaller photo, smaller only by whole numbers: then each new pixel is
the mean of a square of old ones, in the photo, the plate and the mattes alike, and what was aligned
stays so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ..base.arrays import (
    F32,
    F64,
    U8,
    Mask,
    Pixels,
    crop,
    pixels_from_unit,
    same_values,
    unit_pixels,
)
from ..base.camera import Camera
from ..base.progress import Progress, silent
from ..base.rotations import vector_from_matrix
from ..compose.composite import composite
from ..deform.interpolation import PoseInterpolation
from ..deform.puppet import Puppet, puppet_of
from ..document.key_edits import at_key, count_keys
from ..document.model import Document, EditObject, Handle, Matte, Photo, Placement, Plate, Pose
from ..document.paint import Paint
from ..document.placement import blended, gimbal_of
from ..document.placement import turned as turned_about
from ..document.pose import Base
from ..document.settings import AS_IN_THE_PHOTO, Refined
from ..pictures.image import to_u8
from ..pictures.video import MOST_FRAMES

Box = tuple[int, int, int, int]


def shrunk(document: Document, times: int) -> Document:
    """The document of its photo, `times` smaller in width and height. Whole squares are kept.

    Raises ValueError where no pixel would be left.
    """
    width, height = (side // times for side in document.photo.size)
    if times < 1 or width < 1 or height < 1:
        raise ValueError(f"a photo of {document.photo.size} px cannot be {times} times smaller")
    if times == 1:
        return document
    photo = document.photo
    camera = _camera(photo.camera, times, width, height)
    pixels = photo.pixels[: height * times, : width * times]
    picture = replace(photo.picture, **_smaller(pixels, photo.picture.alpha, times))
    return replace(
        document,
        photo=Photo(picture, camera, photo.source, photo.name),
        objects=tuple(_object(item, times, width, height) for item in document.objects),
        plate=None if document.plate is None else _plate(document.plate, times, picture.pixels),
        refined=None if document.refined is None else _refined(document.refined, times, camera),
        horizon=None if document.horizon is None else document.horizon / times,
    )


def _smaller(
    pixels: Pixels, alpha: np.ndarray | None, times: int
) -> dict[str, np.ndarray]:  # fmt: skip
    """`pixels` (H, W, 3) and straight `alpha`, if there is one, `times` smaller."""
    height, width = pixels.shape[:2]
    if alpha is None:
        return {"pixels": pixels_from_unit(_means(unit_pixels(pixels), times), pixels.dtype)}
    cover = unit_pixels(alpha[:height, :width])
    share = _means(cover, times)
    own = _means(unit_pixels(pixels) * cover[..., None], times) / np.maximum(share, 1e-6)[..., None]
    return {
        "pixels": pixels_from_unit(own, pixels.dtype),
        "alpha": pixels_from_unit(share, alpha.dtype),
    }


def _camera(camera: Camera, times: int, width: int, height: int) -> Camera:
    return Camera(camera.focal / times, camera.cx / times, camera.cy / times, width, height)


def _object(item: EditObject, times: int, width: int, height: int) -> EditObject:
    mask = item.mask
    if mask is not None:
        mask = _means(mask[: height * times, : width * times].astype(np.float32), times) > 0.5
    matte, lifted, placement = item.matte, item.lifted, item.placement
    if lifted is not None:
        texture = replace(lifted.texture, u0=lifted.texture.u0 / np.float32(times))
        origin = lifted.origin
        if origin is not None:
            own = origin.camera
            size = own.width // times, own.height // times
            origin = replace(origin, camera=_camera(own, times, *size))
        lifted = replace(lifted, texture=texture, middle=None, origin=origin)
        if matte is not None and matte.paint is not None and (sides := lifted.sides) is not None:
            own = matte.paint.over(unit_pixels(sides.pixels), sides.left, sides.top)
            sides = replace(sides, pixels=np.rint(own * 255).astype(np.uint8))
            lifted = replace(lifted, sides=sides)
    return replace(
        item, mask=mask, coverage=None, found=None, lifted=lifted,
        matte=None if matte is None else _matte(matte, times), mixed=None, contaminated=None,
        placement=smaller(placement, times),
        finish=replace(item.finish, blur=item.finish.blur / times),
    )  # fmt: skip


def smaller(placement: Placement, times: int) -> Placement:
    """Return the same of a photo that is smaller by this factor."""
    x, y = placement.move
    return replace(placement, move=(x / times, y / times))


def _matte(matte: Matte, times: int) -> Matte:
    box = _aligned(matte.box, times)
    alpha = crop(matte.alpha, matte.box, box)
    inner = matte.box[1] - box[1], matte.box[0] - box[0]
    outer = box[3] - matte.box[3], box[2] - matte.box[2]
    edges = (inner[0], outer[0], inner[1], outer[1])
    foreground = cv2.copyMakeBorder(matte.foreground, *edges, cv2.BORDER_REPLICATE)
    own = _means(np.asarray(foreground * alpha[..., None], np.float32), times)
    small = _means(alpha, times)
    beyond = _means(np.asarray(foreground, np.float32), times)
    straight = np.where(small[..., None] > 0, own / np.maximum(small, 1e-6)[..., None], beyond)
    left, top, paint = box[0] // times, box[1] // times, None
    if matte.paint is not None:  # of the photo's part; that of the sides is in their pictures
        rgba = unit_pixels(matte.paint.crop(box))
        own = _means(np.dstack([rgba[..., :3] * rgba[..., 3:], rgba[..., 3:]]), times)
        own[..., :3] /= np.maximum(own[..., 3:], 1e-6)
        levels = np.rint(255 * own).astype(np.uint8)
        height, width = small.shape
        paint = Paint((), matte.paint.spots, matte.paint.apart)
        paint = paint.with_pixels((left, top, left + width, top + height), levels)
    return Matte(left, top, small, straight, paint)


def _plate(plate: Plate, times: int, photo: np.ndarray) -> Plate:
    """What is even in part invented is mixed so."""
    x0, y0, x1, y1 = _aligned(plate.box, times)
    height, width = photo.shape[:2]
    box = (max(x0, 0), max(y0, 0), min(x1, width * times), min(y1, height * times))
    own = plate.box
    clipped = (max(own[0], box[0]), max(own[1], box[1]), min(own[2], box[2]), min(own[3], box[3]))
    hole = crop(crop(plate.hole, own, clipped), clipped, box)
    share = _means(hole.astype(np.float32), times)[..., None]
    invented = unit_pixels(crop(plate.pixels, own, box)) * hole[..., None]
    left, top = box[0] // times, box[1] // times
    around = unit_pixels(photo[top : top + len(share), left : left + share.shape[1]])
    # Of a square that is invented in part the rest is the photo's; it holds the object there, so
    # that the invented part stands for all of it.
    mean = _means(np.asarray(invented, np.float32), times) / np.maximum(share, 1e-6)
    pixels = pixels_from_unit(np.where(share > 0, mean, around), plate.pixels.dtype)
    painted = None
    if plate.painted is not None:
        painted = _any(crop(plate.painted, own, box), times)
    return Plate(left, top, pixels, share[..., 0] > 0, plate.backend, plate.seed, painted)


def _refined(refined: Refined, times: int, camera: Camera) -> Refined | None:
    """What was refined of the photo that `camera` shows `times` smaller; None: nothing of it."""
    x0, y0, x1, y1 = _aligned(refined.box, times)
    box = (x0, y0, min(x1, camera.width * times), min(y1, camera.height * times))
    if box[0] >= box[2] or box[1] >= box[3]:
        return None
    alpha = np.asarray(crop(refined.alpha, refined.box, box), np.float32)
    colours = unit_pixels(crop(refined.pixels, refined.box, box)) * alpha[..., None]
    share = _means(alpha, times)
    mean = _means(np.asarray(colours, np.float32), times) / np.maximum(share, 1e-6)[..., None]
    pixels = pixels_from_unit(np.minimum(mean, 1), refined.pixels.dtype)
    levels = np.rint(share).astype(np.uint8)
    return replace(refined, left=x0 // times, top=y0 // times, pixels=pixels, alpha=levels)


def _aligned(box: Box, times: int) -> Box:
    """The smallest box around it whose sides lie between squares."""
    x0, y0, x1, y1 = box
    return (
        x0 // times * times,
        y0 // times * times,
        -(-x1 // times) * times,
        -(-y1 // times) * times,
    )


def _means(values: F32, times: int) -> F32:
    height, width = values.shape[:2]
    size = (width // times, height // times)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), np.float32)


def _any(there: Mask, times: int) -> Mask:
    return _means(there.astype(np.float32), times) > 0


MOTIONS = ("morph", "sway", "turn", "keys")
SWAY = 30.0  # degrees to both sides
HOLD = 0.15  # x the length of a morph, for which photo and edit are each shown at rest
LONGEST = 1280  # px, longer side of a frame
TOLERANCE = 1e-3  # of a solve between two frames


@dataclass(frozen=True)
class Clip:
    """The subject and the length of a video."""

    motion: str = "morph"  # photo, edit and back; the object sways; turns; through key poses
    seconds: float = 4.0
    rate: float = 25.0  # frames a second
    object: int | None = None  # index of the one that sways or turns; None: the first that can
    longest: int = LONGEST  # px

    def __post_init__(self) -> None:
        if self.motion not in MOTIONS:
            raise ValueError(f"a clip is one of {', '.join(MOTIONS)}, not {self.motion!r}")
        if not (self.seconds > 0 and 1 <= self.rate <= 60 and self.longest >= 16):
            raise ValueError("a clip needs a length, and from 1 to 60 frames a second")
        if self.seconds * self.rate > MOST_FRAMES:
            raise ValueError(f"a clip of more than {MOST_FRAMES} frames is too long")

    @property
    def count(self) -> int:
        return max(round(self.seconds * self.rate), 1)


def frames(document: Document, clip: Clip, progress: Progress = silent) -> Iterator[U8]:
    """The clip's pictures (h, w, 3), or (h, w, 4) where the photo has an alpha channel.

    All are of one size.

    Played again and again the clip has no jump. Raises ValueError where nothing moves.
    """
    times = _times(document, clip)
    keys: list[Document] = []
    if clip.motion == "keys":
        keys = [shrunk(at_key(document, n), times) for n in range(count_keys(document))]
        if len(keys) < 2:
            raise ValueError("a video through key poses needs at least two")
    small = shrunk(document, times)
    if clip.motion == "morph" and not any(item.is_moved for item in small.objects):
        raise ValueError("nothing was moved, there is nothing to be seen")
    turning = _turning(small, clip.object)
    if clip.motion in ("sway", "turn") and turning is None:
        raise ValueError("lift an object first, then it can turn")
    film = _Film(small, keys)
    for k in range(clip.count):
        progress(k / clip.count, "drawing")
        time = k / clip.count
        if clip.motion == "morph":
            pixels = film.morph(time)
        elif clip.motion == "keys":
            pixels = film.drawn(film.keyed(time))
        else:
            pixels = film.drawn(film.turned(turning or 0, _yaw_at(time, clip.motion)))
        yield np.ascontiguousarray(pixels)


def _times(document: Document, clip: Clip) -> int:
    """How often smaller than the photo the clip's pictures are."""
    return max(-(-max(document.photo.size) // clip.longest), 1)


def _turning(document: Document, wanted: int | None) -> int | None:
    """The index of the lifted object that is wanted, or else of the first that is seen."""
    lifted = [k for k, item in enumerate(document.objects) if item.lifted is not None]
    if wanted is not None:
        return wanted if wanted in lifted else None
    return next((k for k in lifted if document.objects[k].is_visible), next(iter(lifted), None))


def station_at(time: float, count: int) -> tuple[int, float]:
    """Which of `count` key poses was left at a `time` in [0, 1), and the share of the way done.

    Every way starts and ends slowly; the last one leads back to the first pose.
    """
    station, way = divmod(time * count, 1.0)
    return int(station) % count, float(0.5 - 0.5 * np.cos(np.pi * way))


def share_at(time: float) -> float:
    """Return the share of the edit at a `time` in [0, 1) of a morph: still, on, still, and back."""
    way = 0.5 - HOLD
    forth = (time - HOLD) / way
    back = (time - HOLD - way - HOLD) / way
    share = np.clip(forth, 0, 1) - np.clip(back, 0, 1)
    return float(0.5 - 0.5 * np.cos(np.pi * share))


def refined_at(time: float) -> float:
    """Return the share of a refinement that is seen at a `time` in [0, 1) of a morph.

    It was made for the edit alone, so that it comes and goes while that is still.
    """
    since, left = time - 0.5, 0.5 + HOLD - time  # of the time in which the edit is still
    return float(np.clip(min(since, left) / (0.3 * HOLD), 0, 1))


def _yaw_at(time: float, motion: str) -> float:
    """Degrees."""
    return 360 * time if motion == "turn" else SWAY * float(np.sin(2 * np.pi * time))


class _Film:
    """A document at other moments."""

    def __init__(self, document: Document, stations: Sequence[Document]) -> None:
        self._document, self._stations = document, stations
        camera = document.photo.camera
        self.puppets: dict[int, Puppet] = {
            k: puppet_of(item, camera)
            for k, item in enumerate(document.objects)
            if item.lifted is not None
        }
        self._last: dict[int, Pose] = {}  # of each object, to go on from
        self._ways: dict[
            int, tuple[Pose | None, Pose | None, PoseInterpolation]
        ] = {}  # the last of each
        self._bodies: dict[int, F64] = {}  # see `_standing`

    def drawn(self, document: Document) -> U8:
        """The composite of the document at some moment."""
        result = composite(document, self.puppets)
        pixels = to_u8(result.pixels)
        return pixels if result.alpha is None else np.dstack([pixels, to_u8(result.alpha)])

    def morph(self, time: float) -> U8:
        """The picture at a `time` in [0, 1) of the way from the photo to the edit and back.

        Objects move; what else the edit changes is faded in: their look, shadows old and new, and
        what was repaired by hand.
        """
        share = share_at(time)
        if share >= 1:
            return self.drawn(self._refined(refined_at(time)))
        moved = self._morphed(share)
        objects = tuple(map(_as_in_the_photo, moved.objects))
        plain = replace(moved, objects=objects, plate=_with_old_shadows(moved))
        is_alike = all(a is b for a, b in zip(objects, moved.objects, strict=True))
        if (is_alike and plain.plate is moved.plate) or share <= 0:
            return self.drawn(plain)
        return _faded(self.drawn(plain), self.drawn(moved), share)

    def _refined(self, share: float) -> Document:
        """The document with so much of its refinement."""
        document = self._document
        if document.refined is None or share >= 1:
            return document
        seen = replace(document.refined, strength=share * document.refined.strength)
        return replace(document, refined=seen if share > 0 else None)

    def _morphed(self, share: float) -> Document:
        """The document when its objects have gone a `share` of their way, not refined.

        One of another photo is where it is: its way here began in no place of this one.
        """
        objects = tuple(
            self._between(k, _at_rest(item), item, share)
            if item.is_moved and not item.is_visitor else item
            for k, item in enumerate(self._document.objects)
        )  # fmt: skip
        return replace(self._document, objects=objects, refined=None)

    def keyed(self, time: float) -> Document:
        """The document at a `time` in [0, 1) of the way through its key poses and back.

        Without a refinement, which is of one pose.
        """
        station, share = station_at(time, len(self._stations))
        start = self._stations[station].objects
        end = self._stations[(station + 1) % len(self._stations)].objects
        objects = tuple(
            self._between(k, *pair, share) if k in self.puppets else pair[0]
            for k, pair in enumerate(zip(start, end, strict=True))
        )
        return replace(self._document, objects=objects, refined=None)

    def turned(self, k: int, yaw: float) -> Document:
        """The document with object `k` turned where it stands, about its own upright, degrees."""
        item, lifted = self._document.objects[k], self.puppets[k].lifted
        gimbal = gimbal_of(item, self._document)
        old = gimbal.of(item.placement.turn)
        turn = gimbal.turn((old[0] + yaw, old[1], old[2]))
        camera, placement = self._document.photo.camera, replace(item.placement, turn=turn)
        try:
            standing = self._standing(k), lifted, camera, gimbal.down
            on_its_foot = turned_about(item.placement, turn, *standing)
            on_its_foot.matrix(lifted, camera)
            placement = on_its_foot
        except ValueError:  # behind the camera: then about its middle
            pass
        turned = replace(item, placement=placement, is_visible=True)
        return replace(self._document.with_object(k, turned), refined=None)

    def _standing(self, k: int) -> F64:
        """(N, 3) world, before its placement: the solid Gaussians of object `k`, as it is bent."""
        if k not in self._bodies:
            item, lifted = self._document.objects[k], self.puppets[k].lifted
            points = lifted.body.means.astype(np.float64)
            if item.pose is not None:
                points = self.puppets[k].deformer.skin_points(points, item.pose).points
            self._bodies[k] = lifted.world_points(points)
        return self._bodies[k]

    def _between(self, k: int, start: EditObject, end: EditObject, share: float) -> EditObject:
        """Object `k` when a `share` of the way from one of its states to another is done."""
        placement = blended(start.placement, end.placement, share, end, self._document)
        if share <= 0 or (start.pose is None and end.pose is None):
            return replace(end, pose=start.pose, placement=placement)
        if share >= 1:
            return end
        pose = self._solved(k, start, end, share) or self._mixed(k, start.pose, end.pose, share)
        return replace(end, pose=pose, placement=placement)

    def _mixed(self, k: int, start: Pose | None, end: Pose | None, share: float) -> Pose:
        """Between two poses that no handles hold, or not the same ones; None is rest."""
        known = self._ways.get(k)
        if known is None or known[0] is not start or known[1] is not end:
            deformer = self.puppets[k].deformer
            rest = deformer.rest()
            known = start, end, PoseInterpolation(deformer, start or rest, end or rest)
            self._ways[k] = known
        return known[2].at(share)

    def _solved(self, k: int, start: EditObject, end: EditObject, share: float) -> Pose | None:
        """The pose that the handles give; None where it is not they alone that make both."""
        shifts = _summed(start.rig.shifts, end.rig.shifts, share)
        if (
            not _begin_alike(start.base, end.base)
            or not _alike(start.handles, end.handles)
            or (not end.handles and (shifts is None or end.base.pose is not None))
        ):
            return None
        deformer = self.puppets[k].deformer
        if shifts is not None:
            deformer = deformer.with_rig(replace(end.rig, shifts=shifts))
        handles = tuple(
            replace(b, target=a.target + share * (b.target - a.target),
                    turn=_summed(*_turns(a, b, start.pose, end.pose), share))
            for a, b in zip(start.handles, end.handles, strict=True)
        )  # fmt: skip
        solved = deformer.solve(handles, end.footing, self._last.get(k), tolerance=TOLERANCE)
        self._last[k] = solved.pose
        return solved.pose


def _faded(before: U8, after: U8, share: float) -> U8:
    """A `share` of the way from one picture (h, w, 3 or 4) to another one."""
    one, two = before.astype(np.float32), after.astype(np.float32)
    if before.shape[2] == 4:  # what is clear has no colour
        for straight in (one, two):
            straight[..., :3] *= straight[..., 3:] / 255
    mixed = one + share * (two - one)
    if before.shape[2] == 4:
        mixed[..., :3] *= 255 / np.maximum(mixed[..., 3:], 1e-3)
    return np.rint(mixed.clip(0, 255)).astype(np.uint8)


def _at_rest(item: EditObject) -> EditObject:
    """The object as it is in the photo, its handles where they take hold."""
    handles = tuple(replace(handle, target=handle.point, turn=None) for handle in item.handles)
    rig, base = replace(item.rig, shifts=None), item.base.at_rest
    return replace(
        item, handles=handles, rig=rig, base=base, pose=None, placement=Placement()
    )  # fmt: skip


def _as_in_the_photo(item: EditObject) -> EditObject:
    """The object where it is, looking as in the photo; one of another photo is not there."""
    if item.is_visitor:
        return replace(item, lifted=None, is_visible=False)
    is_changed = item.finish != AS_IN_THE_PHOTO or item.is_painted or item.shadow.strength > 0
    if item.lifted is None or (item.is_visible and not is_changed):
        return item
    matte = None if item.matte is None else replace(item.matte, paint=None)
    return replace(
        item, matte=matte, is_visible=True, finish=AS_IN_THE_PHOTO,
        shadow=replace(item.shadow, strength=0.0),
    )  # fmt: skip


def _with_old_shadows(document: Document) -> Plate | None:
    """The plate where objects hide it; elsewhere the photo, with what was repaired there."""
    plate = document.plate
    if plate is None or plate.painted is None:
        return plate
    is_bare = plate.painted.copy()
    for item in document.objects:
        if (matte := item.matte_here) is not None:
            is_bare &= crop(matte.alpha, matte.box, plate.box) <= 0
    x0, y0, x1, y1 = plate.box
    own = document.photo.pixels[y0:y1, x0:x1]
    pixels = np.where(is_bare[..., None], own, plate.pixels)
    return replace(plate, pixels=pixels, hole=plate.hole & ~is_bare, painted=None)


def _alike(start: Sequence[Handle], end: Sequence[Handle]) -> bool:
    """Whether both take hold of the same points in the same way."""
    return len(start) == len(end) and all(
        a.is_pin == b.is_pin and np.allclose(a.point, b.point)
        for a, b in zip(start, end, strict=True)
    )


def _begin_alike(start: Base, end: Base) -> bool:
    """Whether the handles move the object from the same pose in both."""
    if start.pose is None or end.pose is None:
        return start.pose is end.pose
    return same_values(start, end)


def _turns(
    start: Handle, end: Handle, before: Pose | None, after: Pose | None
) -> tuple[F64 | None, F64 | None]:
    """The turns of a handle in two poses; where one is free, it is as the pose has it there."""
    one, other = start.turn, end.turn
    if one is None and other is not None and before is not None:
        one = vector_from_matrix(before.rotations[start.control_point], other)
    elif other is None and one is not None and after is not None:
        other = vector_from_matrix(after.rotations[end.control_point], one)
    return one, other


def _summed(start: Any, end: Any, share: float) -> Any:
    """(1 - share) start + share end, where None is zero; None where both are."""
    if start is None:
        return None if end is None else share * end
    return (1 - share) * start if end is None else start + share * (end - start)
