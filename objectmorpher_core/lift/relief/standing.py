"""An object's stance on the ground: the way it is turned, and whether it is an upright prism."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...base.arrays import F64
from ...base.camera import Camera
from .silhouette import TOUCHING, ReliefSilhouette, lower_hull

# Upright prisms in a silhouette: boxes and cylinders that stand on the ground.
#
# Where the outline rises straight from both ends of its contact with the ground, the contact is the
# front of a box or a cylinder, and the plan of that front is known from a single photo. How far the
# sides lean together shows how far the camera looks down, for they are plumb.

SIDES = (0.2, 0.7)  # x height of the silhouette above its foot: where a prism's sides are seen
SIDE_ROWS = 25
STRAIGHT = 0.02  # x width on that side: how far a side may stray from its line
HANDLE_ROWS = 0.4  # share of the rows in which something may stick out of a side
ROUND_ROWS = 0.1  # share of those in which it may fall short: else it is round
MOST_LEAN = 0.25  # slope of a side in the photo
FOOT = 0.35  # x height of the silhouette: how far up the ends of a prism's contact may be
LEAST_CELLS = 12  # of its width
MOST_RAGGED = 0.1  # share of a contact that may stray from its hull
CORNER = 1.2  # cells from a side: the outline is that side
LEAST_FOLD = 0.03  # x width of the contact: deeper than that its middle is nearer than its ends
ROUND = 0.66  # of the box around a contact; a corner fills half of it, a half circle 0.79
MOST_NEARER = 0.5  # x width: half the depth of a prism
MOST_TURN = 1.2  # tangent of the angle between the object and the picture
LOOKING_DOWN = (0.03, 0.6)  # tangent of the camera's angle that leaning sides can tell
COLUMNS = 65  # places in which a round front is known


@dataclass(frozen=True, eq=False)
class Prism:
    """The front of an upright prism: how much nearer than its middle plane it is."""

    plan: GroundPlane
    turn: float  # of the middle plane, forward per across
    row: float  # px, to which columns refer
    columns: F64  # (n,) px, ascending
    nearer: F64  # (n,) inverse depth over that of the middle plane, >= 1
    is_round: bool  # a cylinder


@dataclass(frozen=True, eq=False)
class PrismSides:
    """The straight left and right side of a silhouette: x = start + lean (y - row), px."""

    row: float
    start: F64  # (2,)
    lean: F64  # (2,)

    @staticmethod
    def of(silhouette: ReliefSilhouette, middle: float, row: float) -> PrismSides | None:
        """Left and right of the column `middle`, about `row` px; None where they are no lines."""
        inside, cell = silhouette.inside, silhouette.cell
        heights = np.flatnonzero(inside.any(1))
        if np.ptp(heights) < SIDE_ROWS:
            return None
        rows = (heights[-1] - np.linspace(*SIDES, SIDE_ROWS) * np.ptp(heights)).astype(int)
        start = int((middle - silhouette.left) / cell)
        lines = []
        for side, beside in ((-1, inside[rows, start::-1]), (1, inside[rows, start:])):
            ends = start + side * (np.argmin(beside, axis=1) - 0.5)
            xy = silhouette.photo_xy(np.column_stack([ends, rows]))
            allowed = STRAIGHT * float(np.median(np.abs(xy[:, 0] - middle))) + cell
            x, lean = agreed_line(xy[:, 1] - row, xy[:, 0], allowed)
            stray = side * (xy[:, 0] - x - lean * (xy[:, 1] - row))
            if (stray > allowed).mean() > HANDLE_ROWS or (stray < -allowed).mean() > ROUND_ROWS:
                return None
            lines.append((x, lean))
        x, lean = np.array(lines).T
        return PrismSides(row, x, lean) if np.abs(lean).max() <= MOST_LEAN and x[1] > x[0] else None

    def at(self, y: F64) -> F64:
        """(2, n) columns px of both in the rows (n,) px."""
        return self.start[:, None] + self.lean[:, None] * (y - self.row)

    def horizon(self, camera: Camera) -> float | None:
        """Return the horizon, px: plumb lines meet at the nadir, a right angle away from it.

        None where they do not tell: parallel sides, or a camera that looks down too steeply.
        """
        closing = (self.lean[0] - self.lean[1]) / (self.start[1] - self.start[0])
        if closing <= 0:
            return None
        nadir = self.row + 1 / closing - camera.cy
        slope = camera.focal / nadir
        is_told = LOOKING_DOWN[0] <= slope <= LOOKING_DOWN[1]
        return camera.cy - camera.focal * slope if is_told else None


def find_prism(silhouette: ReliefSilhouette, camera: Camera, horizon: float | None) -> Prism | None:
    """The upright prism that has this silhouette; None where it is not that of one."""
    x, y = silhouette.lower_outline
    row = float(y.max())
    sides = PrismSides.of(silhouette, float(x[np.argmax(y)]), row)
    contact = None if sides is None else _contact(silhouette, sides, x, y)
    if sides is None or contact is None:
        return None
    told = sides.horizon(camera) if horizon is None else horizon
    plan = GroundPlane.under(silhouette, camera, told, row)
    if not plan.is_seen(contact[1]):
        return None
    if _is_round(*contact):
        return _cylinder(plan, *contact, row)
    return _box(plan, *contact, row)


def agreed_line(t: F64, x: F64, allowed: float) -> tuple[float, float]:
    """Value at t = 0 and slope of the line through two of the points (n,) that most agree with."""
    i, j = np.triu_indices(len(t), len(t) // 4)
    slopes = (x[j] - x[i]) / np.where(t[j] == t[i], 1e-9, t[j] - t[i])
    gaps = np.abs(x - x[i, None] - slopes[:, None] * (t - t[i, None]))
    best = int(np.argmax((gaps <= 0.5 * allowed).sum(1)))
    agree = gaps[best] <= 0.5 * allowed
    slope, start = np.polyfit(t[agree], x[agree], 1)
    return float(start), float(slope)


def _contact(
    silhouette: ReliefSilhouette, sides: PrismSides, x: F64, y: F64
) -> tuple[F64, F64] | None:
    """Columns and rows (n,) px in which a prism with these sides meets the ground."""
    ends = _ends(silhouette, sides)
    if ends is None:
        return None
    (left, y_left), (right, y_right) = ends
    within = (x > left) & (x < right)
    if within.sum() < LEAST_CELLS:
        return None
    x = np.concatenate([[left], x[within], [right]])
    y = np.concatenate([[y_left], y[within], [y_right]])
    hull = lower_hull(x, y)
    rim = np.interp(x, x[hull], y[hull])
    fold = (rim - np.interp(x, x[[0, -1]], y[[0, -1]])).max()
    height = np.ptp(np.flatnonzero(silhouette.inside.any(1))) * silhouette.cell
    allowed = max(TOUCHING * silhouette.extent, 2 * silhouette.cell)
    is_high = rim.max() - rim[[0, -1]].min() > FOOT * height
    is_ragged = (rim - y > allowed).mean() > MOST_RAGGED
    return None if fold < LEAST_FOLD * np.ptp(x) or is_high or is_ragged else (x, rim)


def _ends(silhouette: ReliefSilhouette, sides: PrismSides) -> list[tuple[float, float]] | None:
    """px (x, y) of the lowest places in which the outline is the left and the right side."""
    inside, cell = silhouette.inside, silhouette.cell
    rows = np.flatnonzero(inside.any(1))
    level = ((rows + 0.5) * cell + silhouette.top).astype(np.float64)
    ends = []
    outline = (np.argmax(inside[rows], 1), inside.shape[1] - 1 - np.argmax(inside[rows, ::-1], 1))
    for j, side, out in zip(outline, sides.at(level), (-0.5, 0.5), strict=True):
        edge = (j + 0.5 + out) * cell + silhouette.left
        on_side = np.flatnonzero(np.abs(edge - side) <= CORNER * cell)
        if len(on_side) == 0:
            return None
        ends.append((float(side[on_side[-1]]), float(level[on_side[-1]])))
    return ends


def _is_round(x: F64, y: F64) -> bool:
    """Whether a contact at columns and rows (n,) px bends evenly, and not about a corner."""
    fold = y - np.interp(x, x[[0, -1]], y[[0, -1]])
    return float(np.trapezoid(fold, x) / (np.ptp(x) * fold.max())) > ROUND


def _cylinder(plan: GroundPlane, x: F64, y: F64, row: float) -> Prism:
    """The front of an upright cylinder between the columns x[0] and x[-1] px."""
    columns = np.linspace(x[0], x[-1], COLUMNS)
    share = np.linspace(-1, 1, COLUMNS)
    half = float(np.ptp(x)) / 2 / np.hypot(plan.camera.focal, x.mean() - plan.camera.cx)
    deep = np.sin(np.arctan(half)) * np.sqrt(1 - share**2)  # x distance of its axis
    level = np.full(COLUMNS, y[[0, -1]].mean())
    return Prism(plan, 0.0, row, plan.foot(columns, level, row), 1 / (1 - deep), True)


def _box(plan: GroundPlane, x: F64, y: F64, row: float) -> Prism | None:
    """What the contact at columns and rows (n,) px says; None where it is turned too far."""
    across, forward = plan.on_ground(x, y)
    turn = float((forward[-1] - forward[0]) / (across[-1] - across[0]))
    if abs(turn) > MOST_TURN:
        return None
    # Where the ray of each place meets the line between the ends.
    start = np.array([across[0], forward[0]])
    along = np.array([across[-1], forward[-1]]) - start
    cross = across * along[1] - forward * along[0]
    far = (start[0] * along[1] - start[1] * along[0]) / np.where(np.abs(cross) < 1e-9, 1e-9, cross)
    nearer = np.clip(far, 1.0, 1.0 + MOST_NEARER * np.ptp(across) / np.median(forward))
    return Prism(plan, turn, row, plan.foot(x, y, row), nearer, False)


# Level ground as a camera above it sees it: the plan of what stands there.

CAMERA_HEIGHT = 0.75  # x extent, in the photo: how far below the horizon things usually stand
LEAST_BELOW = 0.1  # x height of the photo that ground must be below the horizon to tell something


@dataclass(frozen=True, eq=False)
class GroundPlane:
    """The camera's height above the ground is the unit."""

    camera: Camera
    horizon: float  # px, the row of the photo it lies in

    @staticmethod
    def under(
        silhouette: ReliefSilhouette, camera: Camera, horizon: float | None, row: float
    ) -> GroundPlane:
        """The ground that the object touches about `row` px.

        `horizon` None: not known. A photo is seldom taken from much lower than a thing is large.
        """
        if horizon is None:
            horizon = row - max(row - camera.cy, CAMERA_HEIGHT * silhouette.extent)
        return GroundPlane(camera, horizon)

    @property
    def down(self) -> tuple[float, float]:
        """Cosine and sine of the angle by which the camera looks down."""
        rise = self.camera.cy - self.horizon
        length = float(np.hypot(self.camera.focal, rise))
        return self.camera.focal / length, rise / length

    @property
    def up(self) -> F64:
        """(3,) camera axes, unit: the ground's normal."""
        cosine, sine = self.down
        return np.array([0.0, -cosine, -sine])

    def is_seen(self, y: F64) -> bool:
        """Return whether the ground in rows `y` (n,) px is far enough below the horizon."""
        return bool(y.min() - self.horizon >= LEAST_BELOW * self.camera.height)

    def facing(self, y: F64) -> F64:
        """Forward distance over depth (...) on the rays of rows `y` px; forward is level."""
        cosine, sine = self.down
        return cosine - sine * (y - self.camera.cy) / self.camera.focal

    def on_ground(self, x: F64, y: F64) -> tuple[F64, F64]:
        """Across and forward (n,) of the ground seen at px (n,) below the horizon."""
        cosine, sine = self.down
        depth = 1 / (cosine * (y - self.camera.cy) / self.camera.focal + sine)
        return depth * (x - self.camera.cx) / self.camera.focal, depth * self.facing(y)

    def foot(self, x: F64, y: F64, row: float) -> F64:
        """Column px in which the plumb line through px (...) crosses `row`."""
        return self.camera.cx + (x - self.camera.cx) * self.facing(np.array(row)) / self.facing(y)


# Where an object touches the ground follows from its silhouette alone: the lower convex hull, as
# far as the outline lies on it, or bridges the gap between two feet that are about level. Seen
# from above (the plan), a line through those places shows which end is nearer.

STEEPEST = 0.9  # slope of the outline in the photo, beyond which it leaves the ground
STEEPEST_BRIDGE = 0.35  # likewise of a line between two feet
BRIDGE = 0.85  # share of a stretch of the hull that is touched; below, it is a bridge
STRETCH = 0.12  # x width of the silhouette: shorter stretches of the hull are of a round bottom
LEAST_SPAN = (0.15, 0.4)  # x width of the silhouette: contacts say nothing, or all
TRUST = 0.85  # the horizon is not known exactly, and thought too low it exaggerates
LEAST_DEPTH = 0.25  # inverse depth over that of the middle: the sheet never comes near infinity


@dataclass(frozen=True, eq=False)
class StandingSheet:
    """The middle sheet: an upright plane through the contact with the ground."""

    plane: F64  # (3,) relative inverse depth = plane . (x px, y px, 1); 1 amid the silhouette
    prism: Prism | None = None

    @property
    def is_known(self) -> bool:
        """Whether the object is seen to stand."""
        return self is not FLAT

    def inverse_depth(self, xy: F64) -> F64:
        """Relative inverse depth (...) at photo px (..., 2); never near 0."""
        return np.maximum(xy @ self.plane[:2] + self.plane[2], LEAST_DEPTH)


FLAT = StandingSheet(np.array([0.0, 0.0, 1.0]))


def stand(silhouette: ReliefSilhouette, camera: Camera, horizon: float | None) -> StandingSheet:
    """Return the object's stance on level ground; FLAT where none is seen.

    `horizon`: the row of the photo it lies in, px. None: unknown, and guessed.
    """
    x, y = silhouette.lower_outline
    is_cut = silhouette.is_open[1] or y.max(initial=0.0) > camera.height + silhouette.cell
    if is_cut or len(x) < 3:
        return FLAT
    if (prism := find_prism(silhouette, camera, horizon)) is not None:
        return StandingSheet(_upright(silhouette, prism.plan, prism.turn), prism)
    touches = _touching(x, y, silhouette.extent)
    if touches.sum() < 2:
        return FLAT
    plan = GroundPlane.under(silhouette, camera, horizon, float(np.median(y[touches])))
    if not plan.is_seen(y[touches]):
        return FLAT
    across, forward = plan.on_ground(x[touches], y[touches])
    span = np.ptp(x[touches]) / np.ptp(x)
    sure = float(np.clip((span - LEAST_SPAN[0]) / (LEAST_SPAN[1] - LEAST_SPAN[0]), 0, 1))
    turn = sure * TRUST * float(np.polyfit(across, forward, 1)[0])
    # Only a prism is known to stand upright: what is round has no lean of its own.
    return StandingSheet(_upright(silhouette, GroundPlane(camera, camera.cy), turn))


def _upright(silhouette: ReliefSilhouette, plan: GroundPlane, turn: float) -> F64:
    """(3,) the plane that stands upright amid the silhouette; `turn`: forward per across."""
    camera = plan.camera
    cosine, sine = plan.down
    turn = float(np.clip(turn, -MOST_TURN, MOST_TURN))
    x, y, level = -turn / camera.focal, -sine / camera.focal, cosine
    plane = np.array([x, y, level - x * camera.cx - y * camera.cy])
    rows, columns = np.nonzero(silhouette.inside)
    middle = silhouette.photo_xy(np.array([[columns.mean(), rows.mean()]]))[0]
    return plane / max(float(plane[:2] @ middle + plane[2]), 1e-6)


def _touching(x: F64, y: F64, extent: float) -> np.ndarray:
    """(n,) which places of a lower outline touch the ground."""
    hull = lower_hull(x, y)
    near = np.interp(x, x[hull], y[hull]) - y <= TOUCHING * extent
    touches = np.zeros(len(x), bool)
    for a, b in pairwise(hull):
        is_bridge = near[a : b + 1].mean() < BRIDGE
        slope = abs((y[b] - y[a]) / (x[b] - x[a]))
        is_round = x[b] - x[a] < STRETCH * (x[-1] - x[0])
        if slope <= (STEEPEST_BRIDGE if is_bridge else STEEPEST) and not is_round:
            touches[a : b + 1] |= near[a : b + 1]
    return touches
