"""An edit as moving pictures: how it came about, the object turning, or its key poses in turn.

Each frame is the composite of a document, as an export is. Between two poses the handles go their
way and the object is solved anew, so that it bends as it would under the hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import RGB
from ..base.progress import Progress, silent
from ..base.rotations import matrix_from_vector, vector_from_matrix
from ..compose.composite import composite
from ..deform.puppet import Puppet, puppet_of
from ..document.key_edits import at_key, count_keys
from ..document.model import Document, EditObject, Handle, Placement, Pose
from ..document.shrink import shrunk
from ..pictures.image import to_u8

MOTIONS = ("morph", "sway", "turn", "keys")
SWAY = 30.0  # degrees to both sides
HOLD = 0.15  # x the length of a morph, for which photo and edit are each shown at rest
LONGEST = 1280  # px, longer side of a frame
MOST_FRAMES = 3000
TOLERANCE = 1e-3  # of a solve between two frames


@dataclass(frozen=True)
class Clip:
    """The subject and the length of a video."""

    motion: str = "morph"  # photo, edit and back; the object sways; turns; through key poses
    seconds: float = 4.0
    rate: float = 25.0  # frames a second
    object: int = 0  # index of the one that sways or turns
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


def frames(document: Document, clip: Clip, progress: Progress = silent) -> Iterator[RGB]:
    """The clip's pictures (h, w, 3), all of one size, even in width and height.

    Played again and again the clip has no jump. Raises ValueError where nothing moves.
    """
    times = max(-(-max(document.photo.size) // clip.longest), 1)
    keys: list[Document] = []
    if clip.motion == "keys":
        keys = [shrunk(at_key(document, n), times) for n in range(count_keys(document))]
        if len(keys) < 2:
            raise ValueError("a video through key poses needs at least two")
    small = shrunk(document, times)
    if clip.motion == "morph" and not any(item.is_moved for item in small.objects):
        raise ValueError("nothing was moved, there is nothing to be seen")
    chosen = small.objects[clip.object].lifted if clip.object < len(small.objects) else None
    if clip.motion in ("sway", "turn") and chosen is None:
        raise ValueError("lift an object first, then it can turn")
    film = _Film(small, keys)
    for k in range(clip.count):
        progress(k / clip.count, "drawing")
        if clip.motion == "morph":
            shown = film.morphed(share_at(k / clip.count))
        elif clip.motion == "keys":
            shown = film.keyed(k / clip.count)
        else:
            shown = film.turned(clip.object, _yaw_at(k / clip.count, clip.motion))
        pixels = to_u8(composite(shown, film.puppets).pixels)
        height, width = (side - side % 2 for side in pixels.shape[:2])
        yield np.ascontiguousarray(pixels[:height, :width])


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

    def morphed(self, share: float) -> Document:
        """The document when a `share` of the edit is done."""
        if share >= 1:
            return self._document
        objects = tuple(
            self._between(k, _at_rest(item), item, share)
            if item.is_moved and item.is_visible
            else item
            for k, item in enumerate(self._document.objects)
        )
        return replace(self._document, objects=objects)

    def keyed(self, time: float) -> Document:
        """The document at a `time` in [0, 1) of the way through its key poses and back."""
        station, share = station_at(time, len(self._stations))
        start = self._stations[station].objects
        end = self._stations[(station + 1) % len(self._stations)].objects
        objects = tuple(
            self._between(k, *pair, share) if k in self.puppets else pair[0]
            for k, pair in enumerate(zip(start, end, strict=True))
        )
        return replace(self._document, objects=objects)

    def turned(self, k: int, yaw: float) -> Document:
        """The document with object `k` turned about its own upright axis, degrees."""
        item = self._document.objects[k]
        old = item.placement.turn
        placement = replace(item.placement, turn=(old[0] + yaw, old[1], old[2]))
        return self._document.with_object(k, replace(item, placement=placement, is_visible=True))

    def _between(self, k: int, start: EditObject, end: EditObject, share: float) -> EditObject:
        """Object `k` when a `share` of the way from one of its states to another is done."""
        placement = _blended(start.placement, end.placement, share)
        if share <= 0 or (start.pose is None and end.pose is None):
            return replace(end, pose=start.pose, placement=placement)
        if share >= 1:
            return end
        pose = self._solved(k, start, end, share)
        pose = pose or _mixed(self.puppets[k], start.pose, end.pose, share)
        return replace(end, pose=pose, placement=placement)

    def _solved(self, k: int, start: EditObject, end: EditObject, share: float) -> Pose | None:
        """The pose that the handles give; None where it is not they alone that make both."""
        shifts = _summed(start.rig.shifts, end.rig.shifts, share)
        has_base = start.base.pose is not None or end.base.pose is not None
        if (
            has_base
            or not _alike(start.handles, end.handles)
            or (not end.handles and shifts is None)
        ):
            return None
        deformer = self.puppets[k].deformer
        if shifts is not None:
            deformer = deformer.with_rig(replace(end.rig, shifts=shifts))
        handles = tuple(
            replace(b, target=a.target + share * (b.target - a.target),
                    turn=_summed(a.turn, b.turn, share))
            for a, b in zip(start.handles, end.handles, strict=True)
        )  # fmt: skip
        solved = deformer.solve(handles, end.footing, self._last.get(k), tolerance=TOLERANCE)
        self._last[k] = solved.pose
        return solved.pose


def _at_rest(item: EditObject) -> EditObject:
    """The object as it is in the photo, its handles where they take hold."""
    handles = tuple(replace(handle, target=handle.point, turn=None) for handle in item.handles)
    rig = replace(item.rig, shifts=None)
    return replace(item, handles=handles, rig=rig, pose=None, placement=Placement())


def _alike(start: Sequence[Handle], end: Sequence[Handle]) -> bool:
    """Whether both take hold of the same points in the same way."""
    return len(start) == len(end) and all(
        a.is_pin == b.is_pin and np.allclose(a.point, b.point)
        for a, b in zip(start, end, strict=True)
    )


def _summed(start: Any, end: Any, share: float) -> Any:
    """(1 - share) start + share end, where None is zero; None where both are."""
    if start is None:
        return None if end is None else share * end
    return (1 - share) * start if end is None else start + share * (end - start)


def _blended(start: Placement, end: Placement, share: float) -> Placement:
    def mean(a: float, b: float) -> float:
        return a + share * (b - a)

    (x0, y0), (x1, y1) = start.move, end.move
    yaw, pitch, roll = map(mean, start.turn, end.turn)
    scale = start.scale ** (1 - share) * end.scale**share
    return Placement((mean(x0, x1), mean(y0, y1)), mean(start.depth, end.depth),
                     (yaw, pitch, roll), scale)  # fmt: skip


def _mixed(puppet: Puppet, start: Pose | None, end: Pose | None, share: float) -> Pose:
    """Between two poses that no handles hold, or not the same ones; None is rest."""
    rest = puppet.deformer.rest()
    start, end = start or rest, end or rest
    turns = [
        a @ matrix_from_vector(share * vector_from_matrix(a.T @ b))
        for a, b in zip(start.rotations, end.rotations, strict=True)
    ]
    return Pose(start.points + share * (end.points - start.points), np.array(turns))
