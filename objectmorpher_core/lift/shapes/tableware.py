"""Bodies by their rims: plates and bowls that lie as their rim does, and cups on saucers.

What stands in a dish is a solid of its own, about the same axis; behind it the dish goes on.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F64, I64, U8, Mask, Pixels
from ...base.camera import Camera
from ...base.masks import disc
from ...base.poisson_disk import nearest_in
from ...pictures.image import to_u8
from .. import LiftSubject
from ..relief.body import ReliefBody
from ..relief.cuts import Behind, Cuts
from ..relief.integration import solved
from ..relief.shape_look import SeenShape
from ..relief.silhouette import ReliefSilhouette
from .evidence import Evidence
from .rims import Rim, at_edge
from .solids import AROUND, FINE, Mesh, RayGrid, drawn, revolved

CLOSED = 3.0  # cells from the outline, within which nothing lies behind what stands
NEAR = 1.5  # cells from a rim's picture, where the front is on it
WHOLE = 0.8  # share of an outline that is on its rim, from which all lies within it
EVENED = 0.1  # x its radius: so far from its rim it becomes the rim's circle
AMID = 0.5  # x the arch's height, from where on thickness is compared
LEAST_KNOWN = 60  # cells on rims
PULL = 100.0  # x a step's weight, that a place on a rim has
SOLVING = 300, 1e-4  # rounds of conjugate gradients, and when the residual is small enough
DISH = 0.07, 0.05  # x its radius: how deep a dish is, and how thick
FEET, BULGES = (0.35, 0.5, 0.65, 0.8, 0.95), (1.0, 0.5, 0.25)  # x the lip's radius; exponents
BAND = 0.06  # x the lip's radius, within which a vessel ends at the photo's edge
AROUND_SHARE = 0.15  # x its radius: how much a way around an axis counts beside one along it
RINGS, USUAL = 16, 60  # rings in a rim's radius, and percent of each that look alike
CLEAR = 9  # cells from where a part ends, nearer to which colours are mixed
LEAST_STEP = 0.02  # x extent, over which a cut falls


def laid(
    body: ReliefBody, rims: list[Rim], seen: SeenShape, subject: LiftSubject, thickness: float
) -> ReliefBody:
    """`body`, whose thickness was multiplied by `thickness`, as its rims lie.

    How far away the whole is, the body decides.
    """
    stack = None
    body = replace(body, up=rims[0].up)
    if len(rims) > 1:
        rims = [rims[0], at_edge(rims[0], rims[1], subject.pixels, subject.mask, subject.camera)]
        stack = Stack.of(body, rims, seen, subject)
    if stack is not None:
        return _stacked(body, rims, stack, subject, thickness)
    camera = subject.camera
    outline = body.silhouette
    tangents, before = _front(body, camera)
    known = _along(rims[0], tangents, outline, camera)
    if known.sum() < LEAST_KNOWN:
        return body
    change = np.where(known, np.log(rims[0].depth(tangents)) - before, 0.0)
    at = np.concatenate([tangents, np.ones((*outline.shape, 1))], -1)
    whole = at @ np.linalg.lstsq(at[known], change[known])[0]
    rest = np.where(known, change - whole, 0.0)
    inside, zero = outline.inside.astype(np.float64), np.zeros(outline.shape)
    steps = (
        np.pad(inside[1:] * inside[:-1], ((0, 1), (0, 0))),
        np.pad(inside[:, 1:] * inside[:, :-1], ((0, 0), (0, 1))),
    )
    rest = rest + solved(rest, PULL * known, zero, zero, *steps, *SOLVING)
    after = before + whole + rest.ravel()[nearest_in(outline.inside)]
    after += float(np.median((before - after)[outline.inside]))
    body = replace(body, middle=body.middle + np.exp(before) - np.exp(after))
    edge = outline.inside & (outline.depth < NEAR * outline.cell)
    is_whole = (known & edge).sum() > WHOLE * edge.sum()
    return _bottomed(body, rims[0], tangents, camera.focal) if is_whole else body


def _bottomed(body: ReliefBody, rim: Rim, tangents: F64, focal: float) -> ReliefBody:
    """`body`, all of which lies within its rim, with one arch beneath it.

    It is as deep as the body is thick. What is seen stays, but for what is nearly on the rim.
    """
    outline = body.silhouette
    at = outline.cells.reshape(-1, 2)
    before, behind = (side.half(at).reshape(outline.shape) for side in (body.front, body.back))
    inward = -rim.outside(tangents) * rim.centre[2] / rim.radius  # from 0 at the rim to 1
    arch = 1 - (1 - np.clip(inward, 0, 1)) ** 2
    amid, ring = outline.inside & (arch > AMID), outline.inside & (inward < EVENED)
    if not (amid.any() and ring.any()):
        return body
    half = 0.5 * float(np.median(((before + behind) / np.maximum(arch, AMID))[amid])) * arch
    front, plane = np.log(focal - body.middle - before), np.log(rim.depth(tangents))
    off = front - plane
    level = float(np.median(off[ring]))
    share = np.clip(inward / EVENED, 0, 1) * outline.inside
    front = focal - np.exp(plane + level + share * (off - level))
    sides = [side.towards(half, np.ones(outline.shape)) for side in (body.front, body.back)]
    return replace(body, middle=front - half, front=sides[0], back=sides[1])


def _front(body: ReliefBody, camera: Camera) -> tuple[F64, F64]:
    """(h, w, 2) tangents of a body's cells, and (h, w) the logarithms of its front's depths, px."""
    outline = body.silhouette
    tangents = (outline.photo_xy(outline.cells) - [camera.cx, camera.cy]) / camera.focal
    half = body.front.half(outline.cells.reshape(-1, 2)).reshape(outline.shape)
    return tangents, np.log(camera.focal - body.middle - half)


def _along(rim: Rim, tangents: F64, outline: ReliefSilhouette, camera: Camera) -> Mask:
    """(h, w) where the outline is on a rim."""
    cell = outline.cell / camera.focal
    is_on = outline.inside & (np.abs(rim.outside(tangents)) < NEAR * cell)
    return is_on & (outline.depth < 2 * NEAR * outline.cell)


class Stack(NamedTuple):
    """A dish and what stands in it, fields (h, w); depths are logarithms of px."""

    stands: Mask
    lies: Mask  # where the dish is, also behind what stands in it
    near: F64
    far: F64
    vessel_far: F64  # of what stands
    dish_near: F64  # also where it is hidden

    @staticmethod
    def of(
        body: ReliefBody, rims: list[Rim], seen: SeenShape, subject: LiftSubject
    ) -> Stack | None:
        """None where nothing stands before the dish."""
        outline, camera = body.silhouette, subject.camera
        tangents, before = _front(body, camera)
        start = (float(tangents[0, 0, 0]), float(tangents[0, 0, 1]))
        grid = RayGrid(start, outline.cell / camera.focal, outline.shape)
        dish = drawn(_dish(rims[0], FINE), grid)
        vessel = drawn(_vessel(rims, Evidence.of(seen)), grid)
        stands = outline.inside & (vessel.near > np.maximum(dish.near, 1e-9))
        lies = outline.inside & (dish.near > 0)
        wide = rims[1].radius / rims[1].centre[2] * camera.focal  # px
        stands = _edged(stands, outline, BAND * wide, subject.pixels)
        # Where what stands is the object's outline it closes: no wall reaches to the dish behind.
        lies &= ~(stands & (outline.depth < CLOSED * outline.cell))
        if (stands & lies).sum() < LEAST_KNOWN:
            return None
        vessel_near, vessel_far = (_log_depth(part) for part in (vessel.near, vessel.far))
        dish_near, dish_far = (_log_depth(part) for part in (dish.near, dish.far))
        near = np.where(stands, vessel_near, dish_near)
        near += _hollow(rims[1], tangents, before, outline)
        far = np.maximum(np.where(lies, dish_far, vessel_far), near)
        known = stands | lies
        nearest = nearest_in(known)  # what sticks out, and what is around, goes on
        near, far = near.ravel()[nearest], far.ravel()[nearest]
        stands = outline.inside & stands.ravel()[nearest]
        plane = np.log(rims[0].depth(tangents))
        beyond = _touching(outline.inside & ~known, lies & ~stands)  # a spoon beside the lip
        nearest = nearest_in(outline.inside)
        near, far = (np.where(beyond, plane, part).ravel()[nearest] for part in (near, far))
        stands, lies = stands & ~beyond, lies | beyond
        # It closes at its limb: no wall stands there.
        beside = cv2.dilate((outline.inside & ~stands).astype(np.uint8), np.ones((5, 5))) > 0
        vessel_far = np.where(stands & beside, near, np.maximum(vessel_far, near))
        away = float(np.median((before - near)[outline.inside]))
        return Stack(stands, lies, near + away, far + away, vessel_far + away, dish_near + away)

    def behind(self, rims: list[Rim], outline: ReliefSilhouette, subject: LiftSubject) -> Behind:
        """Return what the stack hides, in the colours of what is like it about the axis."""
        camera = subject.camera
        tangents = (outline.photo_xy(outline.cells) - [camera.cx, camera.cy]) / camera.focal
        away = float(np.median((self.dish_near - np.log(rims[0].depth(tangents)))[self.lies]))
        stem, _ = _stem(rims)
        wall_seen, back, seen, dish = (
            Around.of(rim, tangents, depth - away)
            for rim, depth in (
                (stem, self.near), (stem, self.vessel_far),
                (rims[0], self.near), (rims[0], self.dish_near),
            )
        )  # fmt: skip
        photo, hidden = _photo(outline, subject.pixels), self.stands & self.lies
        is_wall = self.stands & (rims[1].outside(tangents) > 0)
        clear = disc(CLEAR)
        wall, plain = (
            _usual(cv2.erode(own.astype(np.uint8), clear) > 0, level, photo)
            for own, level in (
                (is_wall, wall_seen.height),
                (self.lies & ~self.stands, seen.radius),
            )
        )
        own_back, front = (
            np.where(hidden, camera.focal - np.exp(depth), np.nan)
            for depth in (self.vessel_far, self.dish_near)
        )
        return Behind(
            own_back, front,
            wall_seen.nearest(back, wall, hidden, "height"),
            seen.nearest(dish, plain, hidden, "radius"),
            self.stands,
            np.where(
                is_wall[..., None],
                wall_seen.nearest(wall_seen, wall, is_wall, "height"),
                _nearest(outline.inside & ~self.stands, clear),
            ),
        )  # fmt: skip


def _stacked(
    body: ReliefBody, rims: list[Rim], stack: Stack, subject: LiftSubject, thickness: float
) -> ReliefBody:
    """`body` as a dish and what stands in it."""
    outline, focal = body.silhouette, subject.camera.focal
    front, back = (focal - np.exp(depth) for depth in (stack.near, stack.far))
    half, share = 0.5 * (front - back), np.ones(outline.shape)
    cuts = _cuts([(front, stack.stands), (back, stack.stands & ~stack.lies)], outline)
    sides = [
        replace(side.towards(thickness * half, share), cuts=cuts)
        for side in (body.front, body.back)
    ]
    return replace(
        body, middle=front - half, front=sides[0], back=sides[1], cuts=cuts, kind="round",
        behind=stack.behind(rims, outline, subject),
    )  # fmt: skip


def _touching(where: Mask, other: Mask) -> Mask:
    """(h, w) the pieces of `where` (h, w) that lie beside `other` (h, w)."""
    _, pieces = cv2.connectedComponents(where.astype(np.uint8))
    beside = cv2.dilate(other.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return where & np.isin(pieces, np.unique(np.asarray(pieces)[where & beside]))


def _log_depth(inverse: F64) -> F64:
    """(h, w) logarithm of the depth, where nothing is hit that of the nearest hit."""
    return -np.log(inverse.ravel()[nearest_in(inverse > 0)])


def _edged(stands: Mask, outline: ReliefSilhouette, reach: float, pixels: Pixels) -> Mask:
    """`stands` (h, w) up to the photo's own edge, within `reach` px of its outline."""
    photo = _photo(outline, pixels)
    band = disc(round(reach / outline.cell))
    own = stands.astype(np.uint8)
    labels = np.zeros(stands.shape, np.int32)
    labels[cv2.erode(own, band) > 0] = 1
    labels[(cv2.dilate(own, band) == 0) & outline.inside] = 2
    found = np.asarray(cv2.watershed(photo, labels))
    return outline.inside & np.where(found > 0, found == 1, stands)


def _nearest(own: Mask, clear: np.ndarray) -> I64:
    """(h, w, 2) columns and rows of the nearest cells well within a part's `own` (h, w)."""
    inner = cv2.erode(own.astype(np.uint8), clear) > 0
    rows, columns = np.divmod(nearest_in(inner if inner.any() else own), own.shape[1])
    return np.stack([columns, rows], -1)


def _photo(outline: ReliefSilhouette, pixels: Pixels) -> U8:
    """(h, w, 3) the photo on a silhouette's cells."""
    at = outline.photo_xy(outline.cells)
    j, i = (at[..., k].astype(int).clip(0, pixels.shape[1 - k] - 1) for k in (0, 1))
    return np.ascontiguousarray(to_u8(pixels)[i, j])


def _usual(mask: Mask, level: F64, photo: U8) -> Mask:
    """`mask` (h, w) without what looks different from most that is on the same `level` (h, w)."""
    found = np.zeros(mask.shape, bool)
    ring = (level * RINGS).astype(int)
    for own in np.unique(ring[mask]):
        is_own = mask & (ring == own)
        colours = photo[is_own].astype(np.float64)
        off = np.abs(colours - np.median(colours, 0)).sum(1)
        found[is_own] = off <= np.percentile(off, USUAL)
    return found


class Around(NamedTuple):
    """Places (h, w) about an axis, x its rim's radius."""

    height: F64
    radius: F64
    angle: F64  # radians

    @staticmethod
    def of(rim: Rim, tangents: F64, log_depth: F64) -> Around:
        rays = np.concatenate([tangents, np.ones((*log_depth.shape, 1))], -1)
        off = (rays * np.exp(log_depth)[..., None] - rim.centre) / rim.radius
        across = np.cross(rim.normal, [0.0, 0.0, 1.0])
        across /= max(float(np.linalg.norm(across)), 1e-9)
        x, y = off @ across, off @ np.cross(rim.normal, across)
        return Around(off @ rim.normal, np.hypot(x, y), np.arctan2(y, x))

    def nearest(self, other: Around, source: Mask, wanted: Mask, level: str) -> I64:
        """(h, w, 2) columns and rows of cells of `source` that are like `other` where `wanted`.

        As high, or as far from the axis, and about as far around it.
        """
        rows, columns = np.indices(source.shape)
        found = np.stack([columns, rows], -1)
        if source.any() and wanted.any():
            tree = KDTree(self._places(level)[source])
            _, index = tree.query(other._places(level)[wanted])
            rows, columns = np.nonzero(source)
            found[wanted] = np.column_stack([columns, rows])[index]
        return found

    def _places(self, level: str) -> F64:
        own = self.height if level == "height" else self.radius
        return np.stack(
            [own, AROUND_SHARE * np.cos(self.angle), AROUND_SHARE * np.sin(self.angle)], -1
        )


def _hollow(lip: Rim, tangents: F64, before: F64, outline: ReliefSilhouette) -> F64:
    """(h, w) how much deeper than its lip what is within it is, of the logarithm of its depth."""
    within = -lip.outside(tangents) * lip.centre[2] / lip.radius  # from 0 at the lip to 1
    ring = outline.inside & (within > 0) & (within < 0.15)
    if ring.sum() < LEAST_KNOWN:
        return np.zeros(outline.shape)
    at = np.concatenate([tangents, np.ones((*outline.shape, 1))], -1)
    level = at @ np.linalg.lstsq(at[ring], before[ring])[0]
    return np.where(within > 0, np.maximum(before - level, 0) * np.clip(within / 0.3, 0, 1), 0.0)


def _dish(rim: Rim, around: int) -> Mesh:
    deep, thick = DISH
    heights = np.array([-deep, -deep, -0.4 * deep, 0.0, -0.4 * thick, -deep - thick, -deep - thick])
    radii = np.array([0.001, 0.55, 0.8, 1.0, 1.0, 0.55, 0.001])
    return _turned(rim, heights, radii, around)


def _turned(rim: Rim, heights: F64, radii: F64, around: int) -> Mesh:
    """Circles `radii` (n,) wide and `heights` (n,) above a rim, both x its radius."""
    places = rim.centre + rim.radius * heights[:, None] * rim.normal
    return revolved(places, rim.radius * radii, rim.normal, around)


def _stem(rims: list[Rim]) -> tuple[Rim, float]:
    """Where the axis of what stands meets the plane of the dish, and how high its lip is.

    Both are x the dish's radius.
    """
    first, lip = rims
    rise = float((lip.centre - first.centre) @ first.normal) / float(lip.normal @ first.normal)
    return Rim(lip.centre - rise * lip.normal, lip.normal, first.radius), rise / first.radius


def _vessel(rims: list[Rim], evidence: Evidence) -> Mesh:
    """What stands in a dish, from its foot to its lip, as the network's normals say."""
    first, lip = rims
    stem, high = _stem(rims)
    wide, foot = lip.radius / first.radius, -DISH[0]
    rise = np.linspace(0, 1, 12)
    heights = np.r_[foot + (high - foot) * rise, high]

    def built(narrow: float, bulge: float, around: int) -> Mesh:
        radii = wide * np.r_[narrow + (1 - narrow) * rise**bulge, 0.001]
        return _turned(stem, np.r_[foot, heights], np.r_[0.001, radii], around)

    saucer = _dish(first, AROUND)
    trials = [(f, b) for f in FEET for b in BULGES]

    def cost(trial: tuple[float, float]) -> float:
        own = built(*trial, AROUND)
        faces = np.concatenate([saucer.faces, own.faces + len(saucer.vertices)])
        both = Mesh(np.concatenate([saucer.vertices, own.vertices]), faces)
        return evidence.misfit(both).normal

    best = min(trials, key=cost)
    return built(*best, FINE)


def _cuts(ends: list[tuple[F64, Mask]], outline: ReliefSilhouette) -> Cuts:
    """Where sheets (h, w) px fall off at the ends of parts (h, w), also beyond the outline."""
    least, beyond = LEAST_STEP * outline.extent, ~outline.inside
    found = []
    for axis in (0, 1):
        a, b = (
            tuple(slice(k, k - 1 or None) if n == axis else slice(None) for n in (0, 1))
            for k in (0, 1)
        )
        cut = np.zeros(beyond[a].shape, bool)
        for sheet, part in ends:
            is_end = (part[a] != part[b]) | beyond[a] | beyond[b]
            cut |= is_end & (np.abs(sheet[b] - sheet[a]) > least)
        found.append(cut)
    return Cuts(*found)
