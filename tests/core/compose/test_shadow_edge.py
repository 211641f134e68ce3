"""The line where a shadow ended is not left."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.compose.shadow.old_shadow import evened, tinted

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
