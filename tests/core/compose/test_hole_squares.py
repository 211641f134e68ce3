"""Networks see squares round holes; the rest of the photo is nobody's business."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.plate.hole_squares import Filler, fill_squares, squares

SIDE = 64  # px that the network sees


def with_holes(size: tuple[int, int], *boxes: tuple[int, int, int, int]) -> np.ndarray:
    hole = np.zeros(size, bool)
    for x0, y0, x1, y1 in boxes:
        hole[y0:y1, x0:x1] = True
    return hole


def test_far_holes_are_looked_at_one_by_one_near_ones_together():
    hole = with_holes((400, 600), (20, 20, 40, 40), (50, 30, 60, 60), (500, 300, 540, 330))
    found = squares(hole, SIDE)
    assert len(found) == 2
    shown = np.zeros_like(hole)
    for square in found:
        x0, y0, x1, y1 = square.box
        assert (x1 - x0, y1 - y0) >= (SIDE, SIDE)
        assert square.own.shape == (y1 - y0, x1 - x0)
        assert not (shown[y0:y1, x0:x1] & square.own).any()
        shown[y0:y1, x0:x1] |= square.own
    np.testing.assert_array_equal(shown, hole)


def test_a_small_hole_is_seen_in_the_photos_own_pixels(china):
    """What the network is shown of a small hole's surroundings are the photo's very levels."""
    hole = with_holes(china.shape[:2], (300, 200, 320, 220))
    seen = []

    def look(picture, inside, progress, seed):
        seen.append((picture, inside))
        return picture

    fill_squares(china, hole, Filler(SIDE, look), silent)
    ((picture, inside),) = seen
    (square,) = squares(hole, SIDE)
    x0, y0, x1, y1 = square.box
    assert inside.sum() == hole.sum()
    np.testing.assert_allclose(
        picture[~inside] * 255, china[y0:y1, x0:x1][~inside], atol=1e-3
    )  # fmt: skip


@pytest.mark.parametrize("shape", [(40, 300), (300, 40), (7, 9)])
def test_strips_and_small_photos_are_mirrored_to_a_square(shape):
    photo = np.random.default_rng(0).integers(0, 256, (*shape, 3)).astype(np.uint8)
    hole = with_holes(shape, (2, 2, 5, 5))
    filled = fill_squares(photo, hole, Filler(SIDE, lambda p, *_: np.ones_like(p)), silent)
    np.testing.assert_array_equal(filled[~hole], photo[~hole])
    assert (filled[hole] == 255).all()


def test_a_large_holes_answer_gets_the_photos_own_detail(china):
    """The truth, seen by a network at a third of its size, comes back about as rough as it was."""
    noise = np.random.default_rng(1).normal(0, 12, china.shape)
    photo = np.clip(china + noise, 0, 255).astype(np.uint8)
    hole = with_holes(photo.shape[:2], (380, 250, 500, 370))

    def oracle(picture, inside, progress, seed):
        (square,) = squares(hole, 80)
        x0, y0, x1, y1 = square.box
        small = cv2.resize(photo[y0:y1, x0:x1], (80, 80), interpolation=cv2.INTER_AREA)
        return small.astype(np.float32) / 255

    def rough(pixels):
        return float(cv2.Laplacian(pixels.astype(np.float32), cv2.CV_32F)[hole].std())

    filled = fill_squares(photo, hole, Filler(80, oracle), silent)
    assert 0.7 < rough(filled) / rough(photo) < 1.3
    low = [cv2.GaussianBlur(p.astype(np.float32), (0, 0), 6)[hole] for p in (filled, photo)]
    assert np.abs(low[0] - low[1]).mean() < 8


def test_seed_and_16_bit(china):
    photo = china.astype(np.uint16) * 257
    hole = with_holes(photo.shape[:2], (300, 200, 320, 220))
    told = []

    def look(picture, inside, progress, seed):
        told.append(seed)
        return np.full_like(picture, 0.12345)

    filled = fill_squares(photo, hole, Filler(SIDE, look), silent, 7)
    assert told == [7]
    np.testing.assert_array_equal(filled[~hole], photo[~hole])
    assert (filled[hole] == round(0.12345 * 65535)).all()


@pytest.mark.parametrize("shape", [(341, 601), (400, 600), (384, 512)])
def test_a_fill_lies_where_it_belongs_in_a_crop_that_is_no_square(shape, china):
    """The answer is the true picture: what of it is put in is not shifted."""
    height, width = shape
    crop = cv2.GaussianBlur(cv2.resize(china, (width, height)), (0, 0), 3.0)
    hole = np.zeros(shape, np.uint8)
    cv2.ellipse(hole, (width // 2, height // 2), (width // 3, height // 3), 0, 0, 360, 1, -1)
    longer = max(shape)
    above, before = (longer - height) // 2, (longer - width) // 2
    rims = (above, longer - height - above), (before, longer - width - before), (0, 0)
    square = np.pad(crop.astype(np.float32) / 255, rims, mode="symmetric")
    truth = cv2.resize(square, (256, 256), interpolation=cv2.INTER_AREA)
    found = fill_squares(crop, hole > 0, Filler(256, lambda *_: truth))
    off = (found.astype(np.float32) - crop).mean(-1)
    down, across = np.gradient(crop.astype(np.float32).mean(-1))
    inner = cv2.erode(hole, np.ones((9, 9))) > 0
    ways = np.column_stack([-across[inner], -down[inner]])
    shift = np.linalg.lstsq(ways, off[inner], rcond=None)[0]
    assert np.abs(shift).max() < 0.1, "px"
