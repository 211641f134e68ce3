"""Light of the new place on a moved object, without any weights.

What the background looks like around where the object was, and around where it is now, are two
mean colours in linear light. Their ratio is what the object's light changes by, as far as one can
tell: a background of another material looks like other light. So the ratio's colour counts half,
large ratios are limited, and all of it counts the less, the less it exceeds its doubt:

    w = x max(0, 1 - (d / x)^2),   d = what says nothing + spread + off

(the non-negative garrote, Breiman 1995: below its doubt nothing is changed, far above it all is).
The spread is found at each place itself: where its quarters differ, and not as light does that
falls evenly from place to place, as much again may differ between the places. Off is how far the
ratio's colour is from any that lamps, shade and sky differ by, which are warmer or colder than each
other: red beside green is another material, and so its brightness says little, too.
`docs/compositing` measures all that.

A power of 2.2 stands for sRGB's curve: then the gain multiplies the encoded values, too, and the
window does what the export does. An object that did not move has the gain 1, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...base.arrays import F32, F64, U8, unit_pixels
from ...base.masks import dilated
from ...document.model import Document
from ...document.transparency import is_seen
from ..plate.plate import plate_alpha
from ..shadow.shadow import GAMMA
from ..silhouette import Silhouette, sampled

Gain = tuple[float, float, float]  # of encoded red, green and blue

NEUTRAL: Gain = (1.0, 1.0, 1.0)
MAP = 96  # px, longer side of the small picture of the background
RING = 0.15  # x the silhouette's longer side, how far around the object one looks
LEAST, MOST = 0.6, 1.6  # gain in linear light
DEAD = 0.08  # in logarithms of linear light: less is no difference of light
STRANGE = 0.25  # likewise between two photos, whose things are others; looked at, not fitted
DOUBT = 4.0  # x how far the quarters of a place are apart: that, too, says nothing
# x how far the ratio's colour is off from warmer or colder: red, green, blue, luminance.
OFF = np.array([2.0, 2.0, 2.0, 1.0])
# Of logarithms of linear red, green and blue, less that of luminance: from a black body of 6500 K
# to one of 4000 K red gains 0.30, green loses 0.06 and blue 0.66 (CIE 1931, sRGB).
WARMER = np.array([0.30, -0.06, -0.66]) / np.linalg.norm([0.30, -0.06, -0.66])
COLOUR = 0.5  # share of the ratio's colour that counts
MIDDLE = (20, 80)  # percentiles of luminance: what is darker or brighter is not asked
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LUMA = np.array([0.299, 0.587, 0.114], np.float32)  # of encoded values
DARK = 1e-3  # linear light below which a ratio says nothing
COVERED = 0.3  # of a small pixel
SHOWN = 0.5  # of a small pixel, from which the photo is not clear there
LEAST_PIXELS = 4  # of the small picture


def light_map(document: Document) -> F32:
    """(h, w, 3) the background, small, in linear light; nan where the photo is clear.

    Of a large photo every so many pixels are looked at.
    """
    width, height = document.photo.size
    step = max(max(width, height) // (8 * MAP), 1)
    pixels = document.photo.pixels[::step, ::step].copy()
    if (plate := document.plate) is not None:
        row, column = -(-plate.top // step), -(-plate.left // step)
        every = np.s_[row * step - plate.top :: step, column * step - plate.left :: step]
        hole = plate.hole[every]
        part = pixels[row : row + hole.shape[0], column : column + hole.shape[1]]
        np.copyto(part, plate.pixels[every], where=hole[..., None])
    shrink = min(MAP / max(pixels.shape[:2]), 1.0)
    size = (max(round(pixels.shape[1] * shrink), 1), max(round(pixels.shape[0] * shrink), 1))
    light = unit_pixels(pixels)
    if (alpha := plate_alpha(document)) is None:
        small = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    else:
        small = _shrunk(light, is_seen(alpha[::step, ::step]).astype(np.float32), size)
    return np.asarray(small ** np.float32(GAMMA), np.float32)


def _shrunk(light: F32, seen: F32, size: tuple[int, int]) -> F32:
    """The means (h, w, 3) of what is `seen` (H, W) of a picture; nan where little of it is."""
    whole = cv2.resize(light * seen[..., None], size, interpolation=cv2.INTER_AREA)
    share = cv2.resize(seen, size, interpolation=cv2.INTER_AREA)[..., None]
    small = np.where(share > SHOWN, whole / np.maximum(share, SHOWN), np.nan)
    return np.asarray(small, np.float32)


def light_gain(light: F32, width: int, before: Silhouette, now: Silhouette) -> Gain:
    """Return the factors of the object's encoded colours at full strength.

    `light` is the photo's `light_map`, `width` the photo's px; the object was at `before`.
    """
    old, new = _around(light, width, before), _around(light, width, now)
    if old is None or new is None:
        return NEUTRAL
    whole, ratio = _difference(old.mean, new.mean)
    # What differs within each of the places for no light's reason may differ between them, too.
    return _gain(whole, ratio, DEAD + DOUBT * _spread(old, new, np.array([*ratio, whole])))


def light_around(light: F32, width: int, place: Silhouette) -> tuple[float, float, float] | None:
    """Linear RGB of the background around a place; None where too little of it is seen."""
    found = _around(light, width, place)
    if found is None:
        return None
    r, g, b = found.mean.tolist()
    return r, g, b


def visitor_gain(
    own: tuple[float, float, float] | None, now: tuple[float, float, float] | None
) -> Gain:
    """Return the factors of the colours of an object of another photo, at full strength.

    `own` is the light around it there, `now` around where it is here. What stands around it are
    other things in other colours: a tint that no light has says nothing, as within one photo.
    """
    if own is None or now is None:
        return NEUTRAL
    whole, ratio = _difference(np.array(own), np.array(now))
    return _gain(whole, ratio, np.full(4, DEAD + STRANGE))


def _gain(whole: np.ndarray, ratio: F64, doubt: F64) -> Gain:
    """The factors for a difference that may be wrong by `doubt` (4,): channels, luminance."""
    doubt = doubt + OFF * float(np.linalg.norm(ratio - (ratio @ WARMER) * WARMER))
    wanted = _beyond(whole, doubt[3]) + COLOUR * _beyond(ratio, doubt[:3])
    linear = np.clip(wanted, np.log(LEAST), np.log(MOST))
    r, g, b = np.exp(linear / GAMMA).tolist()
    return r, g, b


def _difference(old: F64, new: F64) -> tuple[np.ndarray, F64]:
    """Of luminance, and (3,) of each channel more than that: logarithms of linear light."""
    whole = np.log(max(new @ LUMINANCE, DARK) / max(old @ LUMINANCE, DARK))
    return np.array(whole), np.log(np.maximum(new, DARK) / np.maximum(old, DARK)) - whole


def _spread(old: _Around, new: _Around, change: F64) -> F64:
    """(4,) how far the quarters of the place that is more alike are apart: channels, luminance.

    Less what light explains that falls evenly from one place to the other, where it explains any;
    `change` (4,) is what it falls by.
    """
    way = new.middle - old.middle
    length = max(float(way @ way), 1.0)
    spreads = []
    for place in (old, new):
        parts = [_difference(place.mean, part) for part in place.parts]
        values = np.array([[*ratio, whole] for whole, ratio in parts])  # (n, 4)
        ramp = ((place.middles - place.middle) @ way / length)[:, None] * change
        spreads.append(np.minimum(values.std(0), (values - ramp).std(0)))
    return np.array(spreads).min(0)


def at_strength(gain: Gain, harmony: float) -> Gain:
    """A part of a gain: 0 is none of it, 1 all."""
    r, g, b = (channel**harmony for channel in gain)
    return r, g, b


def lit(colour: F32, alpha: F32, gain: Gain) -> F32:
    """Premultiplied colours (h, w, 3) under a gain; none is brighter than white."""
    if gain == NEUTRAL:
        return colour
    return np.minimum(colour * np.array(gain, np.float32), alpha[..., None])


def saturated(colour: F32, alpha: F32, saturation: float) -> F32:
    """Premultiplied colours (h, w, 3) so many times as far from grey; see light.glsl."""
    if saturation == 1:
        return colour
    grey = (colour @ LUMA)[..., None]
    changed = grey + np.float32(saturation) * (colour - grey)
    return np.minimum(np.maximum(changed, 0), alpha[..., None])


def lit_rgba(rgba: U8, gain: Gain) -> U8:
    """Light a picture (h, w, 4) u8."""
    if gain == NEUTRAL:
        return rgba
    steps = np.arange(256)[:, None] * np.array([*gain, 1.0]) + 0.5
    table = steps.clip(0, 255).astype(np.uint8)[:, None]
    lit = np.asarray(cv2.LUT(rgba, np.ascontiguousarray(table.transpose(1, 0, 2))), np.uint8)
    return np.minimum(lit, rgba[..., 3:])


def _beyond(logarithm: np.ndarray, doubt: np.ndarray) -> np.ndarray:
    """What of a logarithm counts, which may be wrong by `doubt` (> 0)."""
    return logarithm * (1 - (doubt / np.maximum(np.abs(logarithm), doubt)) ** 2)


@dataclass(frozen=True, eq=False)
class _Around:
    """The background at an object and around it."""

    mean: F64  # (3,) linear light
    middle: F64  # (2,) px of the map
    parts: F64  # (n, 3) the mean of each quarter of it
    middles: F64  # (n, 2)


def _around(light: F32, width: int, shape: Silhouette) -> _Around | None:
    """None where that is not in the photo, or clear."""
    pitch = width / light.shape[1]  # photo px per px of the map
    corner = (shape.left / pitch, shape.top / pitch)
    box = (0, 0, light.shape[1], light.shape[0])
    covered = sampled(shape.alpha, corner, shape.pitch / pitch, box) > COVERED
    if not covered.any():
        return None
    reach = max(round(RING * max(shape.alpha.shape) * shape.pitch / pitch), 1)
    around = dilated(covered, reach) & ~np.isnan(light[..., 0])
    places = np.argwhere(around)[:, ::-1].astype(np.float64)
    colours = light[around].astype(np.float64)
    mean = _mean(colours)
    if mean is None:
        return None
    middle = places.mean(0)
    quarter = (places > middle) @ [1, 2]
    parts, middles = [mean], [middle]
    for k in range(4):
        own = quarter == k
        if (part := _mean(colours[own])) is not None:
            parts.append(part)
            middles.append(places[own].mean(0))
    return _Around(mean, middle, np.array(parts[1:] or parts), np.array(middles[1:] or middles))


def _mean(colours: F64) -> F64 | None:
    """(3,) of colours (n, 3) of middling luminance; None where there are too few."""
    luminance = colours @ LUMINANCE
    if len(colours) == 0:
        return None
    low, high = np.percentile(luminance, MIDDLE)
    middle = colours[(luminance >= low) & (luminance <= high)]
    return middle.mean(0) if len(middle) >= LEAST_PIXELS else None
