"""A relief whose shape and sides are known better from further photos of the same object.

The shape: where a detail is seen in two photos, its depth follows from where the lines of sight
meet; and what would be seen beside the object in a further photo cannot be there (Laurentini 1994,
the visual hull), so the front moves along its line of sight to where it may be, and the back ends
where that ends. Both change the shape smoothly: it stays the lifter's where nothing is said.

The sides: a Gaussian that a further photo shows much better than the first one does carries that
photo as it would an invented picture (`sides`), in the light of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, F64, I64, Mask, unit_pixels
from ...base.camera import Camera
from ...base.poisson_disk import nearest_in
from ...document.model import LiftedObject, Matte
from ...document.sides import FurtherView, Sides
from ...raster.posed import RestSplats, projection_jacobians
from ...raster.rules import RULES
from ..registration.shown import rest_picture, visibilities
from .body import ReliefBody
from .canvas import bilinear
from .colours import in_light
from .sides import GAP, side_by_side, with_sides

REACH = 0.9  # x extent, to either side of a front, where it is looked for
STEPS = 97  # places there
BESIDE = 0.012  # x the object's size in a further photo, by which a silhouette may be wrong
FARTHEST = 0.3  # x extent, by which a surface moves: what would have to move more is another one
SPREAD = 0.02  # x extent, over which a surface follows a silhouette
ROUNDS = 8  # in which it does
HELD = 0.25  # weight of what need not move beside what must: a narrow rim stays with the rest
APART_PX = 0.02  # x the object's size there, by which two lines of sight may miss each other
UNLIKE = 0.08  # x extent, by which it may differ from what the details around say
AROUND = 6  # of those
DETAIL = 0.06  # x extent, over which a detail says how deep the surface is
LIKELY = 0.35  # details' weight of the lifter's own depth
THINNEST = 0.15  # x its thickness, that stays of it
THICK = 0.3  # weight of what may stay as thick as it is beside what may not
LEAST = 12  # Gaussians that two photos show, of which the light is found
WELL = 0.4  # cosine with the line of sight, from which a Gaussian's colours are compared
FACING = 0.25  # cosine, from which a further photo's picture of it is carried
SEEN = 0.5  # visibility there
BETWEEN = 6.0  # x spacing, between Gaussians on that and on an invented picture: twice their reach


def settled(body: ReliefBody, camera: Camera, views: Sequence[FurtherView]) -> ReliefBody:
    """Return `body` as deep as the further photos show it; `camera` is the first one's."""
    for view in views:
        body = _Rays.of(body, camera, view).settled(body)
    return body


@dataclass(frozen=True, eq=False)
class _Rays:
    """The lines of sight through a body's cells, as a further photo's camera sees them."""

    view: FurtherView
    camera: Camera
    inside: Mask  # (h, w)
    cell: float  # px
    extent: float  # px
    ways: F64  # (h, w, 3) of the lines, in the further camera's world
    outside: F32  # (h', w') of the further cut-out: px from the object; inside it is below 0
    size: float  # px, of the object there

    @staticmethod
    def of(body: ReliefBody, camera: Camera, view: FurtherView) -> _Rays:
        outline, mask = body.silhouette, np.pad(view.mask, 1)
        rays = camera.unproject(outline.photo_xy(outline.cells), np.ones(outline.shape))
        away, within = (
            cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
            for part in (~mask, mask)
        )
        return _Rays(
            view, camera, outline.inside, outline.cell, outline.extent,
            rays @ view.pose[:3, :3].T, np.asarray(away - within, np.float32),
            float(np.sqrt(mask.sum())),
        )  # fmt: skip

    def settled(self, body: ReliefBody) -> ReliefBody:
        """See `settled`."""
        extra = 0.0 if body.detail is None else body.detail
        cells = body.silhouette.cells.reshape(-1, 2)
        halves = [side.half(cells).reshape(self.inside.shape) for side in (body.front, body.back)]
        before = halves[0] + extra  # the middle sheet, that the front is
        front = body.middle + before
        moved = self._by_details(body, front)
        may = self._may_be(front + moved)
        grid = self.extent * np.linspace(-REACH, REACH, STEPS)
        within = self._by_silhouette(may, grid)
        thickness = np.maximum(before + halves[1], 1e-3)
        room = within - grid[_ends(may, within, grid)]  # behind the front
        share = self._spread(
            np.clip(room / thickness, THINNEST, 1), np.where(room < thickness, 1.0, THICK), SPREAD
        )
        share = np.where(self.inside, share, 1.0)
        change = np.where(self.inside, moved + within + (1 - share) * before, 0.0)
        # Beyond the outline as at it: there the sheet is continued by its slope.
        middle = body.middle + change.ravel()[nearest_in(self.inside)]
        whole = self.inside.astype(np.float64)
        return replace(
            body, middle=middle, solid=None,
            front=body.front.towards(np.maximum(share * before - extra, 0), whole),
            back=body.back.towards(share * halves[1], whole),
        )  # fmt: skip

    def _at(self, ways: F64, height: F64) -> F64:
        """(..., 2) px of the further photo at which heights (...) px of lines (..., 3) are."""
        unit = 1 / self.extent
        away = self.camera.focal * unit - height * unit
        return self.view.camera.project(ways * away[..., None] + self.view.pose[:3, 3])

    def _may_be(self, front: F64) -> Mask:
        """(STEPS, h, w) where the surface may be, at places about `front` (h, w) px."""
        own = np.array([self.view.left, self.view.top]) + 0.5
        found = np.zeros((STEPS, *front.shape), bool)
        for k, step in enumerate(self.extent * np.linspace(-REACH, REACH, STEPS)):
            at = (self._at(self.ways, front + step) - own).astype(np.float32)
            beside = cv2.remap(
                self.outside, at[..., 0], at[..., 1], cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )  # fmt: skip
            found[k] = beside < BESIDE * self.size
        return found

    def _by_silhouette(self, may: Mask, grid: F64) -> F64:
        """(h, w) px by which the front moves, smoothly, to where it may be."""
        moved = np.zeros(self.inside.shape)
        for _ in range(ROUNDS):
            off = np.where(may, np.abs(grid[:, None, None] - moved), np.inf)
            nearest = off.argmin(0)
            is_any = np.isfinite(np.take_along_axis(off, nearest[None], 0)[0]) & self.inside
            is_any &= np.abs(grid[nearest]) < FARTHEST * self.extent
            lacking = np.where(is_any, grid[nearest] - moved, 0.0)
            lacking = np.where(np.abs(lacking) < 0.5 * (grid[1] - grid[0]), 0.0, lacking)
            moved += self._spread(lacking, np.where(lacking != 0, 1.0, HELD), SPREAD)
        return moved

    def _spread(self, field: F64, weight: F64, width: float) -> F64:
        """(h, w) the mean of `field` around each cell; `width` x extent, standard deviation."""
        sigma, own = width * self.extent / self.cell, weight * self.inside
        total = cv2.GaussianBlur(own, (0, 0), sigma)
        return np.asarray(cv2.GaussianBlur(field * own, (0, 0), sigma) / np.maximum(total, 1e-6))

    def _by_details(self, body: ReliefBody, front: F64) -> F64:
        """(h, w) px by which the sheets move to where the details are that both photos show."""
        outline, matches = body.silhouette, self.view.matches.astype(np.float64)
        at = np.rint(outline.grid_xy(matches[:, :2])).astype(np.int64)
        height, width = front.shape
        column, row = at.clip(0, [width - 1, height - 1]).T
        is_in = ((at >= 0) & (at < [width, height])).all(1) & self.inside[row, column]
        matches, at = matches[is_in], at[is_in]
        if len(matches) < AROUND:
            return np.zeros(front.shape)
        steps = self.extent * np.linspace(-FARTHEST, FARTHEST, 4 * STEPS)
        ways = self.camera.unproject(matches[:, :2], np.ones(len(matches)))
        ways = (ways @ self.view.pose[:3, :3].T)[:, None]
        places = self._at(ways, front[at[:, 1], at[:, 0], None] + steps)
        gaps = np.linalg.norm(places - matches[:, None, 2:], axis=-1)
        best = gaps.argmin(1)
        is_met = (gaps.min(1) < APART_PX * self.size) & (best > 0) & (best < len(steps) - 1)
        at, change = at[is_met], steps[best[is_met]]
        if len(at) < AROUND:
            return np.zeros(front.shape)
        near = KDTree(at).query(at, k=AROUND)[1]
        is_alike = np.abs(change - np.median(change[near], axis=1)) < UNLIKE * self.extent
        sums = np.zeros((*front.shape, 2))
        ones = np.ones(len(change))
        np.add.at(sums, (at[is_alike, 1], at[is_alike, 0]), np.stack([change, ones], -1)[is_alike])
        sigma = DETAIL * self.extent / self.cell
        total, count = np.moveaxis(cv2.GaussianBlur(sums, (0, 0), sigma), -1, 0)
        return total / (count + LIKELY / (2 * np.pi * sigma**2))


def _ends(may: Mask, moved: F64, grid: F64) -> I64:
    """(h, w) index of the last place behind the front at which the surface may still be."""
    step = grid[1] - grid[0]
    now = np.clip(np.rint((moved - grid[0]) / step).astype(np.int64), 0, len(grid) - 1)
    ends, goes_on = now.copy(), np.ones(moved.shape, bool)
    for k in range(1, len(grid)):
        behind = now - k
        own = np.take_along_axis(may, np.maximum(behind, 0)[None], 0)[0]
        goes_on &= (behind >= 0) & own
        ends = np.where(goes_on, behind, ends)
    return ends


def with_views(
    lifted: LiftedObject,
    matte: Matte,
    camera: Camera,
    views: Sequence[FurtherView],
    seed: int = 0,
    invents: bool = True,
) -> LiftedObject:
    """Return `lifted` with the further photos on what they show better than the first, `camera`'s.

    What neither shows is invented in the colours that they have, if it `invents`.
    """
    rest = RestSplats(replace(lifted, sides=None), camera)
    shown = [_Shown.of(lifted, matte, rest, view) for view in views]
    colors = lifted.gaussians.colors.copy()
    for one in shown[::-1]:
        hidden = one.is_seen & (lifted.texture.visibility < SEEN)
        colors[hidden] = one.colors[hidden]
    own = replace(lifted, gaussians=replace(lifted.gaussians, colors=colors), sides=None)
    own = with_sides(own, matte, camera, seed) if invents else own
    for one in _best(shown):
        own = one.carried(own, matte)
    return own


@dataclass(frozen=True, eq=False)
class _Shown:
    """What a further photo shows of a lifted object."""

    view: FurtherView
    pose: F64  # (4, 4) that camera's world from the object
    spots: F64  # (N, 2) px of the cut-out, where each Gaussian is
    cosines: F64  # (N,) of the normals with the way to that camera
    is_seen: Mask  # (N,)
    is_better: Mask  # (N,) and better than by the first photo
    colors: F32  # (N, 3) there, in the light of the first photo
    pixels: F32  # (h, w, 3) likewise

    @staticmethod
    def of(lifted: LiftedObject, matte: Matte, rest: RestSplats, view: FurtherView) -> _Shown:
        pose = view.pose @ lifted.world_from_object
        cut = Matte(view.left, view.top, unit_pixels(view.alpha), unit_pixels(view.pixels))
        world = lifted.gaussians.means @ pose[:3, :3].T + pose[:3, 3]
        texture = replace(
            lifted.texture, u0=view.camera.project(world),
            visibility=np.zeros(len(world), np.float32),
        )  # fmt: skip
        there = replace(
            lifted, world_from_object=pose, texture=texture, sides=None, middle=None, origin=None
        )
        seen = visibilities(there, rest_picture(there, view.camera, cut), cut)
        cosines = RestSplats(there, view.camera).cosines
        spots = texture.u0.astype(np.float64) - [view.left, view.top]
        height, width = view.alpha.shape
        is_in = ((spots > 0.5) & (spots < [width - 0.5, height - 0.5])).all(1)
        is_seen = lifted.is_body & is_in & (seen > SEEN)
        is_well = is_seen & (cosines > WELL)
        colors, pixels = _in_first_light(lifted, matte, rest, cut, spots, is_well)
        is_better = is_seen & (cosines > FACING) & (rest.cosines < RULES.look_aside * cosines)
        return _Shown(view, pose, spots, cosines, is_seen, is_better, colors, pixels)

    def carried(self, lifted: LiftedObject, matte: Matte) -> LiftedObject:
        """Return `lifted` with this photo on the Gaussians that it shows better."""
        own = np.flatnonzero(self.is_better)
        if not len(own):
            return lifted
        count, picture = len(self.spots), np.rint(255 * self.pixels.clip(0, 1)).astype(np.uint8)
        sides = lifted.sides
        if sides is None or not sides.pixels.size:
            shapes = (count, 2), (count, 2, 3), (count,)
            none = [np.zeros(shape, np.float32) for shape in shapes]
            left, top = matte.left, matte.box[3] + GAP
            sides = Sides(picture[:0, :0], left, top, none[0], none[1], none[2])
            pictures, left = [picture], sides.left
        else:
            pictures, left = [sides.pixels, picture], sides.left + sides.pixels.shape[1] + GAP
        at, slopes, zoom = sides.at.copy(), sides.slopes.copy(), sides.zoom.copy()
        # No pixel shows two pictures at once: a mean of places in both would be in neither.
        places, gap = lifted.gaussians.means, BETWEEN * lifted.spacing
        is_near = np.isfinite(KDTree(places[own]).query(places, distance_upper_bound=gap)[0])
        zoom[is_near & ~self.is_better] = 0
        at[own] = self.spots[own] + [left, sides.top]
        world = places[own] @ self.pose[:3, :3].T + self.pose[:3, 3]
        turned = self.pose[:3, :3] @ np.linalg.inv(lifted.world_from_object[:3, :3])
        slopes[own] = projection_jacobians(world, self.view.camera.focal) @ turned
        scale = float(np.cbrt(np.linalg.det(turned)))
        zoom[own] = scale * self.view.camera.focal / world[:, 2]
        real = self.is_better if sides.real is None else sides.real | self.is_better
        pixels = side_by_side(pictures) if len(pictures) > 1 else picture
        where = (field.astype(np.float32) for field in (at, slopes, zoom))
        return replace(lifted, sides=Sides(pixels, sides.left, sides.top, *where, real=real))


def _best(shown: list[_Shown]) -> list[_Shown]:
    """Each Gaussian is carried by the one of the photos that it faces most."""
    facing = np.stack([np.where(one.is_better, one.cosines, -1.0) for one in shown])
    best = facing.argmax(0)
    return [replace(one, is_better=one.is_better & (best == k)) for k, one in enumerate(shown)]


def _in_first_light(
    lifted: LiftedObject, matte: Matte, rest: RestSplats, cut: Matte, spots: F64, is_well: Mask
) -> tuple[F32, F32]:
    """Colours (N, 3) at `spots` (N, 2) of a further cut-out, and (h, w, 3) all of it.

    Under the exposure that makes them most like the first photo's where both show it `is_well`.
    """
    first = lifted.texture.u0.astype(np.float64) - [matte.left, matte.top]
    spacing = rest.spacing_px
    coarse = [cv2.GaussianBlur(m.foreground, (0, 0), max(spacing, 0.5)) for m in (cut, matte)]
    there, here = (
        bilinear(picture, at - 0.5) for picture, at in zip(coarse, (spots, first), strict=True)
    )
    both = is_well & (lifted.texture.visibility > SEEN) & (rest.cosines > WELL)
    pixels = cut.foreground.reshape(-1, 3).astype(np.float64)
    if both.sum() >= LEAST:
        lit = in_light(np.concatenate([there, pixels]), there[both], here[both])
        there, pixels = lit[: len(there)], lit[len(there) :]
    return there.astype(np.float32), pixels.reshape(cut.foreground.shape).astype(np.float32)
