"""How unlikely it is that the background behind a hole looks like this or that source.

What is behind an object is mostly more of what is around it, and not a face somewhere else. With
DINOv2's tokens what a source is, is compared with what is around the hole; without them its colour.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import F32, RGB, Mask

REACH = 0.35  # x the root of the hole's area: what is so near is around it
LEAST_REACH = 8.0  # px
MOST_COST = 2000.0  # squared levels of 255 that an unlikely source costs
BINS = 12  # of each channel of CIE Lab
RARE = 0.002  # share of what is around the hole that a colour must have, or it is none of it
SMOOTHING = 2.0  # px, over which a source's colour is taken
TOKEN_GRID = 24  # patches along the longer side of what DINOv2 sees
PATCH = 14  # px of one
ALIKE, UNLIKE = 0.65, 0.35  # cosine of a source's token and the nearest around the hole


def unlikely(rgb: F32, hole: Mask) -> F32:
    """(h, w) squared levels of 255 that it should cost to fill the hole from each pixel.

    `rgb` (h, w, 3) has levels up to 255, in the hole some smooth guess.
    """
    reach = max(LEAST_REACH, REACH * float(np.sqrt(hole.sum())))
    away = cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5)
    around = (away > 0) & (away <= reach)
    if not around.any():
        return np.zeros(hole.shape, np.float32)
    picture = np.clip(rgb, 0, 255).astype(np.uint8)
    strange = _strange_tokens(picture, around)
    if strange is None:
        strange = _strange_colors(picture, around)
    return np.asarray(MOST_COST * np.where(around, 0, strange), np.float32)


def _strange_colors(picture: RGB, around: Mask) -> F32:
    """(h, w) in [0, 1], 1 where a colour does not occur `around` the hole (h, w)."""
    smooth = cv2.GaussianBlur(picture, (0, 0), SMOOTHING)
    lab = cv2.cvtColor(smooth, cv2.COLOR_RGB2LAB).astype(int) * BINS // 256
    number = (lab[..., 0] * BINS + lab[..., 1]) * BINS + lab[..., 2]
    shares = np.bincount(number[around], minlength=BINS**3).reshape(BINS, BINS, BINS)
    shares = shares / around.sum()
    near = cv2.dilate(shares.reshape(BINS, BINS * BINS), np.ones((3, 1)))
    near = near.reshape(BINS * BINS, BINS)  # a bin's neighbours in lightness and in b
    near = cv2.dilate(near, np.ones((1, 3))).ravel()
    return np.exp(-near / RARE).astype(np.float32)[number]


def _strange_tokens(picture: RGB, around: Mask) -> F32 | None:
    """(h, w) in [0, 1], 1 where DINOv2 sees something that is not `around` the hole (h, w).

    None without its weights.
    """
    from ..models import ModelError
    from ..segment import dino_tokens

    try:
        network = dino_tokens.shared()
    except (ModelError, ImportError):
        return None
    height, width = around.shape
    patch = max(height, width) / TOKEN_GRID
    size = max(round(width / patch), 1), max(round(height / patch), 1)
    seen = cv2.resize(picture, (size[0] * PATCH, size[1] * PATCH), interpolation=cv2.INTER_AREA)
    tokens = network.tokens(np.asarray(seen, np.uint8))
    tokens /= np.linalg.norm(tokens, axis=-1, keepdims=True)
    share = cv2.resize(around.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    near = tokens[share >= min(0.5, float(share.max()))]
    alike = (tokens @ near.T).max(-1)
    strange = np.clip((ALIKE - alike) / (ALIKE - UNLIKE), 0, 1).astype(np.float32)
    return np.asarray(cv2.resize(strange, (width, height), interpolation=cv2.INTER_LINEAR))
