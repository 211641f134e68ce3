"""Light of the new place on a moved object, without any weights.

What the background looks like around where the object was, and around where it is now, are two
mean colours in linear light. Their ratio is what the object's light changes by, as far as one can
tell: a background of another material looks like other light. So the ratio's colour counts half,
small ratios count as none, and large ones are limited.

A power of 2.2 stands for sRGB's curve: then the gain multiplies the encoded values, too, and the
window does what the export does. An object that did not move has the gain 1, exactly.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import F32, F64, U8
from ..document import Document
from ..pixels import unit_pixels
from .shadow import GAMMA
from .silhouette import Silhouette, sampled

Gain = tuple[float, float, float]  # of encoded red, green and blue

NEUTRAL: Gain = (1.0, 1.0, 1.0)
MAP = 96  # px, longer side of the small picture of the background
RING = 0.15  # x the silhouette's longer side, how far around the object one looks
LEAST, MOST = 0.6, 1.6  # gain in linear light
DEAD = 0.04  # in logarithms of linear light: less is no difference of light
COLOUR = 0.5  # share of the ratio's colour that counts
MIDDLE = (20, 80)  # percentiles of luminance: what is darker or brighter is not asked
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
DARK = 1e-3  # linear light below which a ratio says nothing
COVERED = 0.3  # of a small pixel
LEAST_PIXELS = 4  # of the small picture


def light_map(document: Document) -> F32:
    """(h, w, 3) the background, small, in linear light.

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
    small = cv2.resize(unit_pixels(pixels), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small ** np.float32(GAMMA), np.float32)


def light_gain(light: F32, width: int, before: Silhouette, now: Silhouette) -> Gain:
    """What the object's encoded colours are multiplied by at full strength.

    `light` is the photo's `light_map`, `width` the photo's px; the object was at `before`.
    """
    old, new = _mean(light, width, before), _mean(light, width, now)
    if old is None or new is None:
        return NEUTRAL
    ratio = np.log(np.maximum(new, DARK) / np.maximum(old, DARK))
    whole = float(np.log(max(new @ LUMINANCE, DARK) / max(old @ LUMINANCE, DARK)))
    wanted = _beyond(np.array(whole)) + COLOUR * _beyond(ratio - whole)
    linear = np.clip(wanted, np.log(LEAST), np.log(MOST))
    r, g, b = np.exp(linear / GAMMA).tolist()
    return r, g, b


def at_strength(gain: Gain, harmony: float) -> Gain:
    """A part of a gain: 0 is none of it, 1 all."""
    r, g, b = (channel**harmony for channel in gain)
    return r, g, b


def lit(colour: F32, alpha: F32, gain: Gain) -> F32:
    """Premultiplied colours (h, w, 3) under a gain; none is brighter than white."""
    if gain == NEUTRAL:
        return colour
    return np.minimum(colour * np.array(gain, np.float32), alpha[..., None])


def lit_rgba(rgba: U8, gain: Gain) -> U8:
    """The same of a picture (h, w, 4) u8."""
    if gain == NEUTRAL:
        return rgba
    steps = np.arange(256)[:, None] * np.array([*gain, 1.0]) + 0.5
    table = steps.clip(0, 255).astype(np.uint8)[:, None]
    lit = np.asarray(cv2.LUT(rgba, np.ascontiguousarray(table.transpose(1, 0, 2))), np.uint8)
    return np.minimum(lit, rgba[..., 3:])


def _beyond(logarithm: np.ndarray) -> np.ndarray:
    """What of a logarithm is more than a difference that says nothing."""
    return np.sign(logarithm) * np.maximum(np.abs(logarithm) - DEAD, 0)


def _mean(light: F32, width: int, shape: Silhouette) -> F64 | None:
    """(3,) of the background at an object and around it; None where that is not in the photo."""
    pitch = width / light.shape[1]  # photo px per px of the map
    corner = (shape.left / pitch, shape.top / pitch)
    box = (0, 0, light.shape[1], light.shape[0])
    covered = sampled(shape.alpha, corner, shape.pitch / pitch, box) > COVERED
    if not covered.any():
        return None
    reach = max(round(RING * max(shape.alpha.shape) * shape.pitch / pitch), 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    around = cv2.dilate(covered.astype(np.uint8), kernel) > 0
    colours = light[around].astype(np.float64)
    luminance = colours @ LUMINANCE
    low, high = np.percentile(luminance, MIDDLE)
    middle = colours[(luminance >= low) & (luminance <= high)]
    return middle.mean(0) if len(middle) >= LEAST_PIXELS else None
