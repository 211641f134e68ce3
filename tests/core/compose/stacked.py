"""Layers over one another as any paint program mixes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from objectmorpher_core.compose.layers import Layer


def stacked(pile: Sequence[Layer]) -> np.ndarray:
    """(H, W, 3) of 255, the shown layers blended as any program does."""
    photo = pile[0].pixels
    top = float(np.iinfo(photo.dtype).max)
    picture = photo.astype(np.float64)
    for layer in pile[1:]:
        if layer.is_shown:
            x0, y0, x1, y1 = layer.box
            alpha = layer.pixels[..., 3:] / top
            part = picture[y0:y1, x0:x1]
            above = top * mixed_by(layer.mode, part / top, layer.pixels[..., :3] / top)
            part += alpha * (above - part)
    return picture * 255 / top


def mixed_by(mode: str, below: np.ndarray, own: np.ndarray) -> np.ndarray:
    """B(below, own) of the W3C's Compositing and Blending, straight colours in [0, 1]."""
    if mode == "multiply":
        return below * own
    if mode == "screen":
        return 1 - (1 - below) * (1 - own)
    if mode == "soft light":
        bright = np.where(
            below <= 0.25, 16 * below**3 - 12 * below**2 + 4 * below, np.sqrt(below)
        )  # fmt: skip
        darker = below - (1 - 2 * own) * below * (1 - below)
        return np.where(own <= 0.5, darker, below + (2 * own - 1) * (bright - below))
    return own
