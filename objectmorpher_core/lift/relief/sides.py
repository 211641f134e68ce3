"""Pictures of the sides that a photo does not show, by patch synthesis.

An object that is turned far to a side is seen as if its surface were unfolded: what the photo
shows and what it does not lie side by side, both hardly foreshortened. There the hidden part is a
hole in a picture, and is filled with patches from beside it, or mirrored ones, along its straight
edges, as a background is (`compose.plate`). They are taken from about as far along the axis of the
turn, and where about the colours are that the side is to have: hair goes on as hair. Where that is
plainer than the object, texture is quilted over it. Each Gaussian that the photo does not show, or
shows from nearly edge on, carries its piece of the picture that faces it most, by the same map that
carries the photo: it is as sharp, and stays the same however the object turns.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import cv2
import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F32, F64, U8, Mask
from ...base.camera import Camera
from ...base.masks import bounds, widely_blurred
from ...base.progress import silent
from ...base.threads import in_threads
from ...compose.light.lighting import estimate_light
from ...compose.plate.completion import complete, shrunk, smooth
from ...compose.plate.patch_detail import with_detail
from ...compose.plate.sources import Guide, PatchTone
from ...compose.plate.structure_lines import find_lines
from ...document.model import LiftedObject, Matte, Placement
from ...document.sides import Sides
from ...raster import tiles
from ...raster.posed import PosedSplats, RestSplats, projection_jacobians
from ...raster.reference import Picture3D
from ...raster.rules import RULES
from ...raster.texture import TextureLevels, build_levels
from .canvas import bilinear
from .colours import fill_in
from .quilting import ROUGHLY, quilted
from .silhouette import inwardness

AWAY = 45.0  # degrees: sides that this turn shows are textured as they look after it
TURNS = ((AWAY, 0.0, 0.0), (-AWAY, 0.0, 0.0), (0.0, AWAY, 0.0), (0.0, -AWAY, 0.0))
# Ratio of the cosines then and now, down to which the photo goes on beyond where it is shown, so
# that both agree where they meet: of a turn by 22 degrees and more.
PINNED = 0.25
FACING = 0.15  # cosine of a normal with the way to the camera, from which a picture shows it
FARTHEST = -0.75  # cosine with the way to the photo's camera, beyond which it is the back
LONGEST = 600.0  # px, longer side of the object in a picture
SEARCH = 9_000  # px of the small picture in which patches are looked for
LEAST = 40  # px of a hole, or of what is around it
SURE = 0.95  # alpha, and the share of the photo in it, from which a pixel is known
HALF = 0.5  # alpha of the matte, to which its own colours are sure enough; of a share, likewise
EDGE = 1  # px of what is known beside a hole that are filled anew: they are mixed with it
CLEAR = 0.4  # shrinking of the photo's area, down to which it may be seen elsewhere
OWN = 0.9  # of the matte's fringe, from which colours are the object's own
RIM = 4  # small px of the object's edge that are no source, for what is beyond is in their patches
STRANGE = 20_000.0  # squared levels that they cost
FAR = 1_500.0  # squared levels that a source costs ...
BESIDE = 3.0  # ... that is as many times as far from the hole as the hole is deep
ELSEWHERE = 300.0  # squared levels that one in the photo costs
KEPT = 0.85  # share of the coarse colours of a side that stays
COARSE = 5.0  # small px, of what is coarse
NEARBY = 2.0  # small px, over which colours are compared
HEIGHT = 600.0  # levels of a patch's tone, from one end of the axis of a turn to the other
NEARLY = 1.1  # x the share of a picture of about the right colours: what exceeds 1 is whole
OTHER = 30.0  # levels, by which the coarse colours of a picture of something else are off
BRIGHTEST = 0.4  # logarithm, by which a side is brighter or darker than the colours it has
INWARD = 0.4  # of the matte's fringe, up to which its colours are not the object's
EVEN, SMOOTH = 3.0, 8.0  # px, over which the border at which the photo is mirrored is evened
LIKE, UNLIKE = 8.0, 50.0  # px over which its colours are compared; levels by which others are off
DARK = 24.0  # levels of all channels, in which no light is to be measured
ALONG = 40  # px from a fringe: what has none has edges, where another face begins
BENT = 2.5  # of its area, by which it may be larger or smaller
STRIKING = 40.0  # levels, by which what stands out is unlike its surroundings
USUAL = 0.93  # of an object's surface is its pattern, as a tabby's stripes are, however unlike
FEATURE = 0.55  # x the root of the object's area: what is longer is a part of it, as a leg is
SOFT = 5  # px of the photo: a narrower fringe is an edge
MIX = 2  # px beside a hole that are no texture: they are mixed with it
APART = 3.0  # x spacing, between Gaussians on two pictures: there are plain colours
BEFORE = 3.0  # x spacing, by which what stands before something is nearer
BEHIND = 0.01  # share of a side's Gaussians, from which what something hides has a picture
MOST_TONED = 25.0  # levels, by which a side's tone follows the photo's where they meet
GAP = 32  # px between the matte and the pictures, and between them


@dataclass(frozen=True, eq=False)
class _Shot:
    """What the photo shows of the object."""

    matte: Matte
    inward: F32  # (h, w) how far inside its fringe a pixel of the matte is
    camera: Camera

    @cached_property
    def levels(self) -> TextureLevels:
        """The object's colours, also where its matte is faint."""
        whole = np.ones(self.matte.alpha.shape, np.float32)
        return build_levels(self.matte.foreground, whole, self.matte.left, self.matte.top)

    def is_fringe(self, rest: RestSplats) -> Mask:
        """(N,) which Gaussians reach into the matte's fringe."""
        texture, depth = rest.lifted.texture, rest.lifted.world_points(rest.means)[:, 2]
        reach = round(rest.spacing * self.camera.focal / float(np.median(depth)))
        fringe = ((self.inward < 1) & (self.matte.alpha > HALF)).astype(np.uint8)
        fringe = cv2.morphologyEx(fringe, cv2.MORPH_OPEN, np.ones((SOFT, SOFT), np.uint8))
        near = cv2.dilate(fringe, np.ones((2 * reach + 1,) * 2, np.uint8)).astype(np.float32)
        at = np.asarray(texture.u0 - [self.matte.left, self.matte.top] - 0.5, np.float64)
        return np.asarray(bilinear(near, at) > HALF)


@dataclass(frozen=True, eq=False)
class _View:
    """The object turned far to a side."""

    motion: F64  # (4, 4) world from world
    camera: Camera  # whose picture holds the object
    places: F64  # (N, 3) world, after the turn
    cosines: F64  # (N,) of the normals with the way to the camera
    is_pitched: bool  # its axis lies across the picture, not upright

    @staticmethod
    def of(rest: RestSplats, camera: Camera, turn: tuple[float, float, float]) -> _View:
        lifted = rest.lifted
        motion = Placement(turn=turn).matrix(lifted, camera)
        places = lifted.world_points(rest.means) @ motion[:3, :3].T + motion[:3, 3]
        facing = -((rest.normals @ motion[:3, :3].T) * places).sum(1)
        cosines = facing / np.linalg.norm(places, axis=1)
        xy = camera.project(places)
        low, high = xy.min(0), xy.max(0)
        scale = min(1.0, LONGEST / max(float((high - low).max()), 1.0))
        left, top = np.floor(scale * low) - 2
        width, height = np.ceil(scale * (high - low)).astype(int) + 4
        own = Camera(
            scale * camera.focal, scale * camera.cx - left, scale * camera.cy - top,
            int(width), int(height),
        )  # fmt: skip
        return _View(motion, own, places, cosines, turn[0] == 0)

    @property
    def xy(self) -> F64:
        """(N, 2) px of the picture."""
        return np.asarray(self.camera.project(self.places), np.float64)

    def px(self, length: float) -> float:
        """How long something of this length, world units, is in the picture, about."""
        return length * self.camera.focal / float(np.median(self.places[:, 2]))

    def drawn(self, rest: RestSplats, shot: _Shot) -> SidePicture:
        """What the photo shows of this view; `rest` has the colours of what it does not.

        The outline is the surface's own, and the photo is not faded where it is drawn out.
        """
        matte, photo, lifted = shot.matte, shot.camera, rest.lifted
        gaussians, texture = lifted.gaussians, lifted.texture
        carried = np.where(self.is_aside(rest, PINNED), 0.0, texture.visibility)
        own = replace(
            lifted, splatting="edged solid",
            gaussians=replace(gaussians, opacities=gaussians.opacities * lifted.is_body),
            texture=replace(texture, visibility=carried.astype(np.float32)),
        )  # fmt: skip
        splats = PosedSplats(RestSplats(own, photo).unfaded(), None, self.motion)
        drawable = tiles.prepare(splats, self.camera, photo)
        picture, invented = tiles.draw_with_share(drawable, shot.levels)  # nothing beyond the frame
        straight = picture.color / np.maximum(picture.alpha, 1e-6)[..., None]
        is_known = (picture.alpha > SURE) & (invented < 1 - SURE)
        looks = self._looks(picture, photo)
        at = (looks - [matte.left, matte.top] - 0.5).astype(np.float32)
        at_xy = at[..., 0], at[..., 1]
        is_known &= cv2.remap(matte.alpha, *at_xy, cv2.INTER_LINEAR) > HALF
        across, down = np.gradient(looks, axis=1), np.gradient(looks, axis=0)
        area = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
        is_own = is_known & (cv2.remap(shot.inward, *at_xy, cv2.INTER_LINEAR) > OWN)
        is_odd = standing_out(np.asarray(255 * straight, np.float32), is_own)
        is_clear = is_own & ~is_odd & (area * (self.camera.focal / photo.focal) ** 2 > CLEAR)
        return SidePicture(
            straight.clip(0, 1),
            picture.alpha > 0.5,
            is_known,
            is_own,
            is_odd,
            is_clear,
            picture.depth,
        )

    def _looks(self, picture: Picture3D, photo: Camera) -> F64:
        """(h, w, 2) px of the photo that each px of a picture of this view shows."""
        height, width = picture.alpha.shape
        xy = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) + 0.5
        own = self.camera
        xy = (xy - [own.cx, own.cy]) * photo.focal / own.focal + [photo.cx, photo.cy]
        return xy + picture.shift

    def is_aside(self, rest: RestSplats, ratio: float | F64) -> Mask:
        """(N,) which Gaussians faced the photo's camera less than `ratio` x this view's."""
        return rest.cosines < ratio * self.cosines


@dataclass(frozen=True, eq=False)
class SidePicture:
    """What the photo shows of an object that is turned to a side."""

    colors: F32  # (h, w, 3) straight, in [0, 1]; coarse where nothing is known
    is_object: Mask  # (h, w)
    is_known: Mask  # (h, w)
    is_own: Mask  # (h, w) of that, what is no fringe
    is_odd: Mask  # (h, w) what stands out from its surroundings
    is_clear: Mask  # (h, w) of what is the object's own, what may be copied: not odd, nor drawn out
    depth: F32  # (h, w) world units


@dataclass(frozen=True, eq=False)
class _Side:
    """A view of Gaussians that show an invented picture of it."""

    number: int  # of the picture, for its seed: it does not depend on which others there are
    view: _View
    index: np.ndarray  # (n,) of the Gaussians
    picture: SidePicture
    is_wanted: Mask  # (h, w) where they are

    def beside(self, front: SidePicture) -> _Side:
        """The same with what the photo shows to its right: there is the texture unforeshortened."""
        own = self.picture
        height, width = max(len(own.depth), len(front.depth)), front.depth.shape[1]
        below = height - len(own.depth), height - len(front.depth)

        def joined(name: str) -> np.ndarray:
            parts = getattr(own, name), getattr(front, name)
            padded = [
                np.pad(part, [(0, more), (0, 0), (0, 0)][: part.ndim])
                for part, more in zip(parts, below, strict=True)
            ]
            return np.concatenate(padded, axis=1)

        picture = SidePicture(*(joined(f.name) for f in fields(SidePicture)))
        return replace(
            self, picture=picture, is_wanted=np.pad(self.is_wanted, ((0, below[0]), (0, width)))
        )


def with_sides(lifted: LiftedObject, matte: Matte, camera: Camera, seed: int = 0) -> LiftedObject:
    """`lifted` with pictures of what the photo's `camera` does not see of it."""
    rest = RestSplats(replace(lifted, sides=None), camera)
    shot = _Shot(matte, inwardness(matte.alpha, matte.foreground), camera)
    lit = _lit(rest, shot)
    views = [_View.of(rest, camera, turn) for turn in TURNS]
    best = np.argmax([view.cosines for view in views], axis=0)
    is_side = lifted.is_body & (rest.cosines > FARTHEST)
    is_fringe = shot.is_fringe(rest)
    least = np.where(is_fringe, RULES.fringe_aside, RULES.look_aside)
    front = _View.of(rest, camera, (0.0, 0.0, 0.0)).drawn(lit, shot)
    sides: list[_Side] = []
    for k, view in enumerate(views):
        wanted = (best == k) & (view.cosines > FACING) & view.is_aside(rest, least) & is_side
        if wanted.sum() >= 3:
            sides += _layers(k, view, np.flatnonzero(wanted), lit, shot)
    sides = _apart(sides, lifted.world_points(rest.means), APART * rest.spacing)
    filled: list[U8 | None] = [None] * len(sides)

    def fill(first: int, last: int) -> None:
        for k in range(first, last):
            filled[k] = _filled(sides[k], front, seed + sides[k].number)

    in_threads(fill, len(sides), parts=len(sides))
    carried = _carried(lifted, sides, filled, (matte.left, matte.box[3] + GAP))
    if carried.sides is None:
        return carried
    zoom = np.where(is_fringe, -carried.sides.zoom, carried.sides.zoom)
    return replace(carried, sides=replace(carried.sides, zoom=zoom))


def _apart(sides: list[_Side], places: F64, gap: float) -> list[_Side]:
    """The sides without what is nearer than `gap` to a larger one; Gaussians lie at `places`.

    No pixel shows two pictures at once: a mean of places in both would be a place in neither.
    """
    taken, kept = np.zeros(len(places), bool), {}
    for k in sorted(range(len(sides)), key=lambda k: -len(sides[k].index)):
        index = sides[k].index
        if taken.any():
            nearest, _ = KDTree(places[taken]).query(places[index], distance_upper_bound=gap)
            index = index[np.isinf(nearest)]
        taken[index] = True
        kept[k] = replace(sides[k], index=index)
    return [kept[k] for k in range(len(sides))]


def _carried(
    lifted: LiftedObject, sides: list[_Side], filled: list[U8 | None], corner: tuple[int, int]
) -> LiftedObject:
    """`lifted` with its sides, whose `filled` pictures lie in a row from `corner` on, photo px."""
    count = len(lifted.gaussians)
    at, slopes = np.zeros((count, 2)), np.zeros((count, 2, 3))
    zoom, pictures = np.zeros(count), []
    left, top = corner
    for side, pixels in zip(sides, filled, strict=True):
        if pixels is None:
            continue
        index, view = side.index, side.view
        at[index] = view.xy[index] + [left, top]
        jacobians = projection_jacobians(view.places[index], view.camera.focal)
        slopes[index] = jacobians @ view.motion[:3, :3]
        zoom[index] = view.camera.focal / view.places[index, 2]
        pictures.append(pixels)
        left += pixels.shape[1] + GAP
    if not pictures:
        return lifted
    at, slopes, zoom = (field.astype(np.float32) for field in (at, slopes, zoom))
    return replace(lifted, sides=Sides(side_by_side(pictures), *corner, at, slopes, zoom))


def _lit(rest: RestSplats, shot: _Shot) -> RestSplats:
    """With the colours of what is not seen as bright as its normals want it, coarsely.

    They are those of the front, which faces elsewhere. The matte's fringe is not seen, either.
    """
    lifted = rest.lifted
    change = (rest.normals - rest.shown_normals) @ estimate_light(lifted, shot.matte)
    gain = np.exp(change.clip(-BRIGHTEST, BRIGHTEST))[:, None].astype(np.float32)
    colors = (lifted.gaussians.colors * gain).clip(0, 1)
    texture = lifted.texture
    at = np.asarray(texture.u0 - [shot.matte.left, shot.matte.top] - 0.5, np.float64)
    is_own = bilinear(shot.inward, at) >= INWARD
    own = replace(
        lifted, gaussians=replace(lifted.gaussians, colors=colors),
        texture=replace(texture, visibility=texture.visibility * is_own),
    )  # fmt: skip
    return RestSplats(own, shot.camera)


def _layers(
    number: int, view: _View, wanted: np.ndarray, rest: RestSplats, shot: _Shot
) -> list[_Side]:
    """What a view shows of the `wanted` Gaussians, and what it shows without what hides others.

    The body of a mug is hidden behind its handle in every view: that has a picture without it.
    """
    whole = view.drawn(rest, shot)
    side = _side(number, view, wanted, whole, rest.spacing)
    behind = np.setdiff1d(wanted, side.index)
    if len(behind) < max(BEHIND * len(wanted), 3):
        return [side]
    lifted = rest.lifted
    depth, xy = view.places[:, 2], view.xy
    reach = view.px(APART * rest.spacing)
    near, which = map(np.asarray, KDTree(xy[behind]).query(xy, distance_upper_bound=reach))
    hides = np.isfinite(near)
    hides[hides] = depth[hides] < depth[behind[which[hides]]] - BEFORE * rest.spacing
    opacities = np.where(hides, 0, lifted.gaussians.opacities).astype(np.float32)
    bare = replace(lifted, gaussians=replace(lifted.gaussians, opacities=opacities))
    picture = view.drawn(RestSplats(bare, shot.camera), shot)
    sides = [_side(number, view, wanted[~hides[wanted]], picture, rest.spacing)]
    before = side.index[hides[side.index]]
    if len(before) >= 3:
        sides.append(_side(number + len(TURNS), view, before, whole, rest.spacing))
    return sides


def _side(
    number: int, view: _View, wanted: np.ndarray, picture: SidePicture, spacing: float
) -> _Side:
    """What the picture of a view shows of the `wanted` Gaussians, `spacing` apart."""
    xy = view.xy[wanted]
    is_seen = _is_seen(xy, view.places[wanted, 2], picture, spacing)
    wanted, xy = wanted[is_seen], xy[is_seen]
    there = np.ones(picture.is_known.shape, np.uint8)
    column, row = np.floor(xy).astype(int).T
    there[row, column] = 0
    away = cv2.distanceTransform(there, cv2.DIST_L2, 5)
    return _Side(number, view, wanted, picture, away < view.px(2 * spacing) + EDGE)


def _is_seen(xy: F64, depth: F64, picture: SidePicture, spacing: float) -> Mask:
    """(n,) which places of a view, at px (n, 2), nothing stands before."""
    height, width = picture.depth.shape
    column, row = np.floor(xy).astype(int).T
    shown = picture.depth[row.clip(0, height - 1), column.clip(0, width - 1)]
    return depth < shown + BEFORE * spacing


def side_by_side(pictures: list[U8]) -> U8:
    height = max(len(picture) for picture in pictures)
    padded = [
        np.pad(picture, ((0, height - len(picture)), (0, GAP), (0, 0)), mode="edge")
        for picture in pictures
    ]
    return np.concatenate(padded, axis=1)


def _filled(side: _Side, front: SidePicture, seed: int) -> U8 | None:
    """(h, w, 3) the view of a side with what was not known of it where it is wanted.

    From what it shows, and from the photo's own view. None where nothing is to be filled, or
    nothing is known.
    """
    both = side.beside(front)
    picture, wanted, width = both.picture, both.is_wanted, side.is_wanted.shape[1]
    unknown = picture.is_object & ~picture.is_known
    unknown = cv2.dilate(unknown.astype(np.uint8), np.ones((2 * EDGE + 1,) * 2, np.uint8)) > 0
    known = picture.is_known & ~unknown
    hole = picture.is_object & ~known & wanted
    if hole.sum() < LEAST or known.sum() < LEAST:
        return None
    scale = min(1.0, (SEARCH / hole.size) ** 0.5)
    size = max(8, round(hole.shape[1] * scale)), max(8, round(hole.shape[0] * scale))
    around = fill_in(picture.colors, picture.is_object)
    levels = 255 * np.where(picture.is_object[..., None], picture.colors, around)
    # What nobody knows around the hole is one, too, as far as patches reach.
    reach = int(np.ceil(2 * RIM / scale))
    whole = cv2.dilate(hole.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
    whole &= ~known
    small, share = shrunk(levels, (~whole).astype(np.float32), size)
    guess = smooth(small, (share >= 0.5).astype(np.float32))
    unlikely = _unlikely(known & picture.is_clear, share < 0.5, round(width * scale))
    coarse = np.asarray(cv2.resize(levels, size, interpolation=cv2.INTER_AREA), np.float32)
    solid = cv2.resize(picture.is_object.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    tone = np.dstack([cv2.GaussianBlur(coarse, (0, 0), NEARBY), _heights(side, front, size)])
    kept = PatchTone(np.asarray(tone, np.float32), np.asarray(solid, np.float32))
    guide = Guide(unlikely, find_lines(guess, share < 0.5), tone=kept)
    completion = complete(small, share, guide, seed, silent)
    change = cv2.GaussianBlur(coarse - completion.colors, (0, 0), COARSE)
    sure = np.asarray(
        cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA), np.float32
    )
    toned = _pinned(
        (completion.colors + KEPT * change).astype(np.float32), completion.hole, small, sure
    )
    colors = np.where(completion.hole[..., None], toned, small)
    crop = np.clip(levels + 0.5, 0, 255).astype(np.uint8)
    colors = np.clip(colors, 0, 255).astype(np.float32)
    ends = bounds(levels, picture.is_object)  # neither is what is invented lighter or darker
    filled = with_detail(crop, whole, colors, completion.sources).clip(*ends)
    share = _alike(completion.colors, coarse, small, sure)
    share = np.where(whole, cv2.resize(share, hole.shape[::-1]), 1.0)[..., None]
    filled = (crop + share * (filled.astype(np.float32) - crop)).astype(np.float32)
    clear = (known & picture.is_clear).astype(np.uint8)
    clear = cv2.erode(clear, np.ones((2 * MIX + 1,) * 2, np.uint8)) > 0
    heights = np.asarray(cv2.resize(tone[..., -1], hole.shape[::-1]) / HEIGHT, np.float32)
    filled = quilted(filled, known, clear, hole, heights, seed)[: len(side.is_wanted), :width]
    image, share = mirrored(side.picture)
    filled = np.rint(filled + share[..., None] * (image - filled))
    return np.asarray(filled.clip(0, 255), np.uint8)


def mirrored(picture: SidePicture) -> tuple[F32, F32]:
    """What is the object's own (h, w, 3), levels, mirrored at its border; (h, w) how well it fits.

    So hair goes on as it is where the photo's ends; where the photo has no soft fringe there are
    edges, and other faces behind them. What stands out, an eye or a nose, is not there twice, and
    neither colours unlike those that are expected fit nor what a curved border bends.
    """
    inner = cv2.GaussianBlur(picture.is_own.astype(np.float32), (0, 0), EVEN) > 0.5
    if not inner.any():
        return picture.colors, np.zeros(inner.shape, np.float32)
    away = cv2.distanceTransform((~inner).astype(np.uint8), cv2.DIST_L2, 5)
    down, across = np.gradient(cv2.GaussianBlur(away, (0, 0), SMOOTH))
    back = -2 * away / np.maximum(np.hypot(across, down), 1e-3)
    rows, columns = np.mgrid[: away.shape[0], : away.shape[1]].astype(np.float32)
    x, y = (columns + back * across).astype(np.float32), (rows + back * down).astype(np.float32)
    (x_down, x_across), (y_down, y_across) = np.gradient(x), np.gradient(y)
    area = cv2.GaussianBlur(x_down * y_across - x_across * y_down, (0, 0), EVEN)
    fits = cv2.remap((inner & ~picture.is_odd).astype(np.uint8), x, y, cv2.INTER_NEAREST) > 0
    fits &= picture.is_object & ~inner & (area > 1 / BENT) & (area < BENT)
    fringe = (picture.is_known & ~picture.is_own).astype(np.uint8)
    fits &= cv2.dilate(fringe, np.ones((2 * ALONG + 1,) * 2, np.uint8)) > 0
    levels = 255 * picture.colors
    image = np.asarray(cv2.remap(levels, x, y, cv2.INTER_LINEAR), np.float32)
    expected, there = _mean(levels, picture.is_object, LIKE), _mean(image, fits, LIKE)
    light = (expected.sum(-1) + DARK) / (there.sum(-1) + DARK)  # it faces elsewhere
    light = light.clip(*np.exp([-BRIGHTEST, BRIGHTEST]))[..., None].astype(np.float32)
    image *= light
    off = np.linalg.norm(light * there - expected, axis=-1)
    share = (fits * np.exp(-((off / UNLIKE) ** 4))).astype(np.float32)
    return image, np.asarray(cv2.GaussianBlur(share, (0, 0), EVEN) * ~inner, np.float32)


def standing_out(levels: F32, where: Mask) -> Mask:
    """(h, w) what is small and unlike its surroundings, of `levels` (h, w, 3) `where` (h, w)."""
    size = where.shape[1] // 4 + 1, where.shape[0] // 4 + 1  # fine enough, and fast
    share = cv2.resize(where.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    own = cv2.resize(levels * where[..., None], size, interpolation=cv2.INTER_AREA)
    there = share > 0.5
    small = (own / np.maximum(share, 1e-3)[..., None]).astype(np.float32)
    near, around = (_mean(small, there, sigma / 4) for sigma in (LIKE, 3 * LIKE))
    unlike = np.linalg.norm(near - around, axis=-1)
    least = max(STRIKING, float(np.quantile(unlike[there], USUAL))) if there.any() else STRIKING
    striking = (unlike * there > least).astype(np.uint8)
    _, pieces, boxes, _ = cv2.connectedComponentsWithStats(striking)
    longest = np.asarray(boxes)[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(1)
    is_feature = longest < FEATURE * float(np.sqrt(there.sum()))
    is_feature[0] = False
    odd = is_feature[np.asarray(pieces)].astype(np.uint8)
    whole = cv2.resize(cv2.dilate(odd, np.ones((9, 9), np.uint8)), where.shape[::-1])
    return np.asarray(whole > 0)


def _mean(levels: F32, where: Mask, sigma: float) -> F32:
    """(h, w, 3) local means of `levels` (h, w, 3) over `where` (h, w)."""
    weight = where.astype(np.float32)
    total = widely_blurred(levels * weight[..., None], sigma, ROUGHLY)
    share = widely_blurred(weight, sigma, ROUGHLY)
    return np.asarray(total / np.maximum(share, 1e-3)[..., None], np.float32)


def _heights(side: _Side, front: SidePicture, size: tuple[int, int]) -> F32:
    """(h, w) how far along the axis of its turn what a side and the photo's view show lies.

    In levels. A part of an object goes on around it, and not higher or lower.
    """
    parts = []
    for picture in (side.picture, front):
        height, width = picture.depth.shape
        rows, columns = np.mgrid[:height, :width].astype(np.float32)
        parts.append(columns / width if side.view.is_pitched else rows / height)
    tall = max(len(part) for part in parts)
    parts = [np.pad(part, ((0, tall - len(part)), (0, 0)), mode="edge") for part in parts]
    return np.asarray(HEIGHT * cv2.resize(np.concatenate(parts, 1), size), np.float32)


def _alike(colors: F32, wanted: F32, known: F32, sure: F32) -> F64:
    """(h, w) in [0, 1] where `colors` (h, w, 3) that were invented are about those `wanted`.

    Elsewhere nothing was found that has them, and plain ones look better than another thing's. What
    is `known` and `sure` (h, w) has as much contrast as may be.
    """
    usual, off = (
        np.linalg.norm(cv2.GaussianBlur(change, (0, 0), NEARBY), axis=-1)
        for change in (known - cv2.GaussianBlur(known, (0, 0), COARSE), wanted - colors)
    )
    least = OTHER + float(np.median(usual[sure > HALF]))
    alike = np.minimum(NEARLY * np.exp(-((off.astype(np.float64) / least) ** 4)), 1)
    patch = np.ones((2 * RIM - 1,) * 2, np.uint8)
    alike = cv2.erode(cv2.morphologyEx(alike, cv2.MORPH_CLOSE, patch), patch)  # it is of one part
    return np.asarray(cv2.GaussianBlur(alike, (0, 0), NEARBY), np.float64)


def _pinned(colors: F32, hole: Mask, known: F32, sure: F32) -> F32:
    """`colors` (h, w, 3) of a hole (h, w), toned near its border as what is `known` is there.

    `sure` (h, w) is how much of that is known. Light and tone go on across the border so.
    """
    inner = hole.astype(np.float32)
    weights = [cv2.GaussianBlur(part, (0, 0), COARSE)[..., None] for part in (inner, sure)]
    sums = [
        cv2.GaussianBlur(part * weight[..., None], (0, 0), COARSE)
        for part, weight in ((colors, inner), (known, sure))
    ]
    own, other = (s / np.maximum(w, 1e-4) for s, w in zip(sums, weights, strict=True))
    away = cv2.distanceTransform((sure < HALF).astype(np.uint8), cv2.DIST_L2, 5)
    share = np.exp(-((away / (2 * COARSE)) ** 2))[..., None] * (weights[1] > 1e-3)
    change = np.clip(other - own, -MOST_TONED, MOST_TONED)  # more is another thing's colour
    return np.asarray(colors + share * change, np.float32)


def _unlikely(known: Mask, hole: Mask, width: int) -> F32:
    """(h, w) squared levels that a source costs beside a `hole` (h, w): not known, or far away.

    What is beyond `width` is the photo's own view.
    """
    solid = cv2.resize(known.astype(np.float32), hole.shape[::-1], interpolation=cv2.INTER_AREA)
    inner = cv2.erode((solid > 0.5).astype(np.uint8), np.ones((2 * RIM - 1,) * 2, np.uint8))
    away = cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5)
    deep = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5).max()
    far = FAR * np.clip(away / (BESIDE * deep + RIM) - 1, 0, 1)
    far[:, width:] = ELSEWHERE
    return np.where(inner > 0, far, STRANGE).astype(np.float32)
