"""From a hard mask to a soft cut-out: alpha and the object's own colours at its edge.

In a narrow band about the mask's edge each pixel is a mixture of a colour of the object and one
of the background. Alpha comes from closed-form matting (Levin et al. 2008), solved on the band
alone; the object's colour is what remains when the background's share is taken out, as far as it
is near what stands beside it. Where the artist drew a soft edge, that edge is alpha.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import F32, Mask, Pixels, Selection
from ..document import Matte
from ..pixels import unit_pixels
from .closed_form import solve_alpha
from .mask_edit import FULL, grow, is_selected, is_soft

BAND = 0.0040  # x the photo's diagonal: half-width of the band where alpha may be soft
MIN_BAND = 2.0  # px
REACH = 2.5  # x band: how far the colours of object and background are gathered
EXTENSION = 0.12  # x the object's size: how far it goes on where the photo ends
TRUST = 0.2  # sRGB: how far an unmixed colour may be from the object's colour beside it


def band_width(width: int, height: int) -> float:
    """Half-width in px of the soft band for a photo of this size."""
    return max(MIN_BAND, BAND * float(np.hypot(width, height)))


def frame_extension(mask: Mask) -> tuple[int, int, int, int]:
    """How far, in px, an object that leaves the photo is continued: top, bottom, left, right.

    Turned or moved, such an object would show its cut edge. Mirrored at the frame it goes on for
    a tenth of its size; those pixels are invented, and counted so.
    """
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    reach = round(EXTENSION * max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1)
    touches = (rows[0] == 0, rows[-1] == height - 1, columns[0] == 0, columns[-1] == width - 1)
    limits = (height - 1, height - 1, width - 1, width - 1)
    top, bottom, left, right = (
        int(min(reach, limit)) if touch else 0 for touch, limit in zip(touches, limits, strict=True)
    )
    return top, bottom, left, right


def extended(image: np.ndarray, extension: tuple[int, int, int, int]) -> np.ndarray:
    """`image` (H, W, ...) continued past its frame by mirroring."""
    top, bottom, left, right = extension
    pads = [(top, bottom), (left, right)] + [(0, 0)] * (image.ndim - 2)
    return np.pad(image, pads, mode="reflect")


def extended_mask(mask: Selection, extension: tuple[int, int, int, int]) -> Selection:
    """`mask` (H, W), bool or u8, continued like `extended`, but only where it touches the frame.

    What merely stands near the frame must not come back as its own mirror image.
    """
    top, bottom, left, right = extension
    whole = extended(mask, extension)
    height, width = whole.shape
    for axis, near, far in ((0, top, height - bottom), (1, left, width - right)):
        turned = np.moveaxis(whole, axis, 0)  # a view: both sides are changed in place
        turned[:near] = np.minimum.accumulate(turned[near::-1])[:0:-1]
        turned[far:] = np.minimum.accumulate(turned[far - 1 :])[1:]
    return whole


def build_matte(pixels: Pixels, mask: Selection, margin: int) -> Matte:
    """Soft cut-out of `mask` (H, W) in the photo (H, W, 3), on a crop with `margin` px around it.

    A mask of u8 is a coverage: where it is soft, it is the cut-out's alpha.
    Where the object leaves the photo the crop does so too, see `frame_extension`.
    Raises ValueError for an empty mask or one that is not the photo's size.
    """
    if mask.shape != pixels.shape[:2]:
        raise ValueError(f"mask is {mask.shape}, photo is {pixels.shape[:2]}")
    if not is_selected(mask).any():
        raise ValueError("the mask is empty")
    band = band_width(mask.shape[1], mask.shape[0])
    extension = frame_extension(is_selected(mask))
    mask = extended_mask(mask, extension)
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    left, top = max(columns[0] - margin, 0), max(rows[0] - margin, 0)
    right, bottom = min(columns[-1] + 1 + margin, width), min(rows[-1] + 1 + margin, height)
    window = (slice(top, bottom), slice(left, right))
    rgb = unit_pixels(extended(pixels, extension)[window])
    alpha, foreground = _soft_edge(rgb, mask[window], band)
    return Matte(int(left) - extension[2], int(top) - extension[0], alpha, foreground)


def _soft_edge(rgb: F32, selection: Selection, band: float) -> tuple[F32, F32]:
    """Alpha (h, w) and foreground (h, w, 3) for a crop."""
    mask = is_selected(selection)
    distance = signed_distance(mask)  # px, > 0 inside
    # A limb thinner than the band has its ridge for what is certain.
    ridge = mask & (distance >= cv2.dilate(distance, np.ones((3, 3))) - 0.25)
    inner = (distance > band) | (ridge & (distance > 0.75))
    outer = distance < -band
    drawn = _drawn(selection, band)
    prior = np.clip(0.5 + distance / band, 0, 1)
    alpha = solve_alpha(rgb, inner | (drawn & mask), outer | (drawn & ~mask), prior)
    alpha = np.where(drawn, selection / np.float32(FULL), alpha).astype(np.float32)
    sure = inner & (alpha > 0.98)
    inside = _gather(rgb, (sure if sure.any() else mask).astype(np.float32), REACH * band)
    outside = _gather(rgb, (outer & (alpha < 0.02)).astype(np.float32), REACH * band)
    # The colour that explains a mixed pixel, as far as it is near what stands beside it: the
    # thinner the pixel's share of the object, the less it says.
    share = alpha[..., None]
    unmixed = (rgb - (1 - share) * outside) / np.maximum(share, 1e-3)
    room = TRUST * share**2
    mixed = np.clip(unmixed, inside - room, inside + room)
    foreground = np.where(share < 1.0, mixed, rgb)
    if drawn.any():
        # There the photo is no mixture: what is inside the line is the object's own colour.
        own = drawn[..., None] * np.clip(2 * share - 1, 0, 1)
        foreground += own * (rgb - foreground)
    return alpha, np.clip(foreground, 0, 1).astype(np.float32)


def _drawn(selection: Selection, band: float) -> Mask:
    """Where (h, w) the edge is the artist's: what is drawn soft, and the band beside it."""
    if selection.dtype == np.bool_:
        return np.zeros(selection.shape, np.bool_)
    return grow(is_soft(selection), band)


def signed_distance(mask: Mask) -> F32:
    """Distance in px (H, W) to the mask's edge, positive inside; the photo's frame is no edge."""
    padded = np.pad(mask, 1, mode="edge").astype(np.uint8)
    inside = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    outside = cv2.distanceTransform(1 - padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    return np.where(mask, inside - 0.5, 0.5 - outside).astype(np.float32)


def _gather(rgb: F32, weights: F32, reach: float) -> F32:
    """Mean colour (h, w, 3) of the weighted pixels nearby, everywhere.

    Normalised convolution over widening windows: the narrowest window that saw anything decides,
    so detail near the edge stays local and far pixels still get a colour.
    """
    colour = np.zeros_like(rgb)
    known = np.zeros(rgb.shape[:2], np.float32)
    premultiplied = rgb * weights[..., None]
    sigma = max(reach / 2, 1.0)
    largest = float(max(rgb.shape[:2]))
    while True:
        window = (0, 0)
        total = _blur(weights, sigma, window)
        mean = _blur(premultiplied, sigma, window) / np.maximum(total, 1e-12)[..., None]
        share = np.clip(total / 0.02, 0, 1) * (1 - known)
        colour += mean * share[..., None]
        known += share
        if known.min() > 0.999 or sigma > largest:
            break
        sigma *= 2.5
    missing = np.maximum(known, 1e-6)[..., None]
    return (colour / missing).astype(np.float32)


def _blur(image: np.ndarray, sigma: float, window: tuple[int, int]) -> np.ndarray:
    """Gaussian blur; wide ones on a reduced picture, which nobody can tell apart."""
    if sigma <= 6:
        return cv2.GaussianBlur(image, window, sigma)
    factor = 2 ** int(np.floor(np.log2(sigma / 3)))
    height, width = image.shape[:2]
    small_size = (max(1, width // factor), max(1, height // factor))
    small = cv2.resize(image, small_size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, window, sigma / factor)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
