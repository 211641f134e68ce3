"""The grips of the whole object as the photo's own camera sees them; canvas px.

Three rings turn it about the axes of its gimbal, R = Rz(roll) R(pitch) R(yaw): the one for yaw,
about what is upright in the photo as far as that is known, is carried by pitch and roll, the one
for pitch by roll. Each lies in the plane across its axis, around the object's centre. A point of
it that is dragged along it by an angle turns the object by that angle, and changes one number.

The arrow is parallel to the ray to the object's centre. The picture of such a line runs towards
the picture of the centre: a point at depth z is seen f r / z px from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from objectmorpher_core.base.arrays import F32, F64, Mask
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.rotations import Gimbal

from ..canvas.memo import Memo

if TYPE_CHECKING:
    from ..editor.editor import Editor
    from ..editor.state import EditorState

INSET = 16.0  # points between a corner and the canvas's edge, at least
SMALLEST_RING = 52.0  # points
OUTSIDE = 24.0  # points between a small object and its rings and corners, at least
LARGEST_RING = 0.34  # x the canvas's smaller side
AROUND = 0.52  # x the object's diameter, radius of the rings
OUTERMOST = 1.2  # x that, radius of the ring for roll
CLOSEST = 0.7  # x the centre's depth, radius of a ring at most
SAMPLES = 360  # of a ring
THIRDS = 45  # steps, each to two thirds: from a sample to a billionth of a degree
SPACE = 16.0  # points between the ring for roll and the arrow
ARROW = 52.0  # points, its length
TURNS = ("yaw", "pitch", "roll")


@dataclass(frozen=True, eq=False)
class Ring:
    """A circle in space, seen by `camera`, whose picture is the canvas."""

    centre: F64  # (3,) world
    first: F64  # (3,) world, from the centre to the point at angle 0
    second: F64  # (3,) world, to that at a right angle to it
    camera: Camera
    has_back: bool = True  # its farther half counts as hidden

    def points(self, angles: np.ndarray) -> F64:
        """(N, 3) world, at angles (N,), radians."""
        across, along = np.cos(angles)[..., None], np.sin(angles)[..., None]
        return self.centre + across * self.first + along * self.second

    def seen(self, angles: np.ndarray) -> F64:
        """(N, 2) canvas px."""
        return self.camera.project(self.points(angles))

    @property
    def _arms(self) -> F64:
        """(N, 2) canvas px from its centre to points all along it."""
        angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        return self.seen(angles) - self.camera.project(self.centre)

    @property
    def openness(self) -> float:
        """Return how open a ring is seen: 1 as a circle, 0 as a line."""
        spread = np.linalg.svd(self._arms, compute_uv=False)
        return float(spread[1] / max(spread[0], 1e-12))

    @property
    def reach(self) -> float:
        """Px from its centre to its farthest point."""
        return float(np.linalg.norm(self._arms, axis=1).max())

    def speed(self, angle: float) -> float:
        """Px per radian at which a point of it is seen to move."""
        before, after = self.seen(angle + np.array([-0.01, 0.01]))
        return float(np.linalg.norm(after - before)) / 0.02

    def angle_at(self, xy: np.ndarray) -> float:
        """The angle about its centre, in its plane, of what is seen at canvas px (2,)."""
        ray = self.camera.unproject(xy, 1.0)
        normal = np.cross(self.first, self.second)
        along = ray * (normal @ self.centre) / (normal @ ray) - self.centre
        return float(np.arctan2(along @ self.second, along @ self.first))

    def is_front(self, angles: np.ndarray) -> Mask:
        """(N,) whether that part of it is nearer than the centre."""
        if not self.has_back:
            return np.ones(len(angles), bool)
        away = (self.points(angles) - self.centre) @ self.centre
        return np.asarray(away <= 1e-9 * np.linalg.norm(self.centre) ** 2)

    def gap(self, xy: np.ndarray) -> float:
        """Return the distance of canvas px (2,) from its front, finer than the samples' spacing."""
        return float(self._front_gaps(xy)[1].min())

    def nearest(self, xy: np.ndarray) -> float:
        """The angle of its front that is seen nearest to canvas px (2,)."""
        angles, gaps = self._front_gaps(xy)
        return self._refined(float(angles[gaps.argmin()]), xy)

    def _front_gaps(self, xy: np.ndarray) -> tuple[F64, F64]:
        """Angles all around, and how far each is seen from canvas px (2,); the back is endless."""
        angles = np.linspace(0, 2 * np.pi, SAMPLES, endpoint=False)
        return angles, np.where(self.is_front(angles), self._gaps(angles, xy), np.inf)

    def followed(self, xy: np.ndarray, angle: float) -> float:
        """The angle at which it is nearest to canvas px (2,), going along it from `angle`."""
        step = 2 * np.pi / SAMPLES
        here, before, after = self._gaps(angle + np.array([0, -step, step]), xy)
        if min(before, after) < here:
            way = step if after < before else -step
            ahead = self._gaps(angle + way * np.arange(SAMPLES + 1), xy)
            rises = np.flatnonzero(np.diff(ahead) >= 0)
            angle += way * float(rises[0] if len(rises) else SAMPLES)
        return self._refined(angle, xy)

    def _gaps(self, angles: np.ndarray, xy: np.ndarray) -> F64:
        return np.linalg.norm(self.seen(angles) - xy, axis=-1)

    def _refined(self, angle: float, xy: np.ndarray) -> float:
        """The minimum within a sample beside `angle`: thirds, until nothing is left between."""
        low, high = angle - 2 * np.pi / SAMPLES, angle + 2 * np.pi / SAMPLES
        for _ in range(THIRDS):
            thirds = np.array([low + (high - low) / 3, high - (high - low) / 3])
            a, b = self._gaps(thirds, xy)
            low, high = (low, thirds[1]) if a < b else (thirds[0], high)
        return float(low + high) / 2


@dataclass(frozen=True, eq=False)
class Arrow:
    """It points away from the camera, towards the object's centre in the picture."""

    centre: F64  # (2,) canvas px
    side: float  # 1: it is below the centre, -1: above
    near: float  # px from the centre
    far: float

    def along(self, xy: np.ndarray) -> float:
        """Px from the centre at which the arrow is nearest to canvas px (2,)."""
        return float((xy - self.centre)[1]) * self.side

    def at(self, distance: float) -> F64:
        """(2,) canvas px, `distance` px from the centre."""
        return self.centre + np.array([0.0, self.side * distance])

    def gap(self, xy: np.ndarray) -> float:
        """Px from canvas px (2,) to it."""
        nearest = self.at(float(np.clip(self.along(xy), self.far, self.near)))
        return float(np.linalg.norm(xy - nearest))


@dataclass(frozen=True, eq=False)
class Gizmo:
    """All grips of an object. They stay within reach, however large the object."""

    corners: F64  # (4, 2) left top, right top, right bottom, left bottom
    centre: F64  # (2,)
    radius: float  # px, of the outer ring: a circle
    hole: float  # px, radius around the centre that a small object has for itself; or 0
    rings: dict[str, Ring]  # by the turn that each changes
    arrow: Arrow
    horizon: float | None  # its row, while the object is to stand on the ground


def gizmo(editor: Editor) -> Gizmo | None:
    """The current object's, or None where nothing is lifted."""
    frame, view, thing = editor.placing.frame(), editor.view, editor.object
    if frame is None or thing is None or thing.lifted is None or editor.document is None:
        return None
    size, inset = np.array([view.width, view.height]), INSET * view.scale
    corners = _kept_off(view.canvas_from_image(frame.corners), OUTSIDE * view.scale)
    corners = corners.clip(inset, np.maximum(size - inset, inset))
    camera = view.camera(editor.document.photo.camera)
    middle = editor.placing.centre()
    centre, zoom = camera.project(middle), camera.focal / middle[2]
    reach = thing.lifted.diameter * thing.lifted.scale * thing.placement.scale * zoom
    outside = OUTSIDE * view.scale
    radius = max(AROUND * reach, 0.5 * reach + outside)
    hole = 0.5 * (reach + outside) if radius < LARGEST_RING * float(size.min()) / 2 else 0.0
    smallest, largest = SMALLEST_RING * view.scale, LARGEST_RING * float(size.min())
    radius = float(np.clip(radius, smallest, max(largest, smallest)))
    world = min(radius / zoom, CLOSEST * float(middle[2]) / OUTERMOST)
    far = OUTERMOST * world * zoom + SPACE * view.scale
    near = far + ARROW * view.scale
    side = 1.0 if centre[1] + near < view.height else -1.0
    is_asked = thing.is_grounded and editor.placing.needs_horizon
    row = editor.placing.horizon if is_asked else None
    return Gizmo(
        corners,
        centre,
        OUTERMOST * world * zoom,
        hole,
        rings(middle, editor.placing.gimbal, editor.placing.angles, world, camera),
        Arrow(centre, side, near, far),
        None if row is None else float(view.canvas_from_image(np.array([0.0, row]))[1]),
    )


def _kept_off(corners: F64, least: float) -> F64:
    """Corners (4, 2) of a box, which is as wide and as high as twice `least` px."""
    middle = corners.mean(0)
    arms = corners - middle
    half = np.abs(arms).max(0)
    return middle + arms * np.maximum(least / np.maximum(half, 1e-6), 1.0)


def rings(
    centre: np.ndarray,
    gimbal: Gimbal,
    angles: tuple[float, float, float],
    radius: float,
    camera: Camera,
) -> dict[str, Ring]:
    """The rings around `centre` (3,) at angles; `radius` world units, of the inner two."""
    _, pitch, roll = angles
    tilted, rolled, outer = gimbal.carried(pitch, roll), gimbal.carried(0, roll), OUTERMOST * radius
    x, y, z = np.eye(3)
    across, away = gimbal.right, np.cross(gimbal.right, gimbal.down)
    return {
        # Each pair, in this order, turns about its axis by the right hand: z x about y, y z about x
        "yaw": Ring(centre, radius * tilted @ away, radius * tilted @ across, camera),
        "pitch": Ring(centre, radius * rolled @ np.cross(z, across), radius * rolled @ z, camera),
        "roll": Ring(centre, outer * x, outer * y, camera, has_back=False),
    }


# The outline that an object had before the stroke in progress, to compare with.

CELLS = 160.0  # along the longer side of the grid on which the outline is followed
GAP = 2.0  # cells between points that are of one silhouette

_outlines = Memo(1)


def ghost(editor: EditorState) -> tuple[F32, ...]:
    """Outlines, (N, 2) image px each, of the current object where it was; none if it is there."""
    before, now, k = editor.committed, editor.preview, editor.current
    if before is None or now is None or k >= len(before.objects):
        return ()
    was, item = before.objects[k], now.objects[k]
    if was.lifted is None or was.placement == item.placement:
        return ()
    splats = editor.derived.posed(before, k)
    is_solid = splats.rest.lifted.texture.solidity > 0.5
    camera = before.photo.camera

    def build() -> tuple[F32, ...]:
        means = splats.means[is_solid if is_solid.any() else slice(None)]
        places = camera.project(means[means[:, 2] > 0])
        is_seen = ((places >= 0) & (places <= before.photo.size)).all(1)
        return _silhouette(places[is_seen])

    return _outlines(build, splats)


def _silhouette(places: np.ndarray) -> tuple[F32, ...]:
    """The outlines of points (N, 2) image px that lie close."""
    if len(places) == 0:
        return ()
    low = places.min(0)
    cell = max(float(np.ptp(places, axis=0).max()) / CELLS, 1e-6)
    margin = int(2 * GAP) + 1
    at = np.round((places - low) / cell).astype(int) + margin
    grid = np.zeros((at[:, 1].max() + margin + 1, at[:, 0].max() + margin + 1), np.uint8)
    grid[at[:, 1], at[:, 0]] = 255
    side = int(2 * GAP) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    filled = cv2.morphologyEx(grid, cv2.MORPH_CLOSE, kernel)
    found = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    lines = [((line[:, 0] - margin) * cell + low).astype(np.float32) for line in found]
    return tuple(line for line in lines if len(line) > side * 3)
