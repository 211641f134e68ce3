import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from objectmorpher_core.base.masks import box_of, dilated, disc, largest_piece, opened


def test_a_box_is_around_what_there_is_and_stays_inside() -> None:
    mask = np.zeros((20, 30), bool)
    mask[3:7, 25:28] = True
    assert box_of(mask) == (25, 3, 28, 7)
    assert box_of(mask, 1) == (24, 2, 29, 8)
    assert box_of(mask, 5) == (20, 0, 30, 12)
    assert box_of(mask.astype(np.float32)) == box_of(mask)


def test_nothing_has_an_empty_box_and_an_empty_piece() -> None:
    nothing = np.zeros((4, 5), bool)
    assert box_of(nothing) == box_of(nothing, 3) == (0, 0, 0, 0)
    assert not largest_piece(nothing).any()


def test_the_largest_piece_is_kept_and_its_corners_connect() -> None:
    mask = np.zeros((12, 12), bool)
    mask[0:3, 0:3] = mask[3:5, 3:5] = True
    whole = mask.copy()
    mask[8:11, 8:11] = True
    assert (largest_piece(mask) == whole).all()
    assert (largest_piece(whole) == whole).all()


def test_a_mask_is_dilated_by_a_disc() -> None:
    mask = np.zeros((11, 11), bool)
    mask[5, 5] = True
    around = dilated(mask, 3)
    assert (around[2:9, 2:9] == (disc(3) > 0)).all() and around.sum() == disc(3).sum()
    assert disc(3)[0].sum() == 1 and disc(3)[3].all()


@given(st.integers(0, 10**6), st.floats(0.2, 0.9))
def test_an_opened_mask_is_its_squares_of_two_pixels(seed: int, share: float) -> None:
    mask = np.random.default_rng(seed).random((9, 12)) < share
    square = mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:] & mask[1:, 1:]
    expected = np.zeros_like(mask)
    for rows, columns in ((0, 0), (0, 1), (1, 0), (1, 1)):
        expected[rows : rows + 8, columns : columns + 11] |= square
    assert (opened(mask) == expected).all()
