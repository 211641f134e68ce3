"""What an object leaves beside its cut-out in the photo: a toe, a rim, the shadow at its foot.

A selection that misses a little leaves it standing where the object was. Close around the
cut-out, whatever the background farther out cannot explain belongs to the object, if it touches
the cut-out and ends nearby; what goes on beyond is background. How unlike the background a place
may be is measured on the background itself, at the same distance. The shadow at the foot is
looked for in coarser colours, where only the mean of a texture counts.

The plate is invented there, too. It is shown as far as what stands beside it has moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, F64, I64, Mask, Pixels, crop, pixels_from_unit, unit_pixels
from ...base.camera import Camera
from ...base.masks import LARGE, box_of, disc, opened
from ...base.threads import core_count
from ...document.model import Document, EditObject, Matte, Placement, Plate
from ...document.placement import is_in_place
from ...document.settings import GAMMA
from ...document.transparency import colours_of

Box = tuple[int, int, int, int]  # x0, y0, x1, y1 px of the photo

REACH = 3.0  # x hole margin: how far from the cut-out something may be left
ENDS = 0.85  # x reach: what goes on to here is background
AROUND = 2.4  # x reach: the background that a place is compared with
SIDE = 420.0  # px: size of the picture in which residue is looked for
LEAST_REACH = 12.0  # px of that picture
LATTICE = 8.0  # places in a reach, of the lattice on which the background is measured
NEIGHBOURS, MANY = 60, 12_000  # a place is compared with so many that are like it, of so many
NEAREST_SHARE = 0.02  # of the lattice's places: the nearest say what is usual around another one
COARSE = 4  # px of that picture, between the places for which that is worked out
APART = 0.4  # x reach: a place of the background is compared with others that are so far off
STEEP = 6.0  # levels of CIE Lab that a background as far off as the reach costs
USUAL = 0.95  # quantile of what the background costs around a place
TOUCHES = 2.2  # px of that picture: so near to the cut-out is beside it
LEAST = 6  # px of that picture
DARKER = 3.0  # levels of L by which a shadow is darker than what is around
BELOW = 0.3  # mean downwardness of a shadow's places, of [-1, 1]
VISIBLE = 6.0 / 255  # mean difference from the fill: with less nothing would be seen


@dataclass(frozen=True)
class _Look:
    """How colours are compared: blurs in px, and what is more than the background's own cost."""

    blurs: tuple[tuple[float, float], ...]  # standard deviation and weight
    factor: float
    floor: float  # levels of CIE Lab


def find_residue(pixels: Pixels, covered: Mask, margin: float) -> Mask:
    """(H, W) True where the photo (H, W, 3) shows more of what is `covered` (H, W).

    `margin` is the photo's `hole_margin`, px.
    """
    reach, found = REACH * margin, np.zeros_like(covered)
    x0, y0, x1, y1 = box_of(covered, int((AROUND + 0.1) * reach) + 2)
    window = np.s_[y0:y1, x0:x1]
    part, own = pixels[window], covered[window]
    scale = min(1.0, max(SIDE / max(own.shape), LEAST_REACH / reach))
    size = (max(round(own.shape[1] * scale), 1), max(round(own.shape[0] * scale), 1))
    small, hides = _looked_at(part, own, size)
    residue = _Surroundings(small, hides, reach * scale).residue()
    wide = cv2.dilate(residue.astype(np.uint8), np.ones((3, 3), np.uint8))
    large = cv2.resize(wide, own.shape[::-1], interpolation=cv2.INTER_NEAREST)
    found[window] = (large > 0) & ~own
    count, things, stats, _ = cv2.connectedComponentsWithStats(covered.view(np.uint8))
    for k in range(1, count):
        if stats[k, cv2.CC_STAT_AREA] > LEAST_THING**2:
            x, y, w, h = (int(n) for n in stats[k, :4])
            found |= unlit_strip(pixels, np.asarray(things, np.int32) == k, (x, y, x + w, y + h))
    return found & ~covered


def _looked_at(pixels: Pixels, covered: Mask, size: tuple[int, int]) -> tuple[F32, Mask]:
    """The picture (h, w, 3) of this size in which residue is looked for, and what hides it."""
    if covered.size <= LARGE:
        small = cv2.resize(unit_pixels(pixels), size, interpolation=cv2.INTER_AREA)
        share = cv2.resize(covered.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.float32), share > 0
    # In the photo's own levels: as floats all of it would take 12 bytes a pixel.
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    share = cv2.resize(255 * covered.view(np.uint8), size, interpolation=cv2.INTER_AREA)
    return np.divide(small, np.iinfo(pixels.dtype).max, dtype=np.float32), share > 0


# Where a thing meets the ground no light falls: a fill from there would be as dark. That strip is
# far darker than the ground below it, ends soon, and is as wide as a good part of the foot.

LEAST_THING = 40.0  # px, root of the area of a thing whose contact with the ground is looked at
DEEP = 0.18  # x a thing's shorter side: how far below it the strip ends
FOOT = 0.35  # x its height: where it may stand
UNLIT = 0.45  # x the ground's light
WIDE, GOES_ON = 0.3, 0.25  # x the foot's width; of the strip's columns, that may reach farther
CONTACT_SIDE = 300.0  # px: size of the picture in which it is looked for


def unlit_strip(pixels: Pixels, thing: Mask, box: Box) -> Mask:
    """(H, W) the strip without light below a `thing` (H, W) of the photo, which fills a `box`."""
    found, (x0, y0, x1, y1) = np.zeros_like(thing), box
    deep = DEEP * min(x1 - x0, y1 - y0)
    reach = round(deep)
    window = np.s_[y0 : y1 + 3 * reach, max(x0 - reach, 0) : x1 + reach]
    part, own = pixels[window], thing[window]
    scale = min(1.0, CONTACT_SIDE / max(own.shape))
    size = (max(round(own.shape[1] * scale), 1), max(round(own.shape[0] * scale), 1))
    small = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    small = np.divide(small, np.iinfo(pixels.dtype).max, dtype=np.float32)
    light = np.asarray((small**GAMMA).mean(-1), np.float32)
    covered = cv2.resize(own.view(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA) > 0
    strip = _unlit(light, covered, max(round(deep * scale), 3))
    wide = cv2.dilate(strip.astype(np.uint8), disc(2))
    large = cv2.resize(wide, own.shape[::-1], interpolation=cv2.INTER_NEAREST)
    found[window] = large > 0
    return found


def _unlit(light: F32, covered: Mask, deep: int) -> Mask:
    """(h, w) the strip of little `light` (h, w) up to `deep` px below what is `covered` (h, w)."""
    rows = np.arange(len(light))[:, None]
    above = np.maximum.accumulate(np.where(covered, rows, -len(light)), axis=0)
    lowest, strip = above[-1], np.zeros_like(covered)
    if (ground := _ground_light(light, covered, lowest, deep)) is None:
        return strip
    foot = lowest.max() - FOOT * (lowest.max() - np.argmax(covered.any(1)))
    dark = ~covered & (rows - above <= deep) & (light < UNLIT * ground)
    dark = opened(dark).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(dark, connectivity=8)
    touched = cv2.dilate(covered.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    least = WIDE * np.count_nonzero(lowest >= foot)
    for k in range(1, count):
        piece, width = np.asarray(labels, np.int32) == k, stats[k, cv2.CC_STAT_WIDTH]
        goes_on = np.count_nonzero(piece & (rows - above >= deep - 1))
        if width >= least and goes_on <= GOES_ON * width and (piece & touched).any():
            strip |= piece & (rows >= foot)
    return strip


def _ground_light(light: F32, covered: Mask, lowest: I64, deep: int) -> F32 | None:
    """(w,) the usual `light` (h, w) of the ground in each column, or None.

    It is measured from `deep` to three times as many px below the `lowest` row (w,) of what is
    `covered` (h, w), which is negative in a column where nothing is.
    """
    ground = np.full(len(lowest), np.nan, np.float32)
    for k in range(len(lowest)):
        near = slice(max(k - deep, 0), k + deep + 1)
        if len(around := lowest[near][lowest[near] >= 0]):
            first = int(np.median(around)) + deep
            part = np.s_[first : first + 2 * deep, near]
            if np.count_nonzero(~covered[part]) > LEAST:
                ground[k] = np.median(light[part][~covered[part]])
    known = np.flatnonzero(np.isfinite(ground))
    if not len(known):
        return None
    whole = np.interp(np.arange(len(ground)), known, ground[known]).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(whole[None], (0, 0), deep)[0], np.float32)


class _Surroundings:
    """A small picture around what is covered."""

    def __init__(self, rgb: F32, covered: Mask, reach: float) -> None:
        self._lab = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB), np.float32)
        self._known, self._reach = (~covered).astype(np.float32), reach
        self._away = cv2.distanceTransform((~covered).astype(np.uint8), cv2.DIST_L2, 5)
        self._band = (self._away > 0) & (self._away <= reach)
        self._ring = (self._away > reach) & (self._away <= AROUND * reach)

    def residue(self) -> Mask:
        """(h, w) what the background does not explain."""
        found = np.zeros_like(self._band)
        if np.count_nonzero(self._ring) <= NEIGHBOURS or not self._band.any():
            return found
        is_darker = self._blurred(1.5)[..., 0] < self._usual()[..., 0] - DARKER
        fine = self._unexplained(_Look(((0.8, 1.0), (2.0, 0.7)), 1.6, 5.0))
        coarse = self._unexplained(_Look(((self._reach / 7, 1.0),), 1.3, 4.5))
        dark = fine & is_darker
        for part in (fine, dark, fine & ~is_darker):
            found |= self._attached(part, is_shadow=False)
        for part in (coarse & is_darker, (coarse & is_darker) | dark):
            found |= self._attached(part, is_shadow=True)
        return found & self._band

    def _blurred(self, sigma: float) -> F32:
        share = cv2.GaussianBlur(self._known, (0, 0), sigma)
        mean = cv2.GaussianBlur(self._lab * self._known[..., None], (0, 0), sigma)
        return np.asarray(mean / np.maximum(share, 1e-3)[..., None], np.float32)

    def _usual(self) -> F32:
        """(h, w, 3) the background's colour around each place."""
        ring, total = self._ring.astype(np.float32), np.zeros(self._ring.shape, np.float32)
        mean = np.zeros_like(self._lab)
        for n, sigma in enumerate((2.0, 4.0, 8.0, 16.0, 32.0)):
            share = np.float32(100.0**-n)
            total += share * cv2.GaussianBlur(ring, (0, 0), sigma)
            mean += share * cv2.GaussianBlur(self._lab * ring[..., None], (0, 0), sigma)
        return np.asarray(mean / np.maximum(total, 1e-12)[..., None], np.float32)

    def _unexplained(self, look: _Look) -> Mask:
        """(h, w) where the colours are farther from the background's than it is from itself."""
        rows, columns = np.indices(self._band.shape, np.float32) * (STEEP / self._reach)
        colours = [weight * self._blurred(sigma) for sigma, weight in look.blurs]
        features = np.dstack([*colours, rows, columns])
        tree = KDTree(features[self._ring])
        limit = look.factor * self._own_costs(features) + look.floor
        result = np.zeros_like(self._band)
        result[self._band] = tree.query(features[self._band], workers=core_count())[0] > limit
        return result

    def _own_costs(self, features: F32) -> F64:
        """(N,) what the background around each place of the band usually costs itself.

        A place whose like is all close by counts as the dearest.
        """
        lattice = np.zeros_like(self._ring)
        lattice[(np.s_[:: max(int(self._reach / LATTICE), 1)],) * 2] = True
        there = self._ring & lattice
        if np.count_nonzero(there) <= NEIGHBOURS:
            there = self._ring
        probes, here = np.argwhere(there), features[there]
        alike = max(round(len(probes) * NEIGHBOURS / min(self._ring.sum(), MANY)), 2)
        costs, which = KDTree(here).query(here, k=alike, workers=core_count())
        gaps = np.linalg.norm(probes[which] - probes[:, None], axis=-1)
        costs = np.where(gaps > APART * self._reach, costs, np.inf).min(1)
        is_known = np.isfinite(costs)
        costs[~is_known] = costs[is_known].max(initial=0.0)
        return self._around(costs, probes)

    def _around(self, costs: F64, probes: I64) -> F64:
        """(N,) the usual one of the `costs` of the `probes` nearest to each place of the band."""
        height, width = self._band.shape
        rows, columns = np.arange(0, height + COARSE, COARSE), np.arange(0, width + COARSE, COARSE)
        near = cv2.dilate(self._band.view(np.uint8), np.ones((2 * COARSE + 1,) * 2, np.uint8))
        inner = np.minimum(rows, height - 1)[:, None], np.minimum(columns, width - 1)
        used = np.argwhere(near[inner] > 0)
        count = min(max(round(NEAREST_SHARE * len(probes)), NEIGHBOURS), len(probes))
        which = KDTree(probes).query(used * COARSE, k=count, workers=core_count())[1]
        grid = np.zeros((len(rows), len(columns)))
        rank = int(USUAL * (count - 1))
        grid[tuple(used.T)] = np.partition(costs[which.reshape(-1, count)], rank)[:, rank]
        y, x = (np.argwhere(self._band) / COARSE).T
        i, j = y.astype(int), x.astype(int)
        left, right = (grid[i, n] + (y - i) * (grid[i + 1, n] - grid[i, n]) for n in (j, j + 1))
        return np.asarray(left + (x - j) * (right - left))

    def _attached(self, part: Mask, is_shadow: bool) -> Mask:
        """(h, w) the pieces of `part` that touch what is covered, and end within reach."""
        closed = cv2.morphologyEx(part.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
        labels = np.asarray(labels, np.int32)
        keeps = np.zeros(count, bool)
        keeps[np.unique(labels[(self._away > 0) & (self._away <= TOUCHES)])] = True
        keeps &= stats[:, cv2.CC_STAT_AREA] >= LEAST
        keeps[np.unique(labels[self._away > ENDS * self._reach])] = False
        if is_shadow:  # it lies at the foot
            down = cv2.Sobel(self._away, cv2.CV_32F, 0, 1, scale=1 / 8)
            sums = np.bincount(labels.ravel(), down.ravel(), count)
            keeps &= sums > BELOW * stats[:, cv2.CC_STAT_AREA]
        keeps[0] = False
        return keeps[labels]


def visible_residue(residue: Mask, photo: Pixels, fill: Pixels) -> Mask:
    """The pieces of a residue (h, w) that would be seen: they differ from what was filled in."""
    count, labels = cv2.connectedComponents(residue.astype(np.uint8), connectivity=8)
    labels = np.asarray(labels, np.int32)
    unlike = np.abs(unit_pixels(photo[residue]) - unit_pixels(fill[residue])).mean(-1)
    sums = np.bincount(labels[residue], unlike, count)
    keeps = sums > VISIBLE * np.bincount(labels[residue], minlength=count)
    return residue & keeps[labels]


# How much of it is shown: as much as what stands beside it has moved.

MOVED = (1.0, 6.0)  # px of the photo: from here on it begins to be shown, and from here it is
STEPS = 4  # in which it appears
NEAREST = 4  # control points that say how what stands beside it has moved
SHADE, TINTED = 0.25, 0.4  # tint, up to which a ghost is a shadow, and up to which it may be one
BLACK = 0.02  # of sRGB's range, added before ratios are taken


@dataclass(frozen=True, eq=False)
class Ghost:
    """A piece of residue in a plate, and what it is part of."""

    box: Box  # px of the plate
    there: Mask  # (h, w) of the box
    owner: int  # index of the object beside it
    points: I64  # the object's control points that are nearest; empty where it is not lifted
    tint: float  # see `tint_of`; infinite where it is not darker than the plate

    @property
    def may_be_shade(self) -> bool:
        """Whether it may be the object's shadow."""
        return self.tint < TINTED


def find_ghosts(document: Document, near: float) -> tuple[Ghost, ...]:
    """The residue in the document's plate: what is invented there farther than `near` px away.

    So the plate of an older session, or one that was only repaired by hand, has none.
    """
    plate = document.plate
    if plate is None:
        return ()
    away = [_away(item, plate.box) for item in document.objects]
    known = [px for px in away if px is not None]
    if not away:
        return ()
    beside = plate.hole.copy()
    for px in known:  # one after the other: each is as large as the photo
        beside &= px >= near
    if plate.painted is not None:
        beside &= ~plate.painted
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        beside.astype(np.uint8), connectivity=8
    )
    labels, ghosts = np.asarray(labels, np.int32), []
    for n in range(1, count):
        x0, y0, width, height = (int(v) for v in stats[n, : cv2.CC_STAT_AREA])
        box = (x0, y0, x0 + width, y0 + height)
        inner = (slice(y0, box[3]), slice(x0, box[2]))
        there = labels[inner] == n
        gaps = [px if px is None else np.where(there, px[inner], np.inf) for px in away]
        owner = int(np.argmin([np.inf if gap is None else gap.min() for gap in gaps]))
        nearest = 0 if (gap := gaps[owner]) is None else int(np.argmin(gap))
        row, column = np.unravel_index(nearest, there.shape)
        foot = np.array([column + x0 + plate.left, row + y0 + plate.top])
        points = _nearest_points(document.objects[owner], document.photo.camera, foot)
        ghosts.append(Ghost(box, there, owner, points, _tint(document, plate, box, there)))
    return tuple(ghosts)


def _tint(document: Document, plate: Plate, box: Box, there: Mask) -> float:
    """Return `Ghost.tint` of what is `there` (h, w) in a box of the plate."""
    x0, y0, x1, y1 = box
    photo = colours_of(document.photo.picture)[plate.top : plate.box[3], plate.left : plate.box[2]]
    seen, behind = (
        unit_pixels(image[y0:y1, x0:x1][there]).mean(0) + BLACK for image in (photo, plate.pixels)
    )
    change = np.log(seen / behind)
    return float(tint_of(change)) if change.max() < 0 else np.inf


def tint_of(darker: np.ndarray) -> np.ndarray:
    """Return how unlike the channels (..., 3) of a darkening are, over their mean.

    `darker`: logarithms of ratios, 0 and less.
    """
    return np.asarray(np.ptp(darker, axis=-1) / np.maximum(-darker.mean(-1), 1e-6))


def _away(item: EditObject, box: Box) -> F32 | None:
    """(h, w) px of the box to what an object covers; None where that is nothing."""
    matte = item.matte_here
    if matte is None:
        return None
    bare = ~crop(matte.alpha > 0, matte.box, box)
    if bare.all():
        return None
    return np.asarray(cv2.distanceTransform(bare.view(np.uint8), cv2.DIST_L2, 5), np.float32)


def _nearest_points(item: EditObject, camera: Camera, foot: F64 | I64) -> I64:
    if item.lifted is None:
        return np.empty(0, np.int64)
    rest = camera.project(item.lifted.world_points(item.lifted.control_points))
    return np.argsort(np.linalg.norm(rest - foot, axis=1))[:NEAREST]


def keeps_shade(item: EditObject, document: Document) -> bool:
    """Whether it still stands where it did, however turned: its shadow there is about right."""
    return item.is_visible and item.shadow.strength == 0 and is_in_place(item, document)


def shown_shares(
    document: Document, ghosts: Sequence[Ghost], holes: Sequence[Matte]
) -> tuple[float, ...]:
    """In [0, 1] how much of each ghost is gone; `holes` are where objects were and are not.

    The shadow of what is turned where it stands goes only as far as a pose moves what is beside.
    """
    shares = []
    for ghost in ghosts:
        item, camera = document.objects[ghost.owner], document.photo.camera
        px = 0.0
        if _has_left(item, holes):
            stays = _stays(ghost, document)
            px = _moved_by(replace(item, placement=Placement()) if stays else item, camera, ghost)
        share = np.clip((px - MOVED[0]) / (MOVED[1] - MOVED[0]), 0, 1)
        shares.append(float(np.rint(share * STEPS) / STEPS))
    return tuple(shares)


def _has_left(item: EditObject, holes: Sequence[Matte]) -> bool:
    """Whether an object is no more where it was in the photo; `holes` as above."""
    return any(item.matte is hole for hole in holes)


def without_ghosts(
    plate: Plate, document: Document, ghosts: Sequence[Ghost], holes: Sequence[Matte]
) -> Plate:
    """The plate without the ghosts that go with what has left, however far that is by now."""
    photo, objects = colours_of(document.photo.picture), document.objects
    goes = [_has_left(objects[g.owner], holes) and not _stays(g, document) for g in ghosts]
    return with_ghosts(plate, photo, ghosts, [float(each) for each in goes])


def _stays(ghost: Ghost, document: Document) -> bool:
    """Whether it is the shadow of what only turns where it stands."""
    return ghost.may_be_shade and keeps_shade(document.objects[ghost.owner], document)


def _moved_by(item: EditObject, camera: Camera, ghost: Ghost) -> float:
    """Px by which the object's control points beside a ghost are not where they were; the most."""
    if not item.is_visible:
        return np.inf
    if item.lifted is None:
        return 0.0
    rest = item.lifted.control_points[ghost.points].astype(np.float64)
    posed = rest if item.pose is None else item.pose.points[ghost.points]
    motion = item.placement.matrix(item.lifted, camera)
    world = item.lifted.world_points(posed) @ motion[:3, :3].T + motion[:3, 3]
    if (world[:, 2] <= 0).any():
        return np.inf
    gaps = camera.project(world) - camera.project(item.lifted.world_points(rest))
    return float(np.linalg.norm(gaps, axis=1).max(initial=0.0))


def with_ghosts(
    plate: Plate, photo: Pixels, ghosts: Sequence[Ghost], shares: Sequence[float]
) -> Plate:
    """The plate with so much of each ghost taken away, wherever the edit reaches."""
    if not ghosts:
        return plate
    pixels, hole = plate.pixels.copy(), plate.hole.copy()
    painted = np.zeros_like(hole) if plate.painted is None else plate.painted.copy()
    behind = photo[plate.top : plate.box[3], plate.left : plate.box[2]]
    for ghost, share in zip(ghosts, shares, strict=True):
        x0, y0, x1, y1 = ghost.box
        inner, there = (slice(y0, y1), slice(x0, x1)), ghost.there
        if share < 1:
            old, new = unit_pixels(behind[inner][there]), unit_pixels(pixels[inner][there])
            mixed = pixels_from_unit(old + share * (new - old), pixels.dtype)
            pixels[inner][there] = mixed
        hole[inner][there] = share > 0
        painted[inner][there] = share > 0
    return replace(plate, pixels=pixels, hole=hole, painted=painted if painted.any() else None)


def with_refused(plate: Plate, document: Document, near: float) -> Plate:
    """The plate with what the artist took out of a selection: the photo, and no residue.

    That is what was erased, and each piece that holds a click which says that it does not belong.
    """
    objects, left, top = document.objects, plate.left, plate.top
    clicks = [c for o in objects for c in o.prompt.clicks if not c.is_foreground]
    erased = np.zeros_like(plate.hole)
    for item in objects:
        if item.found is not None and item.mask is not None:
            erased |= (item.found & ~item.mask)[top : plate.box[3], left : plate.box[2]]
    if not clicks and not erased.any():
        return plate
    refused = []
    for ghost in find_ghosts(replace(document, plate=plate), near):
        x0, y0, x1, y1 = ghost.box
        places = [(int(c.y) - top - y0, int(c.x) - left - x0) for c in clicks]
        inside = [(y, x) for y, x in places if 0 <= y < y1 - y0 and 0 <= x < x1 - x0]
        is_all = any(ghost.there[place] for place in inside)
        there = ghost.there if is_all else ghost.there & erased[y0:y1, x0:x1]
        if there.any():
            refused.append(replace(ghost, there=there))
    return with_ghosts(plate, colours_of(document.photo.picture), refused, [0.0] * len(refused))


# What of it may be a part of the object, to be added to its selection.

LEAST_PART = 1.5  # x hole margin, squared: a smaller piece is hardly worth a question


def left_out(document: Document, ghosts: Sequence[Ghost], margin: float) -> tuple[Ghost, ...]:
    """The ghosts that look like a part of their object rather than like its shadow.

    `margin` is the photo's `hole_margin`, px.
    """
    if document.plate is None:
        return ()
    least = (LEAST_PART * margin) ** 2
    return tuple(g for g in ghosts if np.count_nonzero(g.there) >= least and g.tint >= SHADE)


def with_parts(mask: Mask, document: Document, parts: Sequence[Ghost], margin: float) -> Mask:
    """A selection (H, W) with those pieces added, and joined to it.

    Of a piece only that is added which the background does not look like: it has a seam around it.
    """
    grown = mask.copy()
    for part in parts:
        grown[_in_photo(part, document)] |= _unlike_fill(part, document)
    added = grown & ~mask
    reach = int(np.ceil(margin)) + 1
    near = disc(reach)
    joined = cv2.morphologyEx(grown.astype(np.uint8), cv2.MORPH_CLOSE, near) > 0
    return grown | (joined & (cv2.dilate(added.astype(np.uint8), near) > 0))


def _in_photo(ghost: Ghost, document: Document) -> tuple[slice, slice]:
    """Rows and columns of the photo."""
    plate = document.plate
    assert plate is not None, "pieces are of a plate"
    x0, y0, x1, y1 = ghost.box
    return slice(plate.top + y0, plate.top + y1), slice(plate.left + x0, plate.left + x1)


def _unlike_fill(ghost: Ghost, document: Document) -> Mask:
    """(h, w) of its box: the px that show it, and not the seam around it."""
    plate, (x0, y0, x1, y1) = document.plate, ghost.box
    assert plate is not None, "pieces are of a plate"
    seen = colours_of(document.photo.picture)[_in_photo(ghost, document)]
    unlike = np.abs(unit_pixels(seen) - unit_pixels(plate.pixels[y0:y1, x0:x1])).max(-1)
    return ghost.there & (cv2.blur(unlike, (3, 3)) > 2 * VISIBLE)


# What of it an edit takes away: those who do not see the photo while they edit are to know.

LIKE = 6.0  # levels of CIE Lab, between a px and the nearest of its object's colours
MOSTLY, OWN = 0.9, 0.4  # shares of a part's px that are so like, and nearer than the background's
COLORS = 3_000  # px whose colours stand for all


@dataclass(frozen=True)
class Erased:
    """What is taken off the photo beside an object's outline."""

    owner: int  # index of the object
    px: int  # that anybody would see
    like_px: int  # of these, in pieces that look like parts of the object rather than shadows
    place: tuple[int, int]  # x, y px of the photo, inside the largest piece: like it, if any is


def erased_by(
    document: Document, ghosts: Sequence[Ghost], shares: Sequence[float], margin: float
) -> tuple[Erased, ...]:
    """What is gone of the ghosts, whose `shares` are shown, by its object; nothing small.

    `margin` is the photo's `hole_margin`, px.
    """
    parts, least = left_out(document, ghosts, margin), (LEAST_PART * margin) ** 2
    gone = [g for g, share in zip(ghosts, shares, strict=True) if share > 0]
    found = []
    for owner in sorted({g.owner for g in gone}):
        pieces = [(g, _unlike_fill(g, document)) for g in gone if g.owner == owner]
        like = [(g, own) for g, own in pieces if g in parts and is_like_owner(g, document, margin)]
        px, like_px = (sum(int(own.sum()) for _, own in some) for some in (pieces, like))
        if px >= least:
            place = _inmost(max(like or pieces, key=lambda piece: piece[1].sum()), document)
            found.append(Erased(owner, px, like_px, place))
    return tuple(found)


def is_like_owner(ghost: Ghost, document: Document, margin: float) -> bool:
    """Whether enough shows it, and has colours of its object's own; `margin` as in `left_out`."""
    own = _unlike_fill(ghost, document)
    photo, plate = colours_of(document.photo.picture), document.plate
    mask = document.objects[ghost.owner].mask
    if mask is None or plate is None or own.sum() < (LEAST_PART * margin) ** 2:
        return False
    seen = _colors(photo[_in_photo(ghost, document)], own)
    to_own, to_fill = (
        KDTree(colors).query(seen)[0]
        for colors in (_colors(photo, mask), _colors(plate.pixels, plate.hole))
    )
    return float((to_own < LIKE).mean()) >= MOSTLY and float((to_own < to_fill).mean()) >= OWN


def _colors(pixels: Pixels, there: Mask) -> F32:
    """(n, 3) CIE Lab of some px that are `there` (h, w)."""
    places = np.flatnonzero(there)
    rows, columns = np.unravel_index(places[:: len(places) // COLORS + 1], there.shape)
    rgb = unit_pixels(pixels[rows, columns])
    return np.asarray(cv2.cvtColor(rgb[None], cv2.COLOR_RGB2LAB)[0], np.float32)


def _inmost(piece: tuple[Ghost, Mask], document: Document) -> tuple[int, int]:
    """x, y px of the photo."""
    ghost, own = piece
    depth = cv2.distanceTransform(np.pad(own, 1).astype(np.uint8), cv2.DIST_L2, 5)
    row, column = np.unravel_index(int(depth.argmax()), depth.shape)
    rows, columns = _in_photo(ghost, document)
    return int(column) - 1 + columns.start, int(row) - 1 + rows.start
