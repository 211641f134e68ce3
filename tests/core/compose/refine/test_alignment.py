"""A refined picture is put where its input lies, or refused; its drift in colour is taken out."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.compose.refine import RefineError
from objectmorpher_core.compose.refine.refinement import MOST_LEFT, align, check, measure
from tests.tree import quick

PHOTOS = {"cat": data.chelsea, "coffee": data.coffee, "rocket": data.rocket}


def photo(name: str) -> np.ndarray:
    return PHOTOS[name]()[20:300, 60:420, :3].copy()


def moved(pixels: np.ndarray, x: float, y: float, scale: float = 1.0) -> np.ndarray:
    """As a network that shifts and scales gives it back: what was at p is at c + s (p - c) + x."""
    height, width = pixels.shape[:2]
    cx, cy = (width - 1) / 2, (height - 1) / 2
    matrix = np.array([[scale, 0, cx - scale * cx + x], [0, scale, cy - scale * cy + y]])
    return cv2.warpAffine(
        pixels, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


def recoloured(pixels: np.ndarray) -> np.ndarray:
    """Warmer, brighter, with less contrast and other noise."""
    noise = np.random.default_rng(0).normal(0, 3, pixels.shape)
    made = pixels * np.array([0.95, 0.85, 0.7]) + np.array([30, 15, 10]) + noise
    return np.clip(made, 0, 255).astype(np.uint8)


def unit(pixels: np.ndarray) -> np.ndarray:
    return pixels.astype(np.float32) / 255


@pytest.mark.parametrize("name", quick(PHOTOS, 1))
@pytest.mark.parametrize(("x", "y", "scale"), [
    (0.0, 0.0, 1.0), (0.2, -0.1, 1.0), (2.0, 1.3, 1.0), (-10.0, 7.0, 1.0), (0.0, 0.0, 1.03),
    (3.0, -4.0, 0.97),
])  # fmt: skip
def test_shift_and_scale_are_found_under_other_colours_and_corrected(name, x, y, scale):
    coarse = photo(name)
    made = recoloured(moved(coarse, x, y, scale))
    found = measure(unit(made), unit(coarse))
    assert np.hypot(found.shift[0] - x, found.shift[1] - y) < 0.15
    assert abs(found.scale - scale) < 0.001  # 0.2 px at the border
    assert found.left <= MOST_LEFT
    lying, _ = align(unit(made), unit(coarse))
    assert measure(lying, unit(coarse)).left <= MOST_LEFT


def test_a_picture_that_is_bent_or_another_is_refused():
    coarse = photo("coffee")
    height, width = coarse.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    bent = cv2.remap(coarse, x + 5 * np.sin(y / 40), y, cv2.INTER_CUBIC)
    with pytest.raises(RefineError, match="px off"):
        check(bent, coarse, np.zeros((height, width), np.float32))
    with pytest.raises(RefineError, match=r"no longer shows the same|px off"):
        check(photo("cat"), coarse, np.zeros((height, width), np.float32))


def test_drift_is_what_changed_where_nothing_was_to_change():
    coarse = photo("cat")
    alpha = np.zeros(coarse.shape[:2], np.float32)
    alpha[100:200, 120:260] = 1
    lit = unit(coarse)
    lit[alpha > 0] *= 0.8  # what was wanted
    made = np.clip(lit * np.array([0.9, 1.0, 0.95]) + 0.04, 0, 1)
    checked = check(np.rint(made * 255).astype(np.uint8), coarse, alpha)
    assert checked.drift.size > 0.01
    still = alpha == 0
    assert np.abs(checked.pixels - unit(coarse))[still].mean() < 1.5 / 255
    inner = np.s_[110:190, 130:250]  # and the change inside stays
    assert np.abs(checked.pixels[inner] - 0.8 * unit(coarse)[inner]).mean() < 2 / 255
