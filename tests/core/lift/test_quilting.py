"""Texture quilted into a hole, and the fringe of a cut-out from which nothing is taken."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage import data

from objectmorpher_core.base.arrays import F32, Mask
from objectmorpher_core.lift.relief.quilting import PATCH, _misfit, quilted
from objectmorpher_core.lift.relief.silhouette import inwardness

SIDE = 240  # px
COARSE = 9.0  # px


def _texture(name: str) -> F32:
    """(h, w, 3) levels of a photographed texture."""
    grey = getattr(data, name)()[:SIDE, :SIDE].astype(np.float32)
    return np.ascontiguousarray(np.dstack([grey, 0.9 * grey, 0.8 * grey]))


def _hole() -> Mask:
    hole = np.zeros((SIDE, SIDE), bool)
    hole[60:180, 130:220] = True
    return hole


def _even(levels: F32, hole: Mask) -> F32:
    """`levels` (h, w, 3) whose hole (h, w) is coarse."""
    return np.where(hole[..., None], cv2.GaussianBlur(levels, (0, 0), COARSE), levels)


def _filled(levels: F32, hole: Mask, seed: int = 0) -> F32:
    return quilted(levels, ~hole, ~hole, hole, np.full(hole.shape, 0.5, np.float32), seed)


def _contrast(levels: F32, where: Mask) -> float:
    grey = cv2.GaussianBlur(levels.mean(-1), (0, 0), 1.0)
    return float((grey - cv2.GaussianBlur(grey, (0, 0), COARSE))[where].std())


@pytest.mark.parametrize("name", ["grass", "gravel"])
def test_a_plain_hole_gets_the_texture_beside_it(name):
    """As rough, as bright, and nothing but the hole changes; the same seed, the same texture."""
    whole, hole = _texture(name), _hole()
    inner = cv2.erode(hole.astype(np.uint8), np.ones((21, 21), np.uint8)) > 0
    levels = _even(whole, hole)
    found = _filled(levels, hole)
    assert _contrast(levels, inner) < 0.2 * _contrast(whole, inner), "it was plain"
    assert 0.7 < _contrast(found, inner) / _contrast(whole, inner) < 1.3
    assert abs(found[hole].mean() - levels[hole].mean()) < 6
    assert (found[~hole] == levels[~hole]).all()
    assert (found == _filled(levels, hole)).all()
    assert (found != _filled(levels, hole, 1)).any()
    assert found.min() >= whole.min() and found.max() <= whole.max()


@pytest.mark.parametrize("name", ["grass", "gravel"])
def test_a_hole_is_textured_up_to_its_border(name):
    """There is no plain strip along it: as rough there as amid it."""
    whole, hole = _texture(name), _hole()
    inner, core = (cv2.erode(hole.astype(np.uint8), np.ones((n, n), np.uint8)) > 0 for n in (3, 9))
    found = _filled(_even(whole, hole), hole)
    assert _contrast(found, inner & ~core) > 0.8 * _contrast(found, core)


def test_what_is_rougher_than_the_rest_stays():
    whole, hole = _texture("grass"), _hole()
    rough = np.where(hole[..., None], whole, 0.1 * whole + 80)
    inner = cv2.erode(hole.astype(np.uint8), np.ones((31, 31), np.uint8)) > 0
    assert np.abs(_filled(rough, hole) - rough)[inner].mean() < 1


def test_stripes_of_a_striped_thing_are_not_plain():
    y = np.mgrid[:SIDE, :SIDE][0]
    grey = np.where((y // 12) % 2, 200.0, 60.0).astype(np.float32)
    whole = np.dstack([grey] * 3)
    assert (_filled(whole, _hole()) == whole).all()


def test_a_texture_is_lit_as_its_place_is():
    """To the right the hole becomes darker, and its texture with it, weaker."""
    whole, hole = _texture("grass"), _hole()
    shade = np.linspace(1.6, 0.4, SIDE, dtype=np.float32)[None, :, None]
    levels = np.where(hole[..., None], _even(whole, hole) * shade, whole)
    found = _filled(levels, hole)
    left, right = hole.copy(), hole.copy()
    left[:, 165:], right[:, :185] = False, False
    left[:, :140], right[:, 205:] = False, False
    for part in (left, right):
        assert abs(found[part].mean() / levels[part].mean() - 1) < 0.1
    assert _contrast(found, right) < 0.85 * _contrast(found, left)


def test_nothing_is_quilted_where_nothing_can_be_copied():
    levels, hole = _texture("grass"), np.ones((SIDE, SIDE), bool)
    nothing = ~hole
    heights = np.zeros(hole.shape, np.float32)
    assert (quilted(levels, nothing, nothing, hole, heights, 0) == levels).all()
    assert (quilted(levels, hole, hole, nothing, heights, 0) == levels).all()


def _disc(softness: float, radius: float = 80.0) -> F32:
    """(h, w) a matte whose edge is `softness` px wide."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5 - SIDE / 2
    inward = (radius - np.hypot(x, y)) / max(softness, 1e-3) + 0.5
    return np.clip(inward, 0, 1).astype(np.float32)


def _inward(alpha: F32) -> F32:
    """Of an object of one colour."""
    return inwardness(alpha, np.full((*alpha.shape, 3), 0.5, np.float32))


def test_a_fringe_that_is_lit_from_behind_is_deeper_than_a_dark_one():
    alpha = _disc(3.0)
    away = cv2.distanceTransform((alpha > 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    rim = np.clip(1 - away / 14, 0, 1)[..., None] * np.ones(3, np.float32)
    own, lit, dark = (
        (inwardness(alpha, (0.5 + change * rim).astype(np.float32)) < 1)[alpha > 0.5].sum()
        for change in (0.0, 0.4, -0.4)
    )
    assert lit > 1.5 * own
    assert dark == own


def test_the_fringe_is_as_wide_as_the_edge_is_soft():
    """A crisp edge has none; a wider one a wider one; amid a limb nothing is fringe."""
    wide = []
    for softness in (0.0, 1.0, 2.0, 3.0):
        alpha = _disc(softness)
        inward = _inward(alpha)
        assert inward.shape == alpha.shape and inward.min() >= 0 and inward.max() <= 1
        wide.append(int(((inward < 1) & (alpha > 0.5)).sum()) / (2 * np.pi * 80))
        assert (inward[alpha == 0] < 1).all()
        assert inward[SIDE // 2, SIDE // 2] == 1
    assert wide[0] < 2 and wide[1] < 3
    assert wide[1] < wide[2] < wide[3]
    assert wide[3] < 0.5 * 80, "of the radius"


def test_the_size_of_a_photo_does_not_change_its_fringe():
    small = _inward(_disc(6.0))
    large = _inward(cv2.resize(_disc(6.0), None, fx=3, fy=3, interpolation=cv2.INTER_LINEAR))
    again = cv2.resize(large, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    assert np.abs(again - small).mean() < 0.02


def test_nothing_has_no_fringe():
    assert (_inward(np.zeros((30, 40), np.float32)) == 1).all()


@given(st.integers(0, 10**6), st.floats(0, 3), st.floats(1, 1.1))
@settings(deadline=None)  # its kernel is compiled first
def test_a_patch_that_is_farther_off_than_the_best_is_never_taken_for_as_near(seed, share, luck):
    """Its comparison ends early, whatever it costs besides and is worth by chance."""
    rng = np.random.default_rng(seed)
    detail = rng.normal(0, 20, (2 * PATCH, 2 * PATCH, 3)).astype(np.float32)
    have = rng.random(detail.shape[:2]) < 0.5
    places = 0, 0, *rng.integers(0, PATCH, 2), PATCH, PATCH
    whole = _misfit(detail, have, *places, np.inf)
    cost = float(rng.random() * 100)
    best = (cost + share * whole) * luck
    found = cost + _misfit(detail, have, *places, best / luck - cost)
    assert found in (cost + whole, np.inf)
    assert found * luck >= best or (cost + whole) * luck < best
