"""Paint on an object: what a stroke on its picture changes of what it carries.

The object is drawn with two textures whose colours are places: of the photo's part, and of the
invented sides (`lift.relief.sides`). That is the same picture, so it says for each pixel which
texels are seen there, behind nothing, and how much of the pixel each part gives. Where both meet,
a stroke lands on both, and no seam is left. Between neighbouring pixels the places go on evenly:
each little square of the picture covers its part of the texture, however far it is drawn out.

What has neither the photo nor an invented picture shows the plain colours of its Gaussians: a
stroke colours those that are seen under it, too, as finely as they lie. So it does where a pixel
shows a texel of another surface (`texel_owners`): the texel stays, and the Gaussians that showed it
do not any more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import F32, F64, Mask, unit_pixels
from ..base.camera import Camera
from ..document.model import LiftedObject, Matte
from ..document.paint import Paint
from ..raster import tiles
from ..raster.posed import PosedSplats
from ..raster.reference import moved_cosines
from ..raster.rules import RULES
from ..raster.texture import TextureLevels, build_levels
from .blend import Box
from .light.lighting import object_texture
from .texel_owners import ShownSurface, Strays

LEAST_SHARE = 0.04  # of a pixel, that a part must give
STEEPEST = 5.0  # x the usual texels per px: beyond, two neighbours show different places
PER_TEXEL = 1.6  # samples along a square's side, for each texel
MOST_STEPS = 16
NEAR = 3.0  # x spacing: what is seen lies no farther behind
FAINT = 4  # of 255: less paint is none
RIM = 2  # texels, by which paint goes on where the picture ends


@dataclass(frozen=True, eq=False)
class SeenPart:
    """A part of an object's texture, and where in a picture it is seen."""

    at: F64  # (h, w, 2) texels, in px of the photo
    share: F32  # (h, w) of each pixel, that it gives


@dataclass(frozen=True, eq=False)
class Seen:
    """What of an object is seen in a `box` of a picture, and takes paint."""

    box: Box  # px of the picture
    parts: tuple[SeenPart, ...]
    spots: F32  # (N, 2) px of the box, where each Gaussian is
    is_seen: Mask  # (N,) and nothing stands before it: it takes paint
    is_mirrored: Mask  # (N,) it shows what the photo shows of the other side
    alpha: F32  # (h, w) of the object
    color: F32  # (h, w, 3) premultiplied: how it looks, without light and colours of its place
    strays: Strays | None  # None: all of it shows the photo, its other side as well

    def mirrored(self, coverage: F32) -> float:
        """Share of what a stroke covers that is a mirrored back: the front is painted with it."""
        weights = _sampled(coverage, self.spots) * self.is_seen
        return float(weights[self.is_mirrored].sum() / max(float(weights.sum()), 1e-6))


def look(splats: PosedSplats, matte: Matte, camera: Camera, box: Box) -> Seen:
    """Return what of an object `camera`, the photo's, sees in a box of its picture."""
    lifted = splats.rest.lifted
    texture = object_texture(matte, lifted)
    shown = tiles.draw(tiles.prepare(splats, camera, camera), texture, box)
    black = tiles.prepare(splats.recoloured(0 * lifted.gaussians.colors), camera, camera)
    surface = ShownSurface.of(splats, texture, camera, camera, box)
    strays = _strays(splats, texture)
    is_side = _is_side(texture, lifted)
    parts = []
    for part in (~is_side, is_side):
        if not part.any():
            continue
        drawn = tiles.draw(black, _places(texture, part), box).color
        height, width = part.shape
        share = np.minimum(drawn[..., 2], shown.alpha)
        at = drawn[..., :2] / np.maximum(drawn[..., 2:], 1e-6) * np.array([width, height], float)
        at = at + [texture.left, texture.top]
        if strays is not None and part is not is_side and surface.is_there.any():
            share = share * ~strays.owners.are_others(at, surface.places)
        parts.append(SeenPart(at, share))
    spots = np.asarray(camera.project(splats.means) - box[:2], np.float32)
    is_near = splats.means[:, 2] < _sampled(surface.depth, spots) + (
        NEAR * splats.rest.spacing * splats.scale
    )
    ramp = RULES.facing_ramp * lifted.texture.visibility
    faces = moved_cosines(splats.rest.normals, splats.linear, splats.means) > -ramp
    # Without colours of its own, all of an object shows the photo.
    is_mirrored = (splats.rest.cosines < 0) & (not splats.rest.splatting.has_colors)
    is_seen = is_near & faces & lifted.is_body
    if strays is not None:
        is_seen |= is_near & strays.is_stray
    return Seen(box, tuple(parts), spots, is_seen, is_mirrored, shown.alpha, shown.color, strays)


def _strays(splats: PosedSplats, texture: TextureLevels) -> Strays | None:
    """None where what the photo does not show has no colours of its own."""
    rest = splats.rest
    if not rest.splatting.has_colors or not rest.is_textured:
        return None
    return Strays.of(rest, texture)


def with_stroke(
    matte: Matte, seen: Seen, coverage: F32, colour: np.ndarray, opacity: float = 1.0
) -> Matte:
    """Return the matte painted in sRGB `colour` (3,) or (h, w, 3), in [0, 1].

    `coverage` (h, w) of the box of `seen`: how much the stroke covers.
    """
    whole = np.broadcast_to(np.asarray(colour, np.float32), (*coverage.shape, 3))
    values = np.dstack([coverage, coverage[..., None] * whole])
    old = matte.paint or Paint((), np.zeros((len(seen.spots), 4), np.uint8))
    box, sums = _on_texture(seen, values)
    spots = _sampled(values, seen.spots) * seen.is_seen[:, None]
    rgba = _mixed(sums, unit_pixels(old.crop(box)), opacity)
    dots = _mixed(spots, unit_pixels(old.spots), opacity)
    return _with_paint(matte, old, box, rgba, dots, seen.strays)


def without_stroke(matte: Matte, seen: Seen, coverage: F32) -> Matte:
    """Return the matte whose paint is gone where a stroke of this `coverage` (h, w) lies."""
    if (old := matte.paint) is None:
        return matte
    box, sums = _on_texture(seen, coverage[..., None])
    rgba, dots = unit_pixels(old.crop(box)), unit_pixels(old.spots)
    rgba[..., 3] *= 1 - np.minimum(sums[..., 0], 1)
    dots[:, 3] *= 1 - _sampled(coverage, seen.spots) * seen.is_seen
    return _with_paint(matte, old, box, rgba, dots, seen.strays)


@dataclass(frozen=True, eq=False)
class PaintedShare:
    """How much of what an object shows is paint: its alpha as a colour."""

    levels: TextureLevels
    spots: F32  # (N, 3) of the Gaussians' plain colours

    @staticmethod
    def of(matte: Matte, lifted: LiftedObject) -> PaintedShare | None:
        """None where nothing of the object is painted."""
        if (paint := matte.paint) is None:
            return None
        texture = object_texture(matte, lifted)
        height, width = texture.levels[0].shape[:2]
        left, top = int(texture.left), int(texture.top)
        alpha = unit_pixels(paint.crop((left, top, left + width, top + height))[..., 3:])
        levels = build_levels(np.repeat(alpha, 3, axis=2), texture.levels[0][..., 3], left, top)
        spots: F32 = np.repeat(unit_pixels(paint.spots)[:, 3:], 3, axis=1)
        return PaintedShare(levels, spots)

    def prepare(self, splats: PosedSplats, window: Camera, camera: Camera) -> tiles.Drawable:
        """The object as `window` sees it, in its paint; `camera` is the photo's."""
        is_whole = len(self.spots) == len(splats)  # else some were split, or drawn as fewer:
        colours = self.spots if is_whole else np.zeros((len(splats), 3), np.float32)
        return tiles.prepare(splats.recoloured(colours), window, camera)  # the texture's is left

    def draw(self, prepared: tiles.Drawable, box: Box | None) -> F32:
        """(h, w) how much of each pixel is paint."""
        return tiles.draw(prepared, self.levels, box).color[..., 0].copy()


def _mixed(sums: F32, below: F32, opacity: float) -> F32:
    """Straight (..., 4) of a stroke's alpha and premultiplied colours (..., 4) over `below`."""
    own = np.float32(opacity) * np.minimum(sums[..., :1], 1)
    colour = sums[..., 1:] / np.maximum(sums[..., :1], 1e-6)
    rest = (1 - own) * below[..., 3:]
    mixed = (own * colour + rest * below[..., :3]) / np.maximum(own + rest, 1e-6)
    return np.asarray(np.concatenate([mixed, own + rest], axis=-1), np.float32)


def _with_paint(
    matte: Matte, old: Paint, box: Box, rgba: F32, spots: F32, strays: Strays | None
) -> Matte:
    """With paint (h, w, 4) in [0, 1] in `box`, and on the Gaussians, over that of before."""
    levels, dots = (np.rint(part * 255).clip(0, 255).astype(np.uint8) for part in (rgba, spots))
    for part in (levels, dots):
        part[part[..., 3] <= FAINT] = 0
    paint = replace(old.with_pixels(box, levels), spots=dots)
    if strays is not None:
        apart = strays.is_stray & (dots[:, 3] > 0)
        apart |= strays.meet(paint.crop(matte.box)[..., 3] > 0, matte.left, matte.top)
        paint = replace(paint, apart=apart if apart.any() else None)
    return replace(matte, paint=paint if paint.tiles or dots.any() else None)


def _sampled(values: F32, at: F32) -> F32:
    """(N,) or (N, C) of values (h, w) or (h, w, C) at px (N, 2); outside it is 0."""
    found = np.zeros((len(at), *values.shape[2:]), np.float32)
    column, row = np.floor(at).astype(np.int64).T
    there = (column >= 0) & (row >= 0) & (column < values.shape[1]) & (row < values.shape[0])
    found[there] = values[row[there], column[there]]
    return found


def _is_side(texture: TextureLevels, lifted: LiftedObject) -> Mask:
    """(h, w) which of the texels are of invented pictures."""
    is_side, sides = np.zeros(texture.levels[0].shape[:2], bool), lifted.sides
    if sides is not None and sides.pixels.size:
        is_side[max(sides.top - int(texture.top) - 1, 0) :] = True  # the photo's part lies above
    return is_side


def _places(texture: TextureLevels, part: Mask) -> TextureLevels:
    """The texture whose red and green are the place, of 1, and blue is 1; 0 but for a `part`."""
    height, width = part.shape
    x = (np.arange(width, dtype=np.float32) + 0.5) / width
    y = (np.arange(height, dtype=np.float32) + 0.5) / height
    there = part.astype(np.float32)
    places = np.dstack([there * x, there * y[:, None], there])
    return build_levels(places, texture.levels[0][..., 3], texture.left, texture.top)


def _on_texture(seen: Seen, values: F32) -> tuple[Box, F32]:
    """The box of what `values` (h, w, C) of a picture are on the texture, and it.

    The mean over each texel of what is seen of it.
    """
    found = [_spread(part, values) for part in seen.parts]
    texels = [one for one in found if one is not None]
    if not texels:
        return (0, 0, 0, 0), np.zeros((0, 0, values.shape[2]), np.float32)
    places = np.concatenate([place for place, _ in texels])
    amounts = np.concatenate([amount for _, amount in texels])
    low, high = places.min(0) - RIM, places.max(0) + RIM + 1
    width, height = (int(n) for n in high - low)
    index = (places[:, 1] - low[1]) * width + places[:, 0] - low[0]
    count = np.bincount(index, minlength=width * height).reshape(height, width)
    sums = [
        np.bincount(index, amounts[:, c], width * height).reshape(height, width)
        for c in range(values.shape[2])
    ]
    means = np.asarray(np.dstack(sums) / np.maximum(count, 1)[..., None], np.float32)
    box = int(low[0]), int(low[1]), int(high[0]), int(high[1])
    return box, _continued(means, count > 0)


def _spread(part: SeenPart, values: np.ndarray) -> tuple[np.ndarray, F64] | None:
    """Texels (n, 2) that lie in the squares between four pixels, each with its values (n, C)."""
    corners = [np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, 1:], np.s_[1:, :-1]]
    at = [part.at[corner] for corner in corners]
    edges = [np.abs(at[k] - at[k - 1]).max(-1) for k in range(4)]
    longest = np.maximum.reduce(edges)
    is_whole = np.logical_and.reduce([part.share[corner] > LEAST_SHARE for corner in corners])
    if not is_whole.any():
        return None
    usual = float(np.median(longest[is_whole]))
    is_whole &= longest < STEEPEST * max(usual, 1.0)
    is_whole &= _around(values[..., 0] > 0, int(np.ceil(1 / max(usual, 0.05))) + 1)[:-1, :-1]
    row, column = np.nonzero(is_whole)
    if not len(row):
        return None
    steps = np.ceil(PER_TEXEL * longest[row, column]).clip(1, MOST_STEPS).astype(int)
    places, amounts = [], []
    for n in np.unique(steps):
        spot = row[steps == n], column[steps == n]
        along = (np.arange(n) + 0.5) / n
        x, y = (v.ravel()[:, None, None] for v in np.meshgrid(along, along))
        weights = (1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y
        pairs = list(zip(weights, corners, at, strict=True))
        place = sum(weight * own[spot] for weight, _, own in pairs)
        value = sum(weight * values[corner][spot] for weight, corner, _ in pairs)
        places.append(np.floor(place).astype(np.int64).reshape(-1, 2))
        amounts.append(np.asarray(value, np.float64).reshape(-1, values.shape[2]))
    return np.concatenate(places), np.concatenate(amounts)


def _around(there: Mask, px: int) -> Mask:
    """(h, w) what is `there`, and so many px around it."""
    kernel = np.ones((2 * px + 1, 2 * px + 1), np.uint8)
    return np.asarray(cv2.dilate(there.astype(np.uint8), kernel) > 0)


def _continued(values: F32, there: Mask) -> F32:
    """`values` (h, w, C) that go on around where they are `there` (h, w), by RIM texels."""
    for _ in range(RIM):
        share = cv2.blur(there.astype(np.float32), (3, 3))
        near = cv2.blur(values, (3, 3)).reshape(values.shape) / np.maximum(share, 1e-6)[..., None]
        is_new = ~there & (share > 0.05)
        values = np.where(is_new[..., None], near, values).astype(np.float32)
        there = there | is_new
    return values
