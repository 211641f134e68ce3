"""Paint is one picture, whichever tiles hold it: compared with one array of it all."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher_core.document.paint import SIDE, Paint

CORNER = -SIDE  # px, of the array that stands for it all
WHOLE = 3 * SIDE
F32 = 1e-6


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_is_laid_on_is_there_and_nothing_else(seed):
    rng = np.random.default_rng(seed)
    places = rng.integers(CORNER, CORNER + WHOLE - 60, (4, 2))
    strokes = np.hstack([places, rng.integers(1, 61, (4, 2))]).tolist()
    paint = Paint((), np.zeros((0, 4), np.uint8))
    whole = np.zeros((WHOLE, WHOLE, 4), np.uint8)
    corner = (
        (-20, SIDE - 20, 45, 40),
        (0, SIDE - 30, 20, 30),
    )  # over a corner of tiles, and up to it
    for x, y, width, height in [*strokes, *corner]:
        rgba = rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
        rgba[..., 3] |= 1
        paint = paint.with_pixels((x, y, x + width, y + height), rgba)
        whole[y - CORNER : y - CORNER + height, x - CORNER : x - CORNER + width] = rgba
    everything = (CORNER, CORNER, CORNER + WHOLE, CORNER + WHOLE)
    np.testing.assert_array_equal(paint.crop(everything), whole)
    assert all(tile.left % SIDE == tile.top % SIDE == 0 for tile in paint.tiles)
    assert all(tile.rgba[..., 3].any() for tile in paint.tiles), "a tile without paint is none"
    assert len({(tile.left, tile.top) for tile in paint.tiles}) == len(paint.tiles)
    around = strokes[0][0] - 3, strokes[0][1] - 5, (66, 70)
    for left, top, size in (around, (-15, SIDE - 15, (30, 20))):  # the second is full of paint
        colours = rng.random((*size, 3)).astype(np.float32)
        part = paint.crop((left, top, left + size[1], top + size[0])) / 255
        mixed = colours + part[..., 3:] * (part[..., :3] - colours)
        np.testing.assert_allclose(paint.over(colours, left, top), mixed, atol=F32)


def test_what_is_wiped_off_leaves_no_tile():
    box = (SIDE - 4, 2 * SIDE - 3, SIDE + 5, 2 * SIDE + 6)
    paint = Paint((), np.zeros((0, 4), np.uint8)).with_pixels(box, np.full((9, 9, 4), 9, np.uint8))
    assert len(paint.tiles) == 4
    assert not paint.with_pixels(box, np.zeros((9, 9, 4), np.uint8)).tiles
