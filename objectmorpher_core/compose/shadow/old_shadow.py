"""The shadow that an object throws in the photo, taken off the ground.

Where it falls the ground is divided by the light that is missing there: the photo's own texture
stays (promise 2). Only what is too dark to show any is invented.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, Mask, Pixels
from ...base.pixels import crop, pixels_from_unit, unit_pixels
from ...base.progress import Progress, silent
from ...document.model import Plate
from ...document.settings import Hint, Shadow
from .. import Inpainter
from ..plate.plate import Box, build_plate, cut, hole_margin, overlap
from ..silhouette import cells_bounds, sampled
from . import shadow_edge
from .shadow import GAMMA

LOST = 1.1  # natural logarithm of missing light, from which the ground is invented
SEEN = 1 / 512  # of encoded light: less is no shadow
BLACK = 0.02  # of linear light, below which a logarithm says little
REACH = 2.0  # cells of what is missing, over which it is sharpened
FROM_ABOVE = 90.0  # degrees: the shadow is the outline itself
HARD = 0.9  # natural logarithm of missing light, from which an edge is looked for in the photo
WIDE = 3.0  # cells, over which the light on either side of an edge is told
SIDES = (0.15, 0.85)  # of what is missing there, that is lit ground, or all in shadow
FINE = 0.1  # cells, over which a px's light is told
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


def _lifted(pixels: Pixels, old: OldShadow, box: Box) -> tuple[Pixels, Mask, Mask]:
    """As `without_shadow`, and where it is so dark that the photo shows little of the ground.

    Where a hard edge tells how dark it is, ground that is darker still shows enough.
    """
    height, width = pixels.shape[:2]
    around = _grown(old.bounds(width, height), shadow_edge.LOOKS * old.pitch, width, height)
    part = pixels[around[1] : around[3], around[0] : around[2]]
    free = sampled(old.free, (old.left, old.top), old.pitch, around) > MOSTLY
    colours = np.log(unit_pixels(part) ** np.float32(GAMMA) + np.float32(BLACK))
    # Natural logarithm of linear light.
    light = np.asarray(cv2.transform(colours, THIRDS), np.float32)
    found = old.missing(around)
    missing, is_told = _hard_edged(_sharpened(found, light, old), light, old, free)
    usual = shadow_edge.usual_light(light, missing, free, old.pitch)
    bounded = shadow_edge.bounded(missing, light, usual, old.pitch)
    missing = np.asarray(np.where(is_told, missing, bounded), np.float32)
    dim, black = (
        (found > LOST) & shadow_edge.is_dim(light, old.pitch),
        shadow_edge.too_dark(missing, light, usual, old.pitch),
    )
    is_lost = np.where(is_told, False, dim | black)
    tint = shadow_edge.tinted(colours, missing, free & ~is_lost, old.pitch)
    lit = unit_pixels(part) * np.exp(missing[..., None] * (tint / np.float32(GAMMA)))
    lit = shadow_edge.evened(lit, missing, free & ~is_lost, old.pitch)
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
        near = shadow_edge.widely_blurred(weight, WIDE * old.pitch)
        total = shadow_edge.widely_blurred(light * weight, WIDE * old.pitch)
        usual = np.float32(np.median(light[side]))  # where none of it is near
        levels.append((total + LEAST_SIDE * usual) / (near + LEAST_SIDE))
    step = levels[0] - levels[1]
    fine = shadow_edge.widely_blurred(light, max(FINE * old.pitch, 0.5))
    into = (levels[0] - fine) / np.maximum(step, HARD)
    into = np.clip((into - SURE_EDGE[0]) / (SURE_EDGE[1] - SURE_EDGE[0]), 0, 1)
    is_told = (step > HARD) & (missing > 0)
    # Told of light + BLACK: of the light alone, as it is given back, more is missing.
    dark = np.maximum(np.exp(levels[1]) - BLACK, BLACK / 2)
    lacking = np.log(np.maximum(np.exp(levels[0]) - BLACK, dark) / dark)
    return np.where(is_told, into * lacking, missing).astype(np.float32), is_told


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
