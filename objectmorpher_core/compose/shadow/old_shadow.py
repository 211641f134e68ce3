"""The shadow that an object throws in the photo, taken off the ground.

Where it falls the ground is divided by the light that is missing there: the photo's own texture
stays. Only what is too dark to show any is invented.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from ...base.arrays import F32, Mask, Pixels, crop, pixels_from_unit, unit_pixels
from ...base.masks import disc, smaller, widely_blurred
from ...base.progress import Progress, silent
from ...document.model import Plate
from ...document.settings import Hint, Shadow
from ...segment.matting.soft_edge import signed_distance
from .. import Inpainter
from ..plate.plate import Box, build_plate, cut, hole_margin, overlap
from ..silhouette import cells_bounds, sampled
from .shadow import FROM_ABOVE, GAMMA

# Across a shadow's edge: lit ground there looks as beside it, at every distance from the edge.
#
# What was found of a shadow is on a grid, and its edge in the photo has a width, a tint and the
# camera's own sharpening, which dividing by it leaves as a line where the shadow ended. All of them
# depend on how far from the edge one is, and hardly on where along it (Shor and Lischinski 2008):
# so the lit picture is averaged along the edge, at each distance from it, and given the light of
# the ground beyond. What is averaged over some length of an edge is its light, not the ground's
# texture.

HALF = 0.5  # of the light that is missing near by: there the edge is
NEAR_BY = 4.0  # cells, over which that is measured
FAR = 4.0  # cells: the ground beyond is lit as it should be
ALONG = 3.0  # cells, over which one averages along the edge
FIRST, GROWTH = 1.0, 1.5  # px between distances at the edge, and x from each to the next
LEAST = np.float32(1e-3)  # of the px around, that must be at a distance for its light to be known
MOST = 1.6  # x, that any light is changed by
FEW, MANY = 3.0, 12.0  # px per cell, of a coarser picture on which something is measured
DIM = -3.2  # natural logarithm of light, from which a dark ground shows what it looks like
DIM_OVER = 0.5  # cells, over which that is measured
LIT = 0.05  # natural logarithm of missing light, from which ground is not lit
CONTINUED = (2.0, 4.0, 8.0, 16.0)  # cells; each weighs a hundredth of the one before
ROOM = 0.7  # cells, over which ground is not lit more than it usually is
FINE_EDGE = 0.15  # cells, over which the dark of a px is measured
DARK, LEFT = 1.1, 0.5  # natural logarithm of light that lacks in all, and after it was given back
LOOKS = 12.0  # cells, as far as all this looks around the shadow
MOST_TINT = 0.4  # of what is missing, that a colour may lack more or less
SHOWS = -3.0  # natural logarithm of light, from which it has a colour that can be measured
OFF = 0.1  # natural logarithm: the usual error of the light that was found
SEEN_EDGE = 0.02  # natural logarithm of light: less is no shadow


def usual_light(light: F32, missing: F32, free: Mask, pitch: float) -> F32:
    """(h, w) natural logarithm of the light of lit ground, continued from where it is seen."""
    height, width = light.shape
    weight = (free & (missing < LIT)).astype(np.float32)
    scale = min(FEW / pitch, 1.0)
    small = smaller(weight, scale)
    values = smaller(light * weight, scale)
    total, mean = np.zeros_like(small), np.zeros_like(small)
    for k, cells in enumerate(CONTINUED):
        share, sigma = np.float32(100.0**-k), cells * pitch * scale
        total += share * cv2.GaussianBlur(small, (0, 0), sigma)
        mean += share * cv2.GaussianBlur(values, (0, 0), sigma)
    known = float(np.median(light[weight > 0])) if weight.any() else 0.0
    usual = ((mean + 1e-9 * known) / (total + 1e-9)).astype(np.float32)
    return np.asarray(cv2.resize(usual, (width, height)), np.float32)


def bounded(missing: F32, light: F32, usual: F32, pitch: float) -> F32:
    """Return the missing light, bounded by the usual light of the ground.

    No shadow leaves more light than falls beside it.
    """
    blurred = widely_blurred(light, ROOM * pitch)
    return np.asarray(np.minimum(missing, np.maximum(usual - blurred, 0)), np.float32)


def is_dim(light: F32, pitch: float) -> Mask:
    """(h, w) where so little light is left that it shows nothing of the ground."""
    return np.asarray(widely_blurred(light, DIM_OVER * pitch) < DIM, np.bool_)


def too_dark(missing: F32, light: F32, usual: F32, pitch: float) -> Mask:
    """(h, w) where a shadow's core is nearer to black than what was found of it says.

    There the ground, with that light given back, is still much darker than where it is lit.
    """
    fine = widely_blurred(light, max(FINE_EDGE * pitch, 0.7))
    dark = usual - fine
    is_dark = ((missing > SEEN_EDGE) & (dark > DARK)).astype(np.uint8)
    is_dark = cv2.morphologyEx(is_dark, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels = cv2.connectedComponents(is_dark)
    core = np.unique(labels[(missing > DARK) & (is_dark > 0)])  # not a dark thing beside it
    return np.isin(labels, core[core > 0]) & (dark - missing > LEFT)


def tinted(colours: F32, missing: F32, free: Mask, pitch: float) -> F32:
    """(3,) what is missing of each colour for each that is missing in all: the sky is bluer.

    Told by lit ground, continued into the shadow, which light of another colour is left in.
    """
    deep = float(missing.max(initial=0))
    core = free & (missing > HALF * deep) & (missing > SEEN_EDGE) & (colours.mean(-1) > SHOWS)
    if not core.any() or not (free & (missing < LIT)).any():
        return np.ones(3, np.float32)
    lacking = np.stack(
        [
            np.median((usual_light(part, missing, free, pitch) - part)[core])
            for part in np.moveaxis(colours, -1, 0)
        ]
    )
    other = (lacking - lacking.mean()) / float(np.median(missing[core]))
    return np.asarray(1 + np.clip(other, -MOST_TINT, MOST_TINT), np.float32)


def evened(lit: F32, missing: F32, free: Mask, pitch: float) -> F32:
    """The picture `lit` (h, w, 3) in [0, 1] without a line where its shadow ended.

    `missing` (h, w) natural logarithm of the light that it was given, `free` (h, w) where the
    ground is seen, `pitch` px per cell of what the shadow was found on. In a large photo all
    this is as coarse as MANY px per cell: so are its edges.
    """
    height, width = missing.shape
    scale = min(MANY / pitch, 1.0)
    small, gap, seen = (smaller(p, scale) for p in (lit, missing, free.astype(np.float32)))
    factor = _factor(small, gap, seen > 1 - HALF, pitch * scale)
    factor = cv2.resize(factor, (width, height))
    return np.asarray(np.clip(lit * factor, 0, 1), np.float32)


def calmed(lit: F32, missing: F32, free: Mask) -> F32:
    """The picture `lit` (h, w, 3) in [0, 1] without the blotches that deep shade hid.

    A JPEG file keeps colours in coarse steps. Where much light was given back, by `missing` (h, w),
    they are seen: colours come from more of the ground there, as far as that looks the same. And
    noise has grown: what is fine there has no more contrast than on lit ground.
    """
    share = np.clip((missing - CALM[0]) / (CALM[1] - CALM[0]), 0, 1)[..., None]
    if not share.any():
        return lit
    grey = np.asarray(cv2.transform(lit, THIRDS), np.float32)
    around = (free & (missing > CALM[0])).astype(np.float32)
    guide = cv2.GaussianBlur(grey, (0, 0), CALM_GUIDE)
    known = cv2.ximgproc.guidedFilter(guide, around, CALM_REACH, CALM_EPS)
    off = cv2.ximgproc.guidedFilter(
        guide, (lit - grey[..., None]) * around[..., None], CALM_REACH, CALM_EPS
    )
    even = _as_grainy(grey, missing, free)[..., None]
    even = even + off / np.maximum(known, LEAST_KNOWN)[..., None]
    return np.asarray(np.clip(lit + share * (even - lit), 0, 1), np.float32)


def _as_grainy(grey: F32, missing: F32, free: Mask) -> F32:
    """(h, w) `grey` with no more fine contrast in deep shade than on lit ground beside it."""
    fine = grey - cv2.GaussianBlur(grey, (0, 0), CALM_GUIDE)
    usual, own = free & (missing < LIT), free & (missing > CALM[1])
    if not usual.any() or not own.any():
        return grey
    most, has = (float(np.median(np.abs(fine[part]))) for part in (usual, own))
    return np.asarray(grey - max(1 - most / max(has, 1e-6), 0.0) * fine, np.float32)


def _factor(lit: F32, missing: F32, free: Mask, pitch: float) -> F32:
    """(h, w, 3) what `evened` multiplies light by."""
    away = _from_edge(missing, pitch)
    far, sigma = FAR * pitch, ALONG * pitch
    beyond = free & (away > far) & (away < 3 * far)
    factor = np.ones_like(lit)
    if not beyond.any():
        return factor
    usual = _mean(lit, beyond.astype(np.float32), 2 * sigma)
    stops = _stops(far)
    for low, middle, high in zip(stops, stops[1:], stops[2:], strict=False):
        share = np.minimum((away - low) / (middle - low), (high - away) / (high - middle))
        share = np.clip(share, 0, 1)
        weight = np.where(free, share, 0).astype(np.float32)
        if not weight.any():
            continue
        known = widely_blurred(weight, sigma)
        sure = known / (known + LEAST) * _trust(lit, usual, beyond, (high - low) / 2, sigma)
        ratio = usual / np.maximum(_mean(lit, weight, sigma), 1e-3)
        factor += (share * sure)[..., None] * (np.clip(ratio, 1 / MOST, MOST) - 1)
    return factor


def _trust(lit: F32, usual: F32, beyond: Mask, width: float, sigma: float) -> float:
    """How much the mean of a strip along the edge depends on its light, and not on the ground.

    Lit ground itself varies so much over pieces as large.
    """
    side = float(np.sqrt(width * 2 * np.sqrt(np.pi) * sigma / (4 * np.pi)))
    grey = np.where(beyond, lit.mean(-1), 0).astype(np.float32)
    share = cv2.GaussianBlur(beyond.astype(np.float32), (0, 0), side)
    mean = cv2.GaussianBlur(grey, (0, 0), side) / np.maximum(share, 1e-6)
    off = np.log(np.maximum(mean, 1e-3) / np.maximum(usual.mean(-1), 1e-3))[beyond]
    return OFF**2 / (OFF**2 + float((off**2).mean()))


def _from_edge(missing: F32, pitch: float) -> F32:
    """(h, w) px from the edge, less than 0 in the shadow; all 0 where there is none."""
    height, width = missing.shape
    scale = min(FEW / pitch, 1.0)
    near = disc(round(NEAR_BY * pitch * scale))
    deepest = cv2.resize(cv2.dilate(smaller(missing, scale), near), (width, height))
    is_shade = missing > np.maximum(HALF * deepest, SEEN_EDGE)
    if not is_shade.any() or is_shade.all():
        return np.zeros_like(missing)
    return -signed_distance(is_shade)


def _stops(far: float) -> list[float]:
    """Distances from the edge, px, close together where it is, and as far as `far`."""
    steps, at = [0.0], FIRST
    while at < far:
        steps.append(at)
        at *= GROWTH
    return [-2 * far, *(-step for step in reversed(steps[1:])), *steps, far]


def _mean(picture: F32, weight: F32, sigma: float) -> F32:
    """(h, w, 3) the mean of what has a weight (h, w) around each px."""
    share = widely_blurred(weight, sigma)
    total = widely_blurred(picture * weight[..., None], sigma)
    return np.asarray(total / np.maximum(share, 1e-6)[..., None], np.float32)


CALM = 0.7, 1.6  # natural logarithm of missing light, from which colours are smooth, and wholly so
CALM_REACH, CALM_EPS = 16, 0.003  # px: two blocks of a JPEG file; variance that is no edge
CALM_GUIDE = 2.0  # px, over which that is measured
LEAST_KNOWN = np.float32(0.05)  # of the px around, that must be in the shade
EDGE_PX, EDGE_CELLS = 1.5, 0.15  # px and cells: half the width of a hard edge, which is invented
SPECK = 7  # px, of what is no part of a shade, and no hole in one
EDGE_WIDTH = 0.7  # px: the first px on either side
LOST = 1.1  # natural logarithm of missing light, from which the ground is invented
SEEN = 1 / 512  # of encoded light: less is no shadow
BLACK = 0.02  # of linear light, below which a logarithm says little
REACH = 2.0  # cells of what is missing, over which it is sharpened
HARD = 0.9  # natural logarithm of missing light, from which an edge is looked for in the photo
WIDE = 3.0  # cells, over which the light on either side of an edge is measured
SIDES = (0.15, 0.85)  # of what is missing there, that is lit ground, or all in shadow
FINE = 0.1  # cells, over which a px's light is measured
LEAST_SIDE = np.float32(0.01)  # of the px around: so much its usual light weighs
MOSTLY = 0.5  # of a cell that is ground
SURE_EDGE = (0.3, 0.7)  # of the way from lit to shaded: what is between belongs to both
NOISY = 2.0  # x the ground's, the contrast that is no edge
LEAST_EPS = 1e-3
SOFT = 0.05  # natural logarithm of light
THIRDS = np.full((1, 3), 1 / 3, np.float32)  # the mean of three colours, as cv2.transform wants it


@dataclass(frozen=True, eq=False)
class OldShadow:
    """The ground's light that an object takes away, and the parameters of an equal shadow."""

    shadow: Shadow
    depth: F32  # (h, w) natural logarithm of the light that is missing, 0 along its border
    left: float  # photo px, its corner
    top: float
    pitch: float  # photo px per px of it
    noise: float  # natural logarithm, of the ground
    free: F32  # (h, w) in [0, 1] where the ground is seen: no object is taken for it

    def missing(self, box: Box) -> F32:
        """(h, w) natural logarithm of linear light, at the pixels of a box of the photo."""
        return sampled(self.depth, (self.left, self.top), self.pitch, box)

    def bounds(self, width: int, height: int) -> Box:
        """x0, y0, x1, y1 px around it, within a photo of that size."""
        return cells_bounds(self.depth, (self.left, self.top), self.pitch, (width, height))


def without_shadow(pixels: Pixels, old: OldShadow, box: Box) -> tuple[Pixels, Mask]:
    """The pixels (h, w, 3) of a `box` of the photo in full light, and where that is another one."""
    lit, is_changed, _ = _lifted(pixels, old, box)
    return lit, is_changed


class _Seen(NamedTuple):
    """What a box of the photo shows of a shadow."""

    free: Mask  # (h, w) where the ground is seen
    colours: F32  # (h, w, 3) natural logarithm of linear light
    light: F32  # (h, w) the mean of them
    missing: F32  # (h, w) natural logarithm of the light that is missing
    is_told: Mask  # (h, w) where the photo's own step says so


def _seen(pixels: Pixels, old: OldShadow, box: Box) -> _Seen:
    part = pixels[box[1] : box[3], box[0] : box[2]]
    free = sampled(old.free, (old.left, old.top), old.pitch, box) > MOSTLY
    colours = np.log(unit_pixels(part) ** np.float32(GAMMA) + np.float32(BLACK))
    light = np.asarray(cv2.transform(colours, THIRDS), np.float32)
    sharp = _sharpened(old.missing(box), light, old)
    return _Seen(free, colours, light, *_hard_edged(sharp, light, old, free))


def _lifted(pixels: Pixels, old: OldShadow, box: Box) -> tuple[Pixels, Mask, Mask]:
    """As `without_shadow`, and where it is so dark that the photo shows little of the ground.

    Where a hard edge shows how dark it is, ground that is darker still shows enough.
    """
    height, width = pixels.shape[:2]
    around = _grown(old.bounds(width, height), LOOKS * old.pitch, width, height)
    part = pixels[around[1] : around[3], around[0] : around[2]]
    free, colours, light, missing, is_told = _seen(pixels, old, around)
    found = old.missing(around)
    usual = usual_light(light, missing, free, old.pitch)
    within = bounded(missing, light, usual, old.pitch)
    missing = np.asarray(np.where(is_told, missing, within), np.float32)
    dim, black = (
        (found > LOST) & is_dim(light, old.pitch),
        too_dark(missing, light, usual, old.pitch),
    )
    is_lost = np.where(is_told, False, dim | black)
    if is_told.any():
        is_lost |= is_told & free & _is_edge(missing, old.pitch)
    tint = tinted(colours, missing, free & ~is_lost, old.pitch)
    lit = unit_pixels(part) * np.exp(missing[..., None] * (tint / np.float32(GAMMA)))
    lit = evened(lit, missing, free & ~is_lost, old.pitch)
    lit = calmed(lit, missing, free)
    change = cv2.absdiff(lit, unit_pixels(part))
    is_changed = np.maximum(np.maximum(change[..., 0], change[..., 1]), change[..., 2]) > SEEN / 2
    result = np.where(is_changed[..., None], pixels_from_unit(lit, pixels.dtype), part)
    inner = overlap(around, box)
    changed, lost = (crop(each, around, box) for each in (is_changed, is_lost))
    shown = pixels[box[1] : box[3], box[0] : box[2]].copy()
    if inner is not None:
        cut(shown, box, inner)[:] = cut(result, around, inner)
    return shown, changed, lost


def _grown(box: Box, reach: float, width: int, height: int) -> Box:
    """A box with so many px around it, within a photo of that size."""
    x0, y0, x1, y1 = box
    far = round(reach)
    return max(x0 - far, 0), max(y0 - far, 0), min(x1 + far, width), min(y1 + far, height)


def _sharpened(missing: F32, light: F32, old: OldShadow) -> F32:
    """(h, w) the missing light with the edges that the photo has there (He et al. 2013).

    The more texture the ground has, the less is taken for an edge.
    """
    if not missing.any():
        return missing
    radius, eps = max(round(REACH * old.pitch), 1), (NOISY * old.noise) ** 2 + LEAST_EPS
    found = cv2.ximgproc.guidedFilter(light, missing, radius, eps)
    near = np.clip(missing / SOFT, 0, 1)  # nothing is given to what had none
    return np.asarray(np.clip(found, 0, None) * near, np.float32)


def _hard_edged(missing: F32, light: F32, old: OldShadow, is_free: Mask) -> tuple[F32, Mask]:
    """(h, w) the missing light with the photo's own step from lit to shaded, and where it has one.

    What was found is on a grid, and blurred: across a hard edge it would lighten what is lit, and
    leave the shadow's rim. Each px is told by its own light which side it is on, and what is
    missing in the shade is what lit ground beside it has more.
    """
    deep = float(missing.max(initial=0))
    sides = [is_free & (missing < SIDES[0] * deep), is_free & (missing > SIDES[1] * deep)]
    is_outline = old.shadow.ground == FROM_ABOVE  # else parts of it are soft, and in other light
    if deep < HARD or not is_outline or not all(side.any() for side in sides):
        return missing, np.zeros(missing.shape, bool)
    levels = []
    for side in sides:
        weight = side.astype(np.float32)
        near = widely_blurred(weight, WIDE * old.pitch)
        total = widely_blurred(light * weight, WIDE * old.pitch)
        usual = np.float32(np.median(light[side]))  # where none of it is near
        levels.append((total + LEAST_SIDE * usual) / (near + LEAST_SIDE))
    step = levels[0] - levels[1]
    fine = widely_blurred(light, max(FINE * old.pitch, 0.5))
    into = (levels[0] - fine) / np.maximum(step, HARD)
    into = np.clip((into - SURE_EDGE[0]) / (SURE_EDGE[1] - SURE_EDGE[0]), 0, 1)
    is_told = (step > HARD) & (missing > 0)
    into *= _is_joined(into, missing > SIDES[1] * deep, old.pitch)  # not a dark thing beside it
    # Told of light + BLACK: of the light alone, as it is given back, more is missing.
    dark = np.maximum(np.exp(levels[1]) - BLACK, BLACK / 2)
    lacking = np.log(np.maximum(np.exp(levels[0]) - BLACK, dark) / dark)
    return np.where(is_told, into * lacking, missing).astype(np.float32), is_told


def _is_edge(missing: F32, pitch: float) -> Mask:
    """(h, w) where a hard edge runs: its px are neither lit nor in shade, and sharpened."""
    return np.asarray(_from_hard_edge(missing) < EDGE_PX + EDGE_CELLS * pitch, np.bool_)


def _from_hard_edge(missing: F32) -> F32:
    """(h, w) px from the edge, on either side. Specks of the ground have none."""
    return np.abs(signed_distance(_without_specks(missing > HALF * float(missing.max()))))


def edge_blur(pixels: Pixels, old: OldShadow) -> float | None:
    """Return the blur of a hard edge, px: the standard deviation of a bell; None where none is."""
    height, width = pixels.shape[:2]
    seen = _seen(pixels, old, old.bounds(width, height))
    if not seen.is_told.any():
        return None
    away = _from_hard_edge(seen.missing)
    near = (away < WIDE * old.pitch) & seen.is_told & seen.free
    share = seen.missing / float(np.median(seen.missing[seen.missing > HARD]))
    on_edge = near & (away < EDGE_WIDTH)
    between = near & (share > SIDES[0]) & (share < SIDES[1])
    # Of a bell's edge, what is between the two lies within 2.07 deviations.
    return float(between.sum() / max(int(on_edge.sum()) / 2, 1) / 2.07)


def _is_joined(into: F32, core: Mask, pitch: float) -> Mask:
    """(h, w) the shade, where one is half `into` it, that holds the `core`; with its edge."""
    is_shade = _without_specks(into > HALF)
    _, labels = cv2.connectedComponents(is_shade.astype(np.uint8))
    joined = np.isin(labels, np.unique(labels[core & is_shade]))
    return np.asarray(signed_distance(joined) > -(EDGE_PX + EDGE_CELLS * pitch), np.bool_)


def _without_specks(mask: Mask) -> Mask:
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (SPECK, SPECK))
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, kernel)
    return cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel) > 0


def traceless_plate(
    pixels: Pixels,
    covered: Mask,
    shadows: Sequence[OldShadow],
    inpainter: Inpainter,
    progress: Progress = silent,
    seed: int = 0,
    hints: tuple[Hint, ...] = (),
) -> Plate:
    """Build the plate of the photo in full light: shadows beside objects go as well.

    There it is painted, as by hand: shown wherever something has moved. Where it is so dark that
    the photo shows little of the ground, it is invented.
    """
    height, width = covered.shape
    lit = pixels.copy()
    is_changed, lost = np.zeros_like(covered), np.zeros_like(covered)
    shades = [old.bounds(width, height) for old in shadows]
    for old, shade in zip(shadows, shades, strict=True):
        part = (slice(shade[1], shade[3]), slice(shade[0], shade[2]))
        lit[part], is_other, is_lost = _lifted(lit, old, shade)
        is_changed[part] |= is_other
        lost[part] |= is_lost
    lost &= ~covered
    filled = covered | lost
    filled = covered if filled.all() else filled
    own = build_plate(lit, filled, inpainter, progress, seed, hints)
    boxes = np.array([own.box, *shades])
    x0, y0 = (int(v) for v in boxes[:, :2].min(0))
    x1, y1 = (int(v) for v in boxes[:, 2:].max(0))
    box = (x0, y0, x1, y1)
    hole = crop(own.hole, own.box, box)
    is_bare = ~covered[y0:y1, x0:x1]
    lightened = is_changed[y0:y1, x0:x1] & is_bare & ~hole
    result = np.where(lightened[..., None], lit[y0:y1, x0:x1], pixels[y0:y1, x0:x1])
    np.copyto(cut(result, box, own.box), own.pixels, where=own.hole[..., None])
    reach = cv2.distanceTransform((~lost[y0:y1, x0:x1]).astype(np.uint8), cv2.DIST_L2, 5)
    painted = lightened | (hole & is_bare & (reach < hole_margin(width, height)))
    return Plate(x0, y0, result, hole | painted, own.backend, seed, painted)
