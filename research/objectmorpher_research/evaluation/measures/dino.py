"""Measures on DINOv2's patch tokens (Oquab et al., arXiv 2304.07193), under names of their own.

None of them is LPIPS, KID or SIFID, whose figures hold for their own networks only.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from objectmorpher_core import models
from objectmorpher_core.base.arrays import F64, RGB
from objectmorpher_core.segment.dino_tokens import PATCH, WEIGHT, shared

from .regions import Region, check_pair, weighted_mean

PATCHES = 1024  # of a picture, about 450 x 450 px; the network was trained on 37 x 37
TINY = 1e-12


def missing() -> str | None:
    """Why the network cannot be used here, or None."""
    if models.path(WEIGHT) is None:
        return f"the model {WEIGHT} is not here: `objectmorpher models get {WEIGHT}`"
    return None


class Dino:
    """The measures; the network's output for the last two pictures is kept between them."""

    def __init__(self) -> None:
        self._seen: list[tuple[RGB, F64]] = []

    def perceptual(self, a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
        """Return a distance in [0, 2]: 1 - the cosine of the tokens at a place, averaged."""
        check_pair(a, b)
        x, y = (_unit(self.tokens(rgb)) for rgb in (a, b))
        apart = np.maximum(0, 1 - (x * y).sum(-1))
        return tuple(weighted_mean(apart, region) for region in regions)

    def identity(self, a: RGB, b: RGB, regions: Sequence[Region]) -> tuple[float, ...]:
        """Return the cosine, in [-1, 1], of the regions' mean tokens, wherever the thing is.

        Of tokens of unit length; the class token is not used: it has drifted in these weights.
        """
        check_pair(a, b)
        x, y = (_unit(self.tokens(rgb)) for rgb in (a, b))
        return tuple(float(_unit(_mean(x, r)) @ _unit(_mean(y, r))) for r in regions)

    def picture(self, rgb: RGB) -> F64:
        """(384,) mean token, for the distance of two sets."""
        return self.tokens(rgb).mean((0, 1))

    def tokens(self, rgb: RGB) -> F64:
        """(h, w, 384) of a picture (H, W, 3), resized to whole patches."""
        for known, tokens in self._seen:
            if known is rgb:
                return tokens
        height, width = rgb.shape[:2]
        scale = min(1.0, (PATCHES * PATCH**2 / (height * width)) ** 0.5)
        h, w = (max(1, round(n * scale / PATCH)) for n in (height, width))
        how = cv2.INTER_AREA if h * PATCH < height else cv2.INTER_CUBIC
        small = cv2.resize(rgb, (w * PATCH, h * PATCH), interpolation=how)
        found = shared().tokens(np.asarray(small, np.uint8)).astype(np.float64)
        self._seen = [*self._seen[-1:], (rgb, found)]
        return found


def _mean(tokens: F64, region: Region) -> F64:
    return np.array([weighted_mean(channel, region) for channel in np.moveaxis(tokens, -1, 0)])


def _unit(vectors: F64) -> F64:
    return vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + TINY)
