"""A closed body over a silhouette: a front and a back sheet about a middle one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np

from ...base.arrays import F64
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ...document.model import LiftSettings
from .canvas import bilinear
from .cuts import Behind, Cuts, Overlaps, overlaps_of
from .mirror import MirrorAxis
from .plain_solid import PlainSolid
from .silhouette import ReliefSilhouette
from .standing import FLAT, Prism, StandingSheet, stand
from .thickness import Thickness

FRONT, BACK, MIDDLE = 1.0, -1.0, 0.0  # a sheet, as the share of the thickness it lies in front
BLEND = 0.03  # x extent, over which a prism gives way to what sticks out beside it
MOST_OBLIQUE = 2.0  # x its own thickness, along the line of sight, of what stands obliquely


@dataclass(frozen=True, eq=False)
class ReliefBody:
    """Heights are px towards the camera, at a depth at which a px of the photo is as wide."""

    silhouette: ReliefSilhouette
    standing: StandingSheet
    middle: F64  # (h, w) px, height of the middle sheet
    front: Thickness
    back: Thickness
    detail: F64 | None = None  # (h, w) px, height of the front beyond its thickness; None: 0
    cuts: Cuts | None = None  # between cells where one part ends before another
    own: F64 | None = None  # (h, w) share of the thickness that is the nearest part's; None: 1
    behind: Behind | None = None  # what its shape hides from the photo; None: nothing is known
    kind: str = "free"  # what it was recognised as: see `shapes`
    likeness: float = 1.0  # in [0, 1], to the kind that it was said to be
    solid: PlainSolid | None = None  # what it is where it is nothing but that; None: nowhere
    lacks: F64 = field(default_factory=lambda: np.zeros(2))  # slope: see `lacking`
    doubt: float = 0.0  # x extent, expected error of the front's depth; 0: nobody said
    up: F64 | None = None  # (3,) camera axes, unit: what is up where it stands; None: not seen

    @staticmethod
    def of(
        silhouette: ReliefSilhouette,
        camera: Camera,
        settings: LiftSettings,
        axis: MirrorAxis | None = None,
    ) -> ReliefBody:
        """`axis`: of an object that looks the same left and right."""
        standing = stand(silhouette, camera, settings.horizon) if settings.is_standing else FLAT
        xy = silhouette.photo_xy(silhouette.cells)
        far = 1 / standing.inverse_depth(xy)
        middle = camera.focal * (1 - far)
        inflated = Thickness.of(silhouette)
        if axis is not None:
            inflated = inflated.mean_with(silhouette.grid_xy(axis.mirrored(xy)))
        dy, dx = np.gradient(middle, silhouette.cell)
        oblique = np.minimum(np.sqrt(1 + dx**2 + dy**2), MOST_OBLIQUE)
        inflated = inflated.times(oblique * settings.thickness)
        sides = [inflated, inflated]
        if standing.prism is not None:
            halves = camera.focal * far * (1 - 1 / _nearer(standing.prism, xy))
            share = _share(standing.prism, xy, silhouette.extent)
            sides = [inflated.mixed(settings.thickness * half, share) for half in halves]
        up = None if standing.prism is None else standing.prism.plan.up
        return ReliefBody(silhouette, standing, middle, sides[0], sides[1], up=up)

    def nearer(self, height: F64) -> ReliefBody:
        """Return the body with its parts moved towards the camera by `height` (h, w) px."""
        return replace(self, middle=self.middle + height, solid=None)

    def sample(self, xy: F64, side: float | F64) -> tuple[F64, F64]:
        """Height (N,) px and its gradient (N, 2) at photo px (N, 2).

        `side`: FRONT, BACK, or any share (N,) of the thickness in front of the middle sheet.
        """
        cell, wanted = self.silhouette.cell, self.silhouette.grid_xy(xy)
        grid_xy = wanted if self.cuts is None else self.cuts.settled(wanted)
        fields = bilinear(self._middle_fields, grid_xy)
        gradient = fields[:, 1:].copy()
        beyond = grid_xy - np.clip(grid_xy, 0, np.array(self.middle.shape[::-1]) - 1)
        height = fields[:, 0] + cell * (beyond * gradient).sum(1)  # the sheet goes on
        share = np.broadcast_to(np.asarray(side, np.float64), len(xy))
        for thickness, is_there in ((self.front, share > 0), (self.back, share < 0)):
            half, slope = thickness.sample(grid_xy[is_there], cell)
            height[is_there] += share[is_there] * half
            gradient[is_there] += share[is_there, None] * slope
        if self.detail is not None:
            self._add_detail(grid_xy, np.maximum(share, 0.0), height, gradient)
        if self.cuts is not None:
            height += np.clip(cell * ((wanted - grid_xy) * gradient).sum(1), -cell, cell)
        return height, gradient

    def height(self, xy: F64, side: float) -> F64:
        """Height (N,) px of the FRONT or the BACK alone, at photo px (N, 2) inside."""
        if self.cuts is not None:
            return self.sample(xy, side)[0]
        grid_xy = self.silhouette.grid_xy(xy)
        thickness = self.front if side > 0 else self.back
        height = bilinear(self.middle, grid_xy) + side * thickness.half(grid_xy)
        if self.detail is not None and side > 0:
            height += bilinear(self.detail, grid_xy)
        return height

    @cached_property
    def overlaps(self) -> Overlaps | None:
        """Return what lies behind parts that are in front of others; None where there is none."""
        if self.cuts is None:
            return None
        outline = self.silhouette
        at = outline.photo_xy(outline.cells).reshape(-1, 2)
        front, back = (self.sample(at, side)[0].reshape(outline.shape) for side in (FRONT, BACK))
        own = np.ones(outline.shape) if self.own is None else self.own
        thickness = own * (front - back)
        if self.behind is not None:
            known = np.isfinite(self.behind.front)
            thickness = np.where(known, front - self.behind.own_back, 0.0)  # no walls elsewhere
        found = overlaps_of(front, back, thickness, self.cuts, outline.inside, outline.extent)
        return found if self.behind is None else found.known(self.behind)

    @cached_property
    def _middle_fields(self) -> F64:
        """(h, w, 3) the middle sheet and its gradient."""
        return np.stack([self.middle, *self._slopes(self.middle)], -1)

    def _slopes(self, field: F64) -> tuple[F64, F64]:
        """(h, w) each, what `field` (h, w) grows by per px right and down."""
        if self.cuts is not None:
            down, right = self.cuts.gradient(field)
        else:
            down, right = (np.asarray(slope, np.float64) for slope in np.gradient(field))
        return right / self.silhouette.cell, down / self.silhouette.cell

    def _add_detail(self, grid_xy: F64, share: F64, height: F64, gradient: F64) -> None:
        """Adds the front's detail, `share` (N,) of it, to heights (N,) and gradients (N, 2)."""
        assert self.detail is not None
        fields = bilinear(np.stack([self.detail, *self._slopes(self.detail)], -1), grid_xy)
        height += share * fields[:, 0]
        gradient += share[:, None] * fields[:, 1:]


def _nearer(prism: Prism, xy: F64) -> F64:
    """(2, h, w) how much nearer, and farther, than its middle a prism's front and back are.

    The back is the front turned half around: a box has four sides.
    """
    at = prism.plan.foot(xy[..., 0], xy[..., 1], prism.row)
    turned = prism.columns[0] + prism.columns[-1] - at
    return np.stack([np.interp(place, prism.columns, prism.nearer) for place in (at, turned)])


def _share(prism: Prism, xy: F64, extent: float) -> F64:
    """(h, w) 1 where the prism is, 0 where something sticks out beside it."""
    at = prism.plan.foot(xy[..., 0], xy[..., 1], prism.row)
    beyond = np.maximum(prism.columns[0] - at, at - prism.columns[-1])
    return np.clip(0.5 - beyond / (BLEND * extent), 0, 1)


# What a body leans more than the network sees: of the plane nearest to its front.
#
# A photo hardly shows how far a thing leans. Who must answer so that the mean absolute error is
# the least gives the median of what it may be, which is less, whichever way it leans; and what is
# blended with an upright silhouette leans less again. What such a blend lacks was measured on 150
# views of made solids and of meshes that the network was not trained on. Where the network sees a
# lean of more than about ten degrees it is 1.2 times as much again: the root mean square of the
# error of the slopes becomes 0.33 instead of 0.38 to the sides, and 0.33 instead of 0.42 up and
# down. What seems to lean less is a shape as often as a lean, and stays.

LACKING = 1.2  # x the lean that the network sees ...
LEAST, SURELY = 0.15, 0.25  # ... of slopes from the first on, and all of it from the second on
STEEPEST = 1.0  # slope that a body leans more at most


def lacking(body: ReliefBody, seen: F64, camera: Camera, share: float) -> F64:
    """Return the slope (2,) that `body` lacks of the lean of `seen` (h, w), its front in px.

    Of the logarithm of the depth, per tangent: in that a plane in perspective is nearly one. What
    stands as a prism leans as its outline says. `share` in [0, 1] of what is lacking.
    """
    if body.standing.prism is not None:
        return np.zeros(2)
    outline = body.silhouette
    own = _tangents(body, camera)[outline.inside]
    own = own - own.mean(0)
    away = np.log(camera.focal - seen[outline.inside])
    slope = np.linalg.lstsq(own.T @ own, own.T @ away, rcond=None)[0]
    slope *= share * LACKING * np.clip((np.abs(slope) - LEAST) / (SURELY - LEAST), 0, 1)
    return slope * min(1.0, STEEPEST / max(float(np.linalg.norm(slope)), 1e-9))


def leaning(body: ReliefBody, camera: Camera) -> ReliefBody:
    """Return `body` with the slope that it lacks."""
    if not body.lacks.any():
        return body
    tangents = _tangents(body, camera)
    change = (tangents - tangents[body.silhouette.inside].mean(0)) @ body.lacks
    middle = camera.focal - (camera.focal - body.middle) * np.exp(change)
    return replace(body, middle=middle, lacks=np.zeros(2))


def _tangents(body: ReliefBody, camera: Camera) -> F64:
    """(h, w, 2) of a body's cells."""
    outline = body.silhouette
    return (outline.photo_xy(outline.cells) - [camera.cx, camera.cy]) / camera.focal


# How the far side of a free form meets its outline: round, and without the outline's own waves.
#
# A photo says where a form ends, tufts and stairs of the outline included, but not how: a network's
# pixel is too wide for that. Were the form as thick there as it is farther in, all of that would be
# drawn out along the line of sight. So its far side comes up to the front before the outline, as an
# ellipse does, at a line that is the outline without what is smaller than the part is wide: what
# sticks out beyond it is thin.

REACH = 0.035  # x extent from the line, over which the far side comes up
EVEN = 0.02  # x extent, standard deviation over which the line has no waves
THIN = 0.2  # x the distance from the outline itself, that the line is away at least
RIM = 0.01  # x extent from the outline, over which it is looked at whether a form closes there
OPEN = -0.3, -0.05  # share more than an ellipse is thick there, from which it does not, and surely
MARGIN = 3.0  # x EVEN, around the grid


def closed(body: ReliefBody) -> ReliefBody:
    """Return `body` with its far side closed at the outline; what is seen stays."""
    outline = body.silhouette
    reach = REACH * outline.extent / outline.cell
    if reach < 1:
        return body
    cells = outline.cells.reshape(-1, 2)
    halves = [side.half(cells).reshape(outline.shape) for side in (body.front, body.back)]
    thick = halves[0] + halves[1]
    weight = outline.inside.astype(np.float64)

    def gathered(field: F64) -> F64:
        return np.asarray(cv2.GaussianBlur(field * weight, (0, 0), reach), np.float64)

    around = np.ones((2 * int(reach) + 1,) * 2, np.uint8)
    widest = np.asarray(cv2.dilate(thick * weight, around), np.float64)
    wide = gathered(widest) / np.maximum(gathered(weight), 1e-6)
    closes = wide * _ellipse(outline.depth / outline.cell / reach)
    rim = np.exp(-outline.depth / (RIM * outline.extent))
    more = gathered(rim * thick) / np.maximum(gathered(rim * closes), 1e-6) - 1
    amount = np.clip((more - OPEN[0]) / (OPEN[1] - OPEN[0]), 0, 1)
    away = _even(outline) / reach
    kept = np.minimum(wide * _ellipse(away) / np.maximum(thick, 1e-6), 1.0)
    kept = 1 - np.where(away < 1, amount * (1 - kept), 0.0)
    kept = kept.ravel()[nearest_in(outline.inside)]
    sides = [
        replace(side, square=_scaled(side, kept, half))
        for side, half in zip((body.front, body.back), halves, strict=True)
    ]
    moved = halves[0] - sides[0].half(cells).reshape(outline.shape)
    return replace(body, middle=body.middle + moved, front=sides[0], back=sides[1])


def _scaled(side: Thickness, kept: F64, half: F64) -> F64:
    """(h, w) the square of `side`, `half` (h, w) px thick, of which `kept` (h, w) is left.

    As steep at a rim as it is, and 0 where it is.
    """
    within = side.towards(kept * half, np.ones(half.shape)).square
    return np.where(side.square > 0, within, side.square * kept**2)


def _ellipse(away: F64) -> F64:
    """Height (h, w) of a quarter of an ellipse, `away` (h, w) from its end, of 1."""
    away = np.clip(away, 0, 1)
    return np.sqrt(away * (2 - away))


def _even(outline: ReliefSilhouette) -> F64:
    """(h, w) cells from the outline without its waves; few where it is beyond that.

    Thin parts keep their outline.
    """
    sigma = EVEN * outline.extent / outline.cell
    pad = int(MARGIN * sigma) + 1
    inside = outline.continued(outline.inside, pad).astype(np.uint8)
    depth, beyond = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (inside, 1 - inside))
    signed = np.asarray(depth - beyond, np.float64)
    radius = cv2.GaussianBlur(outline.continued(outline.radius, pad) / outline.cell, (0, 0), sigma)
    radius /= np.maximum(cv2.GaussianBlur(inside.astype(np.float64), (0, 0), sigma), 1e-6)
    share = np.clip(radius / sigma - 1, 0, 2) / 2
    even = signed + share * (cv2.GaussianBlur(signed, (0, 0), sigma) - signed)
    return np.maximum(even, THIN * np.maximum(signed, 0.0))[pad:-pad, pad:-pad]
