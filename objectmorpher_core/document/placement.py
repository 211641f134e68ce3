"""The place of an object's centre, and the placement that takes it to another.

A placement turns and scales an object about its centre, and puts the centre somewhere. As long as
turn and scale stay, every point of the object keeps its offset from the centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from weakref import WeakKeyDictionary

import numpy as np

from ..base.arrays import F64
from ..base.camera import Camera
from ..base.rotations import (
    CAMERA_GIMBAL,
    Gimbal,
    matrix_from_vector,
    turn_matrix,
    turn_of,
    vector_from_matrix,
)
from .model import Document, EditObject, LiftedObject, Placement

NEAREST = 0.02  # x its depth: an object that is held comes no nearer
SKEW = 1e-3  # of a rotation that was rounded on its way

Angles = tuple[float, float, float]


def centre_of(placement: Placement, lifted: LiftedObject, camera: Camera) -> F64:
    """(3,) world: where the object's centre is. Raises ValueError behind the camera."""
    motion = placement.matrix(lifted, camera)
    return motion[:3, :3] @ lifted.centre + motion[:3, 3]


def with_centre(
    placement: Placement, centre: np.ndarray, lifted: LiftedObject, camera: Camera
) -> Placement:
    """Return the same turn and scale with the object's centre at `centre` (3,), world."""
    move = camera.project(np.asarray(centre)) - camera.project(lifted.centre)
    depth = (centre[2] - lifted.centre[2]) / (lifted.diameter * lifted.scale)
    return replace(placement, move=(float(move[0]), float(move[1])), depth=float(depth))


def placement_of(motion: np.ndarray, lifted: LiftedObject, camera: Camera) -> Placement:
    """Return the placement whose `matrix` is `motion` (4, 4), world from world.

    Raises ValueError for what is no turn with one positive scale and a move, and where the centre
    would be behind the camera.
    """
    if not np.isfinite(motion).all():
        raise ValueError("it is not finite")
    linear = np.asarray(motion, np.float64)[:3, :3]
    size = float(np.linalg.det(linear))
    if size <= 0:
        raise ValueError("it mirrors the object, or flattens it")
    scale = size ** (1 / 3)
    rotation = linear / scale
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > SKEW:
        raise ValueError("it stretches the object")
    centre = linear @ lifted.centre + motion[:3, 3]
    if centre[2] <= 0:
        raise ValueError("the object would be behind the camera")
    return with_centre(Placement(turn=turn_of(rotation), scale=scale), centre, lifted, camera)


def ground_normal(
    camera: Camera, horizon: float | None, seen_from: float | None, row: float
) -> F64 | None:
    """(3,) world, unit, down: of the ground on which an object stands that is seen at `row` px.

    `seen_from`: degrees above it, from which one is said to look; else the photo's `horizon` says,
    px of its row, where that is above the object. None: nothing is known.
    """
    if seen_from is not None:
        tilt = float(np.radians(seen_from) - np.arctan2(row - camera.cy, camera.focal))
    elif horizon is not None and row > horizon:
        tilt = float(np.arctan2(camera.cy - horizon, camera.focal))
    else:
        return None
    return np.array([0.0, np.cos(tilt), np.sin(tilt)])


def down_at(
    lifted: LiftedObject, camera: Camera, horizon: float | None, seen_from: float | None = None
) -> F64 | None:
    """(3,) world, unit: what is down where an object stands at rest; None: nothing is known.

    What its shape says counts more than the horizon, and what the user says more than both.
    """
    if seen_from is None and lifted.up is not None:
        return -(lifted.world_from_object[:3, :3] @ np.array(lifted.up)) / lifted.scale
    row = float(camera.project(lifted.centre)[1])
    return ground_normal(camera, horizon, seen_from, row)


def down_of(item: EditObject, document: Document) -> F64 | None:
    """(3,) world, unit: what is down for a lifted object, whatever the horizon; None: not known.

    What says nothing itself stands as another object of the photo does.
    """
    assert item.lifted is not None, "only a lifted object stands"
    others = document.objects if item.lifted.origin is None else ()
    for own in (item, *others):
        if own.lifted is not None and (own is item or own.lifted.origin is None):
            down = down_at(own.lifted, document.photo.camera, None, own.seen_from)
            if down is not None:
                return down
    return None


def set_seen_from(document: Document, k: int, degrees: float | None) -> Document:
    """Say from how many degrees above one looks down on object `k`; None: as it is seen to stand.

    Raises ValueError outside 0 to 90.
    """
    if degrees is not None and not 0 <= degrees <= 90:
        raise ValueError(f"one looks down on a thing by 0 to 90 degrees, not by {degrees:g}")
    return document.with_object(k, replace(document.objects[k], seen_from=degrees))


def gimbal_of(item: EditObject, document: Document) -> Gimbal:
    """The axes about which an object is turned: about what is upright there, else the camera's."""
    if item.lifted is None:
        return CAMERA_GIMBAL
    down = down_of(item, document)
    if down is None:
        down = down_at(item.lifted, document.photo.camera, document.horizon)
    return CAMERA_GIMBAL if down is None else Gimbal.about(down)


SAME = 1e-12  # by which a cosine may differ from 1
STILL = 1e-3  # x the object's diameter: what moves by less stays
FOOT = 0.04  # x the object's height, from its lowest point: what touches the ground
# deg by which a thing may lean out over what touches the ground: of the things that stand in 16
# photos 14 do by 6 at most, the two that were found to lie on one side of them by 34 and more
LEAN = 15.0
SHALLOW = 0.75  # x the diagonal of what it covers: a bowl is less high; a desk lamp may lean out


def turned(
    placement: Placement,
    turn: tuple[float, float, float],
    points: np.ndarray,
    lifted: LiftedObject,
    camera: Camera,
    down: np.ndarray,
) -> Placement:
    """`placement` with another `turn`, degrees, about what an artist expects to stay.

    The foot of an object that stands stays where it touches, but for a roll alone. That, and
    everything else, turns about its centre. `points` (N, 3) world are the object's before the
    placement, `down` (3,) is the ground's normal. Raises ValueError behind the camera.
    """
    changed = replace(placement, turn=turn)
    both = turn_matrix(*turn) @ turn_matrix(*placement.turn).T
    if both[2, 2] > 1 - SAME:  # it turns about the line of sight
        return changed
    return _on_its_foot(placement, changed, points, lifted, camera, down)


def scaled(
    placement: Placement,
    scale: float,
    points: np.ndarray,
    lifted: LiftedObject,
    camera: Camera,
    down: np.ndarray,
) -> Placement:
    """`placement` with another `scale`, about the foot of what stands, else about the centre.

    The rest is as for `turned`.
    """
    changed = replace(placement, scale=scale)
    return _on_its_foot(placement, changed, points, lifted, camera, down)


def foot_of(
    placement: Placement, points: np.ndarray, lifted: LiftedObject, camera: Camera, down: np.ndarray
) -> F64:
    """(3,) world: what stays where it is while an object turns or grows. `turned` has the rest."""
    motion = placement.matrix(lifted, camera)
    return motion[:3, :3] @ _still(points, lifted, down) + motion[:3, 3]


def _on_its_foot(
    before: Placement,
    changed: Placement,
    points: np.ndarray,
    lifted: LiftedObject,
    camera: Camera,
    down: np.ndarray,
) -> Placement:
    """`changed`, moved so that the foot of what stands is where it was `before`."""
    if not lifted.stands:
        return changed
    foot, motion = _still(points, lifted, down), before.matrix(lifted, camera)
    stays = motion[:3, :3] @ foot + motion[:3, 3]
    offset = changed.matrix(lifted, camera)[:3, :3] @ (foot - lifted.centre)
    return with_centre(changed, stays - offset, lifted, camera)


def spun(placement: Placement, degrees: float, item: EditObject, document: Document) -> Placement:
    """`placement`, before which the object turns where it stands, about its own upright axis.

    A positive angle turns its front to the left. What stands keeps its foot where it is; what
    flies turns about its centre. Raises ValueError behind the camera.
    """
    assert item.lifted is not None, "only a lifted object can be turned"
    lifted, camera = item.lifted, document.photo.camera
    gimbal = gimbal_of(item, document)
    matrix = turn_matrix(*placement.turn) @ gimbal.matrix(degrees, 0.0, 0.0)
    points = lifted.world_points(lifted.body.means)
    return turned(placement, turn_of(matrix), points, lifted, camera, gimbal.down)


def grown(placement: Placement, scale: float, item: EditObject, document: Document) -> Placement:
    """`placement` with another `scale`, about the foot of what stands where it is, bent or not.

    What flies grows from its centre, as does what would pass behind the camera.
    """
    lifted, camera = item.lifted, document.photo.camera
    changed = replace(placement, scale=scale)
    if lifted is None or not lifted.stands or changed == placement:
        return changed
    points, down = lifted.world_points(lifted.body.means), gimbal_of(item, document).down
    try:
        standing = scaled(placement, scale, points, lifted, camera, down)
        standing.matrix(lifted, camera)
    except ValueError:
        return changed
    return standing


DETOUR = 1.5  # x the shortest turn: a way of the angles that is longer is none
ANGLES = 16  # of a way, to measure it


def blended(
    start: Placement, end: Placement, share: float, item: EditObject, document: Document
) -> Placement:
    """The placement when a `share` of the way from one to another is done.

    It turns the shorter way round. The foot of what stands goes straight, and stays if it is in
    the same place in both; all else goes by its centre.
    """
    assert item.lifted is not None, "only a lifted object is placed"
    gimbal = gimbal_of(item, document)
    x, y, depth = _mean((*start.move, start.depth), (*end.move, end.depth), share)
    turn = _turn_between(start.turn, end.turn, share, gimbal)
    scale = start.scale ** (1 - share) * end.scale**share
    placement = Placement((x, y), depth, turn, scale)
    lifted, camera = item.lifted, document.photo.camera
    if not _goes_by_its_foot(start, end, lifted, camera, gimbal.down):
        return placement
    foot = _foot(lifted, gimbal.down)
    ends = [m[:3, :3] @ foot + m[:3, 3] for m in (p.matrix(lifted, camera) for p in (start, end))]
    if min(point[2] for point in ends) <= 0:
        return placement
    there = np.array([[*camera.project(point), point[2]] for point in ends])
    *xy, away = there[0] + share * (there[1] - there[0])
    offset = scale * turn_matrix(*turn) @ (foot - lifted.centre)
    centre = camera.unproject(np.array(xy), float(away)) - offset
    return with_centre(placement, centre, lifted, camera) if centre[2] > 0 else placement


def _mean(start: Sequence[float], end: Sequence[float], share: float) -> list[float]:
    return [a + share * (b - a) for a, b in zip(start, end, strict=True)]


def _turn_between(start: Angles, end: Angles, share: float, gimbal: Gimbal) -> Angles:
    """A `share` of the way from one turn to another, degrees.

    By the gimbal's own angles, so that what stands keeps upright; by the shortest turn where those
    would take the object head over heels, which they do where they are cut to 180 degrees.
    """
    before = gimbal.of(start)
    after = [_near(b, a) for a, b in zip(before, gimbal.of(end), strict=True)]
    first = turn_matrix(*start)
    shortest = vector_from_matrix(turn_matrix(*end) @ first.T)
    most = DETOUR * float(np.degrees(np.linalg.norm(shortest))) + STILL
    yaw, pitch, roll = _mean(before, after, share)
    if np.abs(np.subtract(before, after)).sum() <= most:  # it is no longer than its three parts
        return gimbal.turn((yaw, pitch, roll))
    way = [gimbal.matrix(*_mean(before, after, k / ANGLES)) for k in range(ANGLES + 1)]
    steps = [np.linalg.norm(vector_from_matrix(b @ a.T)) for a, b in pairwise(way)]
    if np.degrees(np.sum(steps)) <= most:
        return gimbal.turn((yaw, pitch, roll))
    return turn_of(matrix_from_vector(share * shortest) @ first)


def _near(angle: float, other: float) -> float:
    """The same direction within 180 degrees of the `other` angle."""
    away = angle - other
    if abs(away) <= 180 + STILL:
        return angle
    return angle - 360 * round(away / 360)


def _goes_by_its_foot(
    start: Placement, end: Placement, lifted: LiftedObject, camera: Camera, down: np.ndarray
) -> bool:
    """Whether it was turned or scaled where it stands: about its upright, or with its foot still.

    What was turned about its centre alone is not.
    """
    if not lifted.stands or (start.turn, start.scale) == (end.turn, end.scale):
        return False
    if (start.move, start.depth) == (end.move, end.depth):
        return False
    motions = [place.matrix(lifted, camera) for place in (start, end)]
    turned = [turn_matrix(*place.turn) @ down for place in (start, end)]
    if np.linalg.norm(turned[1] - turned[0]) < STILL:
        return True
    foot = _foot(lifted, down)
    feet = [motion[:3, :3] @ foot + motion[:3, 3] for motion in motions]
    return bool(np.linalg.norm(feet[1] - feet[0]) < STILL * lifted.diameter * lifted.scale)


def is_in_place(item: EditObject, document: Document) -> bool:
    """Whether it is as large as in the photo, and its foot or centre is where it is there.

    It may be turned about either. A place that is computed from a matrix is off by rounding.
    """
    placement, lifted = item.placement, item.lifted
    if abs(placement.scale - 1) > STILL:
        return False
    if placement.move == (0, 0) and placement.depth == 0:
        return True
    if lifted is None:
        return False
    foot = _foot(lifted, gimbal_of(item, document).down)
    still = np.stack([foot, lifted.centre])
    motion = placement.matrix(lifted, document.photo.camera)
    off = np.linalg.norm(still @ motion[:3, :3].T + motion[:3, 3] - still, axis=1)
    return bool(off.min() < STILL * lifted.diameter * lifted.scale)


_FEET: WeakKeyDictionary[LiftedObject, tuple[np.ndarray, F64]] = WeakKeyDictionary()


def _foot(lifted: LiftedObject, down: np.ndarray) -> F64:
    """`_still` of an object that is not bent; it is asked for in each frame."""
    known = _FEET.get(lifted)
    if known is None or not np.array_equal(known[0], down):
        known = down, _still(lifted.world_points(lifted.body.means), lifted, down)
        _FEET[lifted] = known
    return known[1]


def _still(points: np.ndarray, lifted: LiftedObject, down: np.ndarray) -> F64:
    """(3,) world at rest: the middle of the lowest of the points (N, 3) of what stands, or the
    centre of all else.

    What would fall over there stands on more: its tilt is known to some degrees only, and of what
    is shallow one side of the rim may be found to be lowest. Then it is below the middle of it all.
    """
    if not lifted.stands:
        return lifted.centre
    depth = points @ down
    lowest = points[depth >= depth.max() - FOOT * np.ptp(depth)]
    foot = np.asarray(_middle(lowest), np.float64)
    if not _leans_out(points, lowest, foot, down):
        return foot
    middle = _middle(points - depth[:, None] * down)
    return np.asarray(middle + (depth.max() - middle @ down) * down, np.float64)


def _middle(points: np.ndarray) -> np.ndarray:
    return 0.5 * (points.min(0) + points.max(0))


def _leans_out(points: np.ndarray, lowest: np.ndarray, foot: F64, down: np.ndarray) -> bool:
    """Whether the mean of the points (N, 3) of what is shallow is far beyond the `lowest` (n, 3).

    `foot` (3,) is amid these.
    """
    to_mean = points.mean(0) - foot
    height = float(-to_mean @ down)
    aside = to_mean + height * down
    gap = float(np.linalg.norm(aside))
    if gap == 0:
        return False
    way, depth = aside / gap, points @ down
    is_shallow = np.ptp(depth) < SHALLOW * np.linalg.norm(np.ptp(points - depth[:, None] * down, 0))
    beyond = gap - float(((lowest - foot) @ way).max())
    return bool(is_shallow and beyond > np.tan(np.radians(LEAN)) * height)


@dataclass(frozen=True, eq=False)
class HeldPoint:
    """A placed object, held by one of its points."""

    placement: Placement
    lifted: LiftedObject
    camera: Camera
    point: F64  # (3,) world
    ground: Ground | None = None  # on which the point stays, whatever happens

    @property
    def unit(self) -> float:
        """World units of one of `away`."""
        return self.lifted.diameter * self.lifted.scale

    @property
    def xy(self) -> F64:
        """(2,) image px at which the point is seen before it is moved."""
        return np.asarray(self.camera.project(self.point), np.float64)

    def moved(self, delta: np.ndarray, away: float = 0.0) -> Placement:
        """The point is seen `delta` (2,) image px beside where it was.

        The object is `away` diameters farther; on the ground, farther than where the point is
        seen, in the same column.
        """
        offset = self.point - centre_of(self.placement, self.lifted, self.camera)
        if self.ground is None:
            nearest = NEAREST * self.point[2]
            depth = max(self.point[2] + away * self.unit, nearest, offset[2] + nearest)
            point = self.camera.unproject(self.xy + delta, depth)
        else:
            point = self.ground.seen_at(self.camera, self.xy + delta)
            if away != 0:
                x, depth = float((self.xy + delta)[0]), float(point[2]) + away * self.unit
                point = self.ground.at_depth(self.camera, x, depth)
        return with_centre(self.placement, point - offset, self.lifted, self.camera)


# The ground that an object stands on, from the row of the photo that the horizon is in.

FARTHEST = 40.0  # x the height of the camera: to which depth an object slides
NEAREST_GROUND = 0.02  # x the same: from which depth on
LEAST_BELOW = 1.0  # px of the photo, of the contact below the horizon


class GroundError(ValueError):
    """There is no such ground; one sentence."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A plane below the camera."""

    normal: F64  # (3,) world, unit, down
    height: float  # world units, of the camera above it; above 0

    def is_as(self, other: Ground) -> bool:
        """Whether both are the same plane."""
        return self.height == other.height and np.array_equal(self.normal, other.normal)

    def below(self, points: np.ndarray) -> F64:
        """(...) world units by which points (..., 3) are below the ground; negative above it."""
        return points @ self.normal - self.height

    def lowest(self, points: np.ndarray) -> F64:
        """(3,) the point of (N, 3) that is lowest."""
        return np.asarray(points[int((points @ self.normal).argmax())], np.float64)

    def seen_at(self, camera: Camera, xy: np.ndarray) -> F64:
        """(3,) the point of the ground that is seen at image px (2,).

        Above the horizon, and close below it, the farthest one of that column.
        """
        ray = camera.unproject(xy, 1.0)
        down = float(ray @ self.normal)
        most = FARTHEST * self.height
        if down * most < self.height:
            return self.at_depth(camera, float(xy[0]), most)
        return ray * max(self.height / down, NEAREST_GROUND * self.height)

    def at_depth(self, camera: Camera, x: float, depth: float) -> F64:
        """(3,) the point of the ground that is seen in column `x` px, `depth` along z."""
        depth = float(np.clip(depth, NEAREST_GROUND * self.height, FARTHEST * self.height))
        across = (x - camera.cx) / camera.focal * depth
        down = (self.height - self.normal[[0, 2]] @ [across, depth]) / self.normal[1]
        return np.array([across, down, depth])

    def stood(self, centre: np.ndarray, offsets: np.ndarray) -> F64:
        """(3,) `centre` moved up or down so that the lowest of centre + offsets (N, 3) stands."""
        sunk = float(np.max(offsets @ self.normal) + centre @ self.normal - self.height)
        return np.asarray(centre - sunk * self.normal, np.float64)


def ground_under(points: np.ndarray, camera: Camera, horizon: float) -> Ground:
    """The ground under world points (N, 3) of an object in the photo; `horizon` px.

    Raises GroundError where the object's lowest point is not below the horizon.
    """
    normal = np.array([0.0, camera.focal, camera.cy - horizon])
    normal /= np.linalg.norm(normal)
    depths = points @ normal  # (N,) world units, below the camera
    lowest = int(depths.argmax())
    height = float(depths[lowest])
    if camera.project(points[lowest])[1] - horizon < LEAST_BELOW or height <= 0:
        raise GroundError("the object's lowest point is above the horizon, so it cannot stand")
    return Ground(normal, height)
