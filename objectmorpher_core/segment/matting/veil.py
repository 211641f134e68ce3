"""What an artist drew half covered: a soft edge, or something that is seen through.

An edge runs through all values from nothing to all; glass, smoke and gauze stay between them. Of
an edge the photo is no mixture: inside the line it is the object. A veil is one: behind it the
photo's background goes on, and what is sharp is taken to belong to that; the veil's own colour
changes slowly, as far as the photo allows it to.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...base.arrays import F32, U8, Mask, Pixels
from ..mask_edit import FULL, is_soft
from .unmix import coarse_colours

RUNS_THROUGH = 0.05  # of an edge is at least this much in the lowest quarter, and in the highest
COARSE = 96  # px, at most: size at which a veil's colour is found
WIDE = 0.25  # x the crop's size: over so much of the veil its colour is averaged
PIECE = 30_000  # px that OpenCV samples at a time
FAINT = 0.05  # coverage below which the veil's colour cannot be told


def veil(coverage: U8) -> Mask:
    """(H, W) where a coverage is that of something that is seen through."""
    soft = is_soft(coverage)
    count, found = cv2.connectedComponents(soft.view(np.uint8), connectivity=8)
    pieces = np.asarray(found)[soft]
    size = np.bincount(pieces, minlength=count).astype(np.float64)
    low, high = (
        np.bincount(pieces, weights=part, minlength=count)
        for part in (coverage[soft] < FULL / 4, coverage[soft] > FULL * 3 / 4)
    )
    is_veil = np.minimum(low, high) < RUNS_THROUGH * size
    is_veil[0] = False
    return is_veil[np.asarray(found, np.int32)]


def veil_colour(pixels: Pixels, coverage: U8, where: Mask) -> F32:
    """A veil's own colour, at a small size of the photo's crop (h, w, 3), see `colour_at`."""
    height, width = where.shape
    scale = min(COARSE / max(height, width), 1.0)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))

    def small(image: np.ndarray) -> F32:
        return cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)

    rgb = small(pixels) / np.float32(np.iinfo(pixels.dtype).max)
    share = small((coverage * where).astype(np.float32)) / FULL
    hidden = (small((coverage > 0).astype(np.float32)) > 0.01).astype(np.float32)
    _, behind = coarse_colours(rgb, hidden)
    own = (rgb - (1 - share[..., None]) * behind) / np.maximum(share, FAINT)[..., None]
    weight = np.where(share > FAINT, share, 0).astype(np.float32)
    blur = (0, 0), WIDE * max(size)
    total = cv2.GaussianBlur(weight, *blur)
    mean = cv2.GaussianBlur(np.clip(own, 0, 1).astype(np.float32) * weight[..., None], *blur)
    return np.asarray(mean / np.maximum(total, 1e-6)[..., None], np.float32)


def colour_at(small: F32, shape: tuple[int, ...], rows: np.ndarray, columns: np.ndarray) -> F32:
    """(N, 3) `small` at pixels of a picture of `shape` (h, w), smoothly."""
    y = (rows + 0.5) * (small.shape[0] / shape[0]) - 0.5
    x = (columns + 0.5) * (small.shape[1] / shape[1]) - 0.5
    found = np.empty((len(rows), 3), np.float32)
    for k in range(0, len(rows), PIECE):
        part = slice(k, k + PIECE)
        left, top = (axis[part, None].astype(np.float32) for axis in (x, y))
        mode, border = cv2.INTER_LINEAR, cv2.BORDER_REPLICATE
        sampled = cv2.remap(small, left, top, mode, borderMode=border)
        found[part] = np.asarray(sampled)[:, 0]
    return found


def unveiled(rgb: F32, alpha: F32, own: F32) -> tuple[F32, F32]:
    """F and B (N, 3) that mix to `rgb` (N, 3): F is `own` as far as a B in [0, 1] allows it."""
    a = alpha[:, None].astype(np.float64)
    behind = np.clip((rgb - a * own) / (1 - a), 0, 1)
    fore = np.clip((rgb - (1 - a) * behind) / a, 0, 1)
    return fore.astype(np.float32), behind.astype(np.float32)
