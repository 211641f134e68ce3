"""A photo's transparency, on pictures of a few pixels: what follows from its definition."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher_core.base.arrays import crop
from objectmorpher_core.document.model import Matte, Plate
from objectmorpher_core.document.transparency import (
    CLEAR,
    DARK,
    LEAST_EDGE,
    LIGHT,
    SOFT,
    alpha_behind,
    on_checker,
    with_opacity,
    within,
)
from objectmorpher_core.pictures.image import Picture

F32 = 1e-6
HEIGHT, WIDTH = 48, 60  # px, so small that the edge beside clear ground has its least width
SEEDS = st.integers(0, 2**32 - 1)


def _picture(alpha: np.ndarray, seed: int = 0) -> Picture:
    pixels = np.random.default_rng(seed).integers(0, 256, (*alpha.shape, 3)).astype(np.uint8)
    return Picture(pixels, alpha)


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_the_edge_beside_clear_ground_has_the_photos_own_opacity_and_colours(seed):
    """Ground that is clear left of a column: a matte far from the corner, less opaque than it."""
    rng = np.random.default_rng(seed)
    edge, top, left = rng.integers(20, 30), rng.integers(8, 14), rng.integers(12, 18)
    opacity = np.full((HEIGHT, WIDTH), 255, np.uint8)
    opacity[:, :edge] = 0
    opacity[:, edge] = rng.integers(1, 255)
    glass = np.s_[HEIGHT // 2 : HEIGHT // 2 + 3, edge + 12 :]
    opacity[glass] = rng.integers(30, 200)
    faint = np.s_[HEIGHT // 2 + 5 : HEIGHT // 2 + 8, edge + 12 :]
    opacity[faint] = int(CLEAR * 255)  # just too little for its colour to be relied on
    shape = 30, 40
    found = Matte(
        int(left), int(top), rng.uniform(0.1, 0.9, shape).astype(np.float32),
        rng.random((*shape, 3)).astype(np.float32),
    )  # fmt: skip
    picture = _picture(opacity, seed)
    made = with_opacity(found, picture, None)
    there = crop(opacity, (0, 0, WIDTH, HEIGHT), found.box) / 255
    colours = crop(picture.pixels, (0, 0, WIDTH, HEIGHT), found.box) / 255
    away = np.arange(left, left + shape[1])[None] - edge + 1  # px from the last clear column
    is_edge = np.broadcast_to(away <= LEAST_EDGE, shape)
    is_all = is_edge | (there - np.minimum(there, found.alpha) < 1.5 / 255)
    np.testing.assert_allclose(
        made.alpha, np.where(is_all, there, np.minimum(there, found.alpha)), atol=F32
    )
    is_own = (is_edge | (there < 1)) & (there > CLEAR)
    assert is_own.any() and not is_own.all()
    np.testing.assert_allclose(
        made.foreground, np.where(is_own[..., None], colours, found.foreground), atol=F32
    )


def test_a_selection_keeps_its_kind_but_where_it_gets_a_soft_edge():
    """A hard one stays hard beside a hard edge, a soft one soft; beside a soft edge all are."""
    columns = np.arange(WIDTH)
    hard = np.where(columns < 30, 0, 255).astype(np.uint8)
    soft = np.clip((columns - 26) * 40, 0, 255).astype(np.uint8)
    for line, is_fading in ((hard, False), (soft, True)):
        picture = _picture(np.tile(line, (HEIGHT, 1)))
        chosen = np.zeros((HEIGHT, WIDTH), bool)
        chosen[10:40, 20:50] = True
        kept = within(chosen, picture)
        assert kept is not None and kept.dtype == (np.uint8 if is_fading else np.bool_)
        full = within(chosen * np.uint8(255), picture)
        assert full is not None and full.dtype == np.uint8
        levels = kept if is_fading else kept * np.uint8(255)
        np.testing.assert_array_equal(full, levels)
        assert is_fading == bool(((full > 0) & (full < 255)).any())
        assert not kept[:, line == 0].any()


def test_a_selection_of_which_half_is_faint_counts_where_it_is_more_than_half():
    """What was selected with little coverage is no more than the photo's own rim."""
    opacity = np.full((HEIGHT, WIDTH), 255, np.uint8)
    opacity[:, :30] = 0
    chosen = np.zeros((HEIGHT, WIDTH), np.uint8)
    chosen[:, 20:45], chosen[:, 45:] = 255, 40
    kept = within(chosen, _picture(opacity))
    assert kept is not None
    np.testing.assert_array_equal(kept[0], np.where(np.arange(WIDTH) < 30, 0, chosen[0]))


def test_an_edge_may_be_soft_as_far_as_it_is_said():
    """Alpha that falls off towards clear ground is the edge's there, and glass beyond."""
    reach = round(SOFT * LEAST_EDGE)
    opacity = np.full((HEIGHT, WIDTH), 255, np.uint8)
    opacity[:, :10] = 0
    opacity[:, 10 : 10 + reach] = np.linspace(20, 240, reach).astype(np.uint8)
    kept = within(np.ones((HEIGHT, WIDTH), bool), _picture(opacity))
    assert kept is not None and kept.dtype == np.uint8
    np.testing.assert_array_equal(kept[24, 10:26], opacity[24, 10:26])


@settings(max_examples=50, deadline=None)
@given(SEEDS)
def test_what_lies_around_a_hole_goes_on_in_it(seed):
    """Every pixel that an object covered is as opaque as the nearest one outside of the hole."""
    rng = np.random.default_rng(seed)
    alpha = rng.integers(0, 65536, (14, 17)).astype(np.uint16)
    hole = rng.random((6, 7)) < 0.7
    left, top = int(rng.integers(0, 11)), int(rng.integers(0, 9))
    plate = Plate(left, top, np.zeros((6, 7, 3), np.uint8), hole, "made")
    cover = (rng.random((4, 5)) < 0.6).astype(np.float32)
    gone = Matte(left + 1, top + 2, cover, np.zeros((4, 5, 3), np.float32))
    result = alpha_behind(alpha, plate, (gone,))
    whole = np.zeros(alpha.shape, bool)
    whole[top : top + 6, left : left + 7] = hole
    covered = np.zeros(alpha.shape, bool)
    covered[top + 2 : top + 6, left + 1 : left + 6] = cover > 0
    known = np.argwhere(~whole)
    np.testing.assert_array_equal(result[~whole], alpha[~whole])
    for y, x in np.argwhere(whole):
        squares = ((known - (y, x)) ** 2).sum(1)
        near = alpha[tuple(known[squares == squares.min()].T)]
        own = near if covered[y, x] else np.minimum(near, alpha[y, x])
        assert result[y, x] in own


@settings(max_examples=25, deadline=None)
@given(SEEDS, st.sampled_from([np.uint8, np.uint16]))
def test_a_small_photos_checker_has_squares_of_a_pixel(seed, kind):
    rng = np.random.default_rng(seed)
    most, left, top = np.iinfo(kind).max, int(rng.integers(0, 9)), int(rng.integers(0, 9))
    pixels = rng.integers(0, most + 1, (5, 6, 3)).astype(kind)
    alpha = rng.integers(0, most + 1, (5, 6)).astype(kind)
    shown = on_checker(pixels, alpha, (20, 16), left, top)
    for y in range(5):
        for x in range(6):
            ground = LIGHT if (x + left + y + top) % 2 == 0 else DARK
            share = alpha[y, x] / most
            exact = share * pixels[y, x] + (1 - share) * ground * most
            np.testing.assert_allclose(shown[y, x], exact, atol=0.5 + most * F32)
