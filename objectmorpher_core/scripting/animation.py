"""An edit as moving pictures: how it came about, or the object turning.

Each frame is the composite of a document, as an export is. Between the photo and the edit the
handles go their way and the object is solved anew, so that it bends as it would under the hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import RGB
from ..base.progress import Progress, silent
from ..base.rotations import matrix_from_vector, vector_from_matrix
from ..compose.composite import composite
from ..deform.puppet import Puppet, puppet_of
from ..document.model import Document, EditObject, Handle, Placement, Pose
from ..document.shrink import shrunk
from ..pictures.image import to_u8

MOTIONS = ("morph", "sway", "turn")
SWAY = 30.0  # degrees to both sides
HOLD = 0.15  # x the length of a morph, for which photo and edit are each shown at rest
LONGEST = 1280  # px, longer side of a frame
MOST_FRAMES = 3000
TOLERANCE = 1e-3  # of a solve between two frames


@dataclass(frozen=True)
class Clip:
    """What is to be seen, and for how long."""

    motion: str = "morph"  # from the photo to the edit and back; or the object sways; or turns
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

    Played again and again it has no jump. Raises ValueError where nothing moves.
    """
    small = shrunk(document, max(-(-max(document.photo.size) // clip.longest), 1))
    if clip.motion == "morph" and not any(item.is_moved for item in small.objects):
        raise ValueError("nothing was moved, there is nothing to be seen")
    chosen = small.objects[clip.object].lifted if clip.object < len(small.objects) else None
    if clip.motion != "morph" and chosen is None:
        raise ValueError("lift an object first, then it can turn")
    film = _Film(small)
    for k in range(clip.count):
        progress(k / clip.count, "drawing")
        if clip.motion == "morph":
            shown = film.morphed(share_at(k / clip.count))
        else:
            shown = film.turned(clip.object, _yaw_at(k / clip.count, clip.motion))
        pixels = to_u8(composite(shown, film.puppets).pixels)
        height, width = (side - side % 2 for side in pixels.shape[:2])
        yield np.ascontiguousarray(pixels[:height, :width])


def share_at(time: float) -> float:
    """How far the edit has come at a `time` in [0, 1) of a morph: still, on, still, and back."""
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

    def __init__(self, document: Document) -> None:
        self._document = document
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
            self._on_the_way(k, item, share) if item.is_moved and item.is_visible else item
            for k, item in enumerate(self._document.objects)
        )
        return replace(self._document, objects=objects)

    def turned(self, k: int, yaw: float) -> Document:
        """The document with object `k` turned about its own upright axis, degrees."""
        item = self._document.objects[k]
        old = item.placement.turn
        placement = replace(item.placement, turn=(old[0] + yaw, old[1], old[2]))
        return self._document.with_object(k, replace(item, placement=placement, is_visible=True))

    def _on_the_way(self, k: int, item: EditObject, share: float) -> EditObject:
        placement = _partly(item.placement, share)
        if item.pose is None or share <= 0:
            return replace(item, pose=None, placement=placement)
        pose = self._solved(k, item, share) or _mixed(self.puppets[k], item.pose, share)
        return replace(item, pose=pose, placement=placement)

    def _solved(self, k: int, item: EditObject, share: float) -> Pose | None:
        """The pose that the handles give; None where it is not they alone that made it."""
        shifts = item.rig.shifts
        if item.base.pose is not None or (not item.handles and shifts is None):
            return None
        deformer = self.puppets[k].deformer
        if shifts is not None:
            deformer = deformer.with_rig(replace(item.rig, shifts=share * shifts))
        handles = tuple(_handle(handle, share) for handle in item.handles)
        solved = deformer.solve(handles, item.footing, self._last.get(k), tolerance=TOLERANCE)
        self._last[k] = solved.pose
        return solved.pose


def _handle(handle: Handle, share: float) -> Handle:
    target = handle.point + share * (handle.target - handle.point)
    turn = None if handle.turn is None else share * handle.turn
    return replace(handle, target=target, turn=turn)


def _partly(placement: Placement, share: float) -> Placement:
    x, y = placement.move
    yaw, pitch, roll = placement.turn
    return Placement(
        (share * x, share * y), share * placement.depth,
        (share * yaw, share * pitch, share * roll), placement.scale**share,
    )  # fmt: skip


def _mixed(puppet: Puppet, pose: Pose, share: float) -> Pose:
    """Between rest and a pose that no handle holds."""
    rest = puppet.deformer.rest()
    turns = [matrix_from_vector(share * vector_from_matrix(r)) for r in pose.rotations]
    return Pose(rest.points + share * (pose.points - rest.points), np.array(turns))
