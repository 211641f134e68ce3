"""The stance of an object on the ground: the way it is turned, and whether it is an upright prism.

Where an object touches the ground follows from its silhouette alone: the lower convex hull, as far
as the outline lies on it, or bridges the gap between two feet that are about level. Seen from
above (the plan), a line through those places tells which end is nearer.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...base.arrays import F64
from ...base.camera import Camera
from .prism import MOST_TURN, GroundPlane, Prism, find_prism
from .silhouette import TOUCHING, ReliefSilhouette, lower_hull

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
