"""A body from its silhouette and from what the shape network sees, each as far as it is sure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ..crop import SIDE, rays
from .body import ReliefBody, lacking
from .canvas import bilinear
from .cuts import find_cuts
from .integration import integrated
from .shape_look import SeenShape
from .silhouette import ReliefSilhouette
from .standing import StandingSheet
from .thickness import Thickness

# Fields over a silhouette without the waves that nobody has seen.
#
# What a network says of what lies behind, and of how the middle of an object runs, is right on the
# whole and wavy in detail. A field is settled by fitting a plane to it around each cell, as wide as
# the part of the object there; a mean would flatten it towards the outline.

WIDTHS = (0.02, 0.05, 0.1)  # x extent, standard deviations over which planes are fitted
OF_RADIUS = 0.3  # x the radius of the part, that the width is
FINE = 4.0  # cells of a blur's standard deviation, beyond which it is found on fewer
STEADY = 0.05  # variance, x the width's own, that keeps a plane level where cells lie in a line


@dataclass(frozen=True, eq=False)
class Settling:
    """Planes over the cells of a silhouette, each cell as much as `weight` (h, w) says."""

    outline: ReliefSilhouette
    weight: F64

    def settled(self, field: F64) -> F64:
        """`field` (h, w) without waves shorter than the part is wide."""
        outline = self.outline
        wanted = np.clip(OF_RADIUS * outline.radius / outline.extent, WIDTHS[0], WIDTHS[-1])
        wanted = np.maximum(self.mean(wanted, WIDTHS[1]), WIDTHS[0])
        level = np.interp(np.log(wanted), np.log(WIDTHS), range(len(WIDTHS)))
        found = np.zeros(field.shape)
        for k, width in enumerate(WIDTHS):
            share = np.maximum(1 - np.abs(level - k), 0)
            if share.any():
                found += share * self._plane(field, width)
        return found

    def mean(self, field: F64, width: float) -> F64:
        """The mean of `field` (h, w) around each cell; `width` x extent, standard deviation."""
        total = self._gathered(field, width)
        return total / np.maximum(self._gathered(np.ones(field.shape), width), 1e-9)

    def multiple(self, field: F64, of: F64, width: float) -> F64:
        """Return the least-squares factor of `field` (h, w) over `of` (h, w) around each cell."""
        square = np.maximum(self._gathered(of**2, width), 1e-9)
        return self._gathered(field * of, width) / square

    def _plane(self, field: F64, width: float) -> F64:
        sigma = self._cells(width)
        y, x = np.indices(field.shape, np.float64) / sigma
        one = np.maximum(self._gathered(np.ones(field.shape), width), 1e-9)
        fields: list[F64] = [x, y, field, x * x, x * y, y * y]
        gathered = (self._gathered(f, width) / one for f in fields)
        mx, my, mean, xx, xy, yy = gathered
        xf, yf = (self._gathered(axis * field, width) / one for axis in (x, y))
        xx, xy, yy = xx - mx**2 + STEADY, xy - mx * my, yy - my**2 + STEADY
        xf, yf, det = xf - mx * mean, yf - my * mean, xx * yy - xy**2
        return mean + ((yy * xf - xy * yf) * (x - mx) + (xx * yf - xy * xf) * (y - my)) / det

    def _cells(self, width: float) -> float:
        return max(width * self.outline.extent / self.outline.cell, 0.5)

    def _gathered(self, field: F64, width: float) -> F64:
        """`field` (h, w) as weighted, blurred; on fewer cells where that is enough."""
        sigma = self._cells(width)
        step = max(1, int(sigma / FINE))
        down, across = field.shape
        weighted = self.weight * field
        if step == 1:
            return np.asarray(cv2.GaussianBlur(weighted, (0, 0), sigma), np.float64)
        size = -(-across // step), -(-down // step)
        few = cv2.resize(weighted, size, interpolation=cv2.INTER_AREA)
        few = cv2.GaussianBlur(few, (0, 0), sigma / step)
        whole = cv2.resize(few, (across, down), interpolation=cv2.INTER_LINEAR)
        return np.asarray(whole, np.float64)


# How far off the silhouette's body is expected to be: crop units, and per its half-thickness. Both
# times as much as is known of it: what stands on the ground leans as its feet tell, and of a box
# the front is known well. Chosen on made-up objects that the network was not trained on; there
# twice as much is best, but a photograph is not what the network was trained on, either.
INFLATED_ERROR = (0.02, 0.5)
FLOATING, STANDING = (4.0, 4.0), (2.0, 4.0)  # x, of the front and of what is behind it
CYLINDER, BOX = (1.5, 2.0), (0.4, 0.8)
ROUND = (0.35, 0.6)  # cosine to the ray, near the outline: the surface turns away; it ends there
RIM = 0.035  # x extent from the outline, over which a body that is round there closes
ROUND_WIDTH = 0.1  # x extent, over which a round body is one multiple of the silhouette's
COMB = 1.5  # px of the crop, over which what the network says is evened
USUAL_ERROR = 0.04  # crop units of the front: who is surer than that sees how things lean
INNER = 1.5  # px of the crop from the outline, nearer to which its pixels mix


class Sheets(NamedTuple):
    """Heights (h, w) px over a silhouette's cells, and what is known about them."""

    front: F64
    back: F64
    front_error: F64  # px, expected
    back_error: F64
    facing: F64  # cosine between the front's normal and the ray
    own: F64  # share of the thickness that is of the part that is seen
    edge: F64  # probability that the front ends beside a cell


def fused(
    body: ReliefBody, seen: SeenShape, camera: Camera, thickness: float, trust: float
) -> ReliefBody:
    """`body`, whose thickness was multiplied by `thickness`, as `seen` where that is surer.

    `trust` in [0, 1]: 0 leaves the body as it is.
    """
    if trust <= 0:
        return body
    outline = body.silhouette
    halves = [_half(side, outline) / thickness for side in (body.front, body.back)]
    sheets = sheets_of(seen, camera, outline)
    # Neither says how far away it is: both fronts are, in the mean. Away from the camera all
    # grows alike, and the picture stays.
    means = [
        float(front[outline.inside].mean()) for front in (body.middle + halves[0], sheets.front)
    ]
    away = (camera.focal - means[0]) / (camera.focal - means[1])
    front, back = (camera.focal - away * (camera.focal - side) for side in sheets[:2])
    sheets = sheets._replace(front=front, back=back)
    cuts = find_cuts(
        sheets.front, trust * sheets.edge, outline.inside, outline.cell, outline.extent
    )
    if cuts is not None:
        sharp = (cuts.sharpened(field, outline.inside) for field in (sheets.front, sheets.own))
        sheets = sheets._replace(**dict(zip(("front", "own"), sharp, strict=True)))
    inflated = INFLATED_ERROR[0] * seen.crop.side
    inflated = inflated + INFLATED_ERROR[1] * 0.5 * (halves[0] + halves[1])
    front_share, back_share = (
        trust * _share(doubt * inflated, own)
        for doubt, own in zip(
            _doubts(body.standing), (sheets.front_error, sheets.back_error), strict=True
        )
    )
    settling = Settling(outline, outline.inside * np.clip(1 - 2 * sheets.edge, 0.01, 1))
    front_share, back_share = (settling.mean(share, RIM) for share in (front_share, back_share))
    if cuts is not None:
        body = replace(
            body, front=replace(body.front, cuts=cuts), back=replace(body.back, cuts=cuts)
        )

    def blended(middle: F64, half: F64) -> tuple[F64, list[Thickness]]:
        sides = [
            side.towards(thickness * closing(half, sheets.facing, outline, own), back_share)
            for side, own in zip((body.front, body.back), halves, strict=True)
        ]
        return (1 - front_share) * body.middle + front_share * middle, sides

    raw = 0.5 * (sheets.front - sheets.back)
    before, sides = blended(sheets.front - raw, raw)
    gap = before + _half(sides[0], outline) / thickness
    square = sum(np.maximum(side.square, 0.0) for side in (body.front, body.back))
    balls = np.sqrt(0.5 * square) / thickness
    half = _settled_half(raw, sheets.facing, balls, settling)
    middle, sides = blended(settling.settled(sheets.front - half), half)
    # What is seen stays, but for rims that turn away: there the sheets meet.
    gap -= middle + _half(sides[0], outline) / thickness
    gap *= thickness * (1 - _is_round(settling.mean(sheets.facing, RIM)) * (1 - _inward(outline)))
    whole = _half(sides[0], outline) + gap
    middle += np.minimum(whole, 0.0)  # it is never in front of what is seen
    front = sides[0].towards(np.maximum(whole, 0.0), outline.inside.astype(np.float64))
    back = sides[1]
    own = None if cuts is None else 1 - front_share * (1 - np.clip(sheets.own, 0, 1))
    body = replace(body, middle=middle, front=front, back=back, cuts=cuts, own=own)
    unsure = float(sheets.front_error[outline.inside].mean()) / (USUAL_ERROR * seen.crop.side)
    heeded = min(2 * float(front_share[outline.inside].mean()), trust) * min(unsure, 1.0)
    return replace(body, lacks=lacking(body, sheets.front, camera, heeded))


def sheets_of(seen: SeenShape, camera: Camera, outline: ReliefSilhouette) -> Sheets:
    """Return the sheets over the cells of a silhouette; beyond the look its nearest pixel holds."""
    crop, mask = seen.crop, seen.mask
    ways = rays(crop.tangents)
    distance = crop.away - seen.front.astype(np.float64)
    step = 1 / (SIDE * crop.away)
    distance = integrated(distance, seen.front_error, seen.normal, seen.edge, ways, mask, step)
    facing = -(seen.normal * ways).sum(-1)
    px = crop.side * ways[..., 2]  # of depth along the axis, per crop unit along the ray
    front = camera.focal - px * distance
    back = camera.focal - px * (distance + seen.depth)
    stacked = np.stack(
        [
            front, back, crop.side * seen.front_error, crop.side * seen.depth_error, facing,
            seen.thickness / np.maximum(seen.depth, 1e-4), seen.edge,
        ], -1,
    )  # fmt: skip
    fields = _continued(_evened(stacked.astype(np.float64), seen.edge, mask), mask)
    cells = crop.grid_xy(outline.photo_xy(outline.cells)).reshape(-1, 2)
    found = bilinear(fields, cells).reshape(*outline.shape, -1)
    return Sheets(*np.moveaxis(found, -1, 0))


def _settled_half(half: F64, facing: F64, inflated: F64, settling: Settling) -> F64:
    """(h, w) px: half the thickness. What is behind is a guess, and need not have waves.

    Where it closes at the outline it is smooth as a multiple of the silhouette's body `inflated`,
    else as it is.
    """
    outline = settling.outline
    ratio = settling.multiple(half, inflated, ROUND_WIDTH)
    rim = np.exp(-outline.depth / (RIM * outline.extent)) * outline.inside
    closes = settling.multiple(_is_round(facing) * rim, rim, ROUND_WIDTH)
    found = closes * ratio * inflated + (1 - closes) * settling.settled(half)
    return np.maximum(found, 0.0)


def _is_round(facing: F64) -> F64:
    return np.clip((ROUND[1] - facing) / (ROUND[1] - ROUND[0]), 0, 1)


def closing(half: F64, facing: F64, outline: ReliefSilhouette, inflated: F64) -> F64:
    """Return `half` (h, w) px, brought down to 0 at the outline where the front turns away there.

    A pixel is too wide to tell how. There it closes as the silhouette's body does, `inflated`,
    times as much as `half` is thicker than that farther in.
    """
    reach, share = RIM * outline.extent, _inward(outline)
    weight = share * outline.inside
    sigma = max(0.5 * reach / outline.cell, 0.5)
    ratio = np.clip(half / np.maximum(inflated, 1e-3 * outline.extent), 0.0, 4.0)
    blurred = cv2.GaussianBlur(ratio * weight, (0, 0), sigma)
    ratio = blurred / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-6)
    is_round = _is_round(facing)
    is_round = cv2.GaussianBlur(is_round, (0, 0), sigma)
    closed = np.minimum(ratio * inflated, half.max())
    amount = is_round * (1 - share)
    return np.maximum(half + amount * (closed - half), 0.0)


def _inward(outline: ReliefSilhouette) -> F64:
    """(h, w) from 0 at the outline to 1, from where on nothing closes any more."""
    return np.clip(outline.depth / (RIM * outline.extent), 0, 1)


def _doubts(standing: StandingSheet) -> tuple[float, float]:
    """Of the silhouette's front and thickness, x `INFLATED_ERROR`."""
    if standing.prism is not None:
        return CYLINDER if standing.prism.is_round else BOX
    return STANDING if standing.is_known else FLOATING


def _share(error: F64, own: F64) -> F64:
    """Of what errs by `own` beside what errs by `error`: the sum errs least."""
    return error**2 / (error**2 + own**2)


def _half(side: Thickness, outline: ReliefSilhouette) -> F64:
    """(h, w) px."""
    return side.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)


def _evened(fields: F64, edge: F32, mask: Mask) -> F64:
    """`fields` (s, s, c) without what changes from pixel to pixel, and not across an edge (s, s).

    A network that draws its picture up by twos leaves a comb of two pixels in it.
    """
    weight = np.where(mask, np.maximum(1 - 2 * edge.astype(np.float64), 0.0), 0.0)[..., None]
    total = cv2.GaussianBlur(fields * weight, (0, 0), COMB)
    share = cv2.GaussianBlur(weight, (0, 0), COMB)[..., None]
    trust = np.minimum(weight, share)  # of what is beside an edge nothing is mixed
    return fields + trust * (total / np.maximum(share, 1e-6) - fields)


def _continued(fields: F64, mask: Mask) -> F64:
    """`fields` (s, s, c), outside `mask` (s, s) as at its nearest pixel well inside."""
    away = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3)
    inner = away > INNER
    if not inner.any():
        inner = mask
    return fields.reshape(-1, fields.shape[-1])[nearest_in(inner)]
