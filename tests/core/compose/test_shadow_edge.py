"""The line where a shadow ended, and a grain's mirror image: neither is left."""

from __future__ import annotations

import numpy as np
import pytest
from skimage import data

from objectmorpher_core.compose.shadow_edge import evened, tinted
from objectmorpher_core.compose.source_prior import MIRROR_COST, slanting

SIDE = 240
PITCH = 4.0  # px per cell
GROUND = 0.6
GAMMA = 2.2


def _missing(wide: float) -> np.ndarray:
    """(h, w) natural logarithm of the light that a round shadow with so wide an edge takes."""
    y, x = np.mgrid[:SIDE, :SIDE]
    away = np.hypot(x - SIDE / 2, y - SIDE / 2) - 50
    return (1 / (1 + np.exp(away / wide))).astype(np.float32)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_hard_edge_that_was_found_blurred_leaves_no_line(noise):
    grain = np.random.default_rng(1).normal(0, noise, (SIDE, SIDE)).astype(np.float32)
    photo = (GROUND + grain) * np.exp(-_missing(0.5) / GAMMA)
    found = _missing(4.0)
    lit = np.repeat((photo * np.exp(found / GAMMA))[..., None], 3, 2).astype(np.float32)
    result = evened(lit, found, np.ones((SIDE, SIDE), bool), PITCH)
    edge = np.abs(_missing(4.0) - 0.5) < 0.4
    before, after = (np.abs(p[..., 0] - GROUND - grain)[edge].mean() for p in (lit, result))
    assert before > 0.04
    assert after < 0.35 * before


def test_without_a_shadow_nothing_changes():
    lit = np.full((SIDE, SIDE, 3), GROUND, np.float32)
    nothing = np.zeros((SIDE, SIDE), np.float32)
    assert np.array_equal(evened(lit, nothing, np.ones((SIDE, SIDE), bool), PITCH), lit)


def test_the_light_that_is_left_has_its_colour():
    """Twice as much is missing of red as of blue: that is told, and the mean is one."""
    share = np.array([1.25, 1.0, 0.75], np.float32)
    missing = _missing(1.0)
    colours = -1 - missing[..., None] * share
    found = tinted(colours.astype(np.float32), missing, np.ones((SIDE, SIDE), bool), PITCH)
    assert found == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(("across", "down", "is_barred"), [(1, 1, True), (1, 0, False)])
def test_a_slanting_grain_is_not_mirrored(across, down, is_barred):
    y, x = np.mgrid[:SIDE, :SIDE]
    wood = 128 + 40 * np.sin((across * x + down * y) * 0.8)
    cost = slanting(np.repeat(wood[..., None], 3, 2).astype(np.float32))[20:-20, 20:-20]
    assert np.all(cost == (MIRROR_COST if is_barred else 0))


def test_gravel_may_be_mirrored():
    gravel = np.repeat(data.gravel()[..., None].astype(np.float32), 3, 2)
    assert slanting(gravel).mean() < 0.3 * MIRROR_COST
