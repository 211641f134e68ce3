"""Growing, shrinking, smoothing, softening selections: what must hold for any of them."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.segment import mask_edit
from objectmorpher_core.segment.mask_edit import (
    feather,
    fill_holes,
    grow,
    invert,
    is_selected,
    is_soft,
    shrink,
    smooth,
)
from tests import shapes

PIXEL_ROUNDING = 0.03  # share of a disc's area
CHANGES = {
    "grow": lambda s: grow(s, 4.5),
    "shrink": lambda s: shrink(s, 4.5),
    "smooth": lambda s: smooth(s, 3),
    "fill": fill_holes,
    "invert": invert,
}
changes = pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)


def disc(radius: float, size: int = 160) -> np.ndarray:
    y, x = np.mgrid[0:size, 0:size]
    return np.hypot(x - size / 2, y - size / 2) <= radius


def soft_picture(seed: int = 3) -> np.ndarray:
    """(H, W) u8 of soft blobs: some full, some faint, some cut by the frame."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:90, 0:120]
    sums = np.zeros((90, 120))
    for _ in range(14):
        gap = np.hypot(x - random.uniform(0, 120), y - random.uniform(0, 90))
        sums += random.uniform(60, 300) * np.clip(2 - gap / random.uniform(4, 14), 0, 1)
    return np.clip(sums, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("px", [1, 5, 12.5])
def test_a_disc_grows_and_shrinks_by_its_radius(px):
    for change, radius in ((grow, 40 + px), (shrink, 40 - px)):
        area = change(disc(40), px).sum()
        assert area == pytest.approx(np.pi * radius**2, rel=PIXEL_ROUNDING)


def test_growing_reaches_exactly_as_far_as_it_says():
    dot = np.zeros((61, 61), bool)
    dot[30, 30] = True
    y, x = np.mgrid[-30:31, -30:31]
    np.testing.assert_array_equal(grow(dot, 13), x * x + y * y <= 13 * 13)


@pytest.mark.parametrize("name", shapes.MASKS)
def test_growing_and_shrinking_are_each_others_opposite(name):
    mask = shapes.mask(name)
    np.testing.assert_array_equal(shrink(mask, 4), invert(grow(invert(mask), 4)))
    closed, opened = shrink(grow(mask, 4), 4), grow(shrink(mask, 4), 4)
    assert (closed | ~mask).all(), "closing never takes away"
    assert (~opened | mask).all(), "opening never adds"
    np.testing.assert_array_equal(shrink(grow(closed, 4), 4), closed)


def test_a_convex_shape_that_grows_and_shrinks_is_as_before():
    mask = np.zeros((100, 100), bool)
    mask[30:70, 25:60] = True
    np.testing.assert_array_equal(shrink(grow(mask, 6), 6), mask)
    np.testing.assert_array_equal(fill_holes(mask), mask)


@changes
def test_the_mask_of_a_changed_coverage_is_the_changed_mask(change):
    coverage = soft_picture()
    assert is_soft(coverage).any()
    np.testing.assert_array_equal(is_selected(change(coverage)), change(is_selected(coverage)))


@changes
def test_a_hard_coverage_changes_as_its_mask(change):
    mask = is_selected(soft_picture())
    coverage = change(mask_edit.as_coverage(mask))
    assert not is_soft(coverage).any()
    np.testing.assert_array_equal(coverage > 0, change(mask))


@changes
def test_a_change_leaves_its_argument_alone(change):
    for selection in (soft_picture(), is_selected(soft_picture())):
        before = selection.copy()
        selection.setflags(write=False)
        change(selection)
        np.testing.assert_array_equal(selection, before)


@changes
def test_nothing_and_everything_are_no_special_case(change):
    for plain in (np.zeros((40, 50), bool), np.ones((40, 50), bool)):
        np.testing.assert_array_equal(change(plain), ~plain if change is invert else plain)


def test_what_the_frame_cuts_does_not_shrink_there():
    mask = np.zeros((60, 80), bool)
    mask[:, :40] = True
    assert shrink(mask, 5)[:, :35].all()
    assert not shrink(mask, 5)[:, 35:].any()
    assert (feather(mask, 5)[:, :30] == 255).all()


def test_inverting_twice_changes_nothing():
    for selection in (soft_picture(), is_selected(soft_picture())):
        np.testing.assert_array_equal(invert(invert(selection)), selection)


@pytest.mark.parametrize("name", shapes.MASKS)
@pytest.mark.parametrize("px", [1, 6, 300])
def test_a_soft_edge_has_its_half_line_on_the_edge(name, px):
    mask = shapes.mask(name)
    np.testing.assert_array_equal(is_selected(feather(mask, px)), mask)


def test_a_soft_edge_ends_where_it_says():
    coverage = feather(disc(40), 8)
    away = np.hypot(*(np.mgrid[0:160, 0:160] - 80.0))
    assert (coverage[away < 40 - 9] == 255).all()
    assert (coverage[away > 40 + 9] == 0).all()
    assert is_soft(coverage)[(away > 35) & (away < 45)].mean() > 0.95
    middle = coverage[80, 80:]
    assert (np.diff(middle.astype(int)) <= 0).all()


def test_holes_are_filled_but_not_what_is_open_to_the_frame():
    ring = disc(40) & ~disc(20)
    np.testing.assert_array_equal(fill_holes(ring), disc(40))
    open_ring = ring.copy()
    open_ring[75:85, :80] = False
    np.testing.assert_array_equal(fill_holes(open_ring), open_ring)
    soft = np.minimum(feather(disc(40), 5), 255 - feather(disc(20), 5))
    filled = fill_holes(soft)
    assert (filled[disc(34)] == 255).all(), "the hole's soft rim goes, too"
    np.testing.assert_array_equal(filled[~disc(34)], soft[~disc(34)])


def test_smoothing_takes_specks_and_teeth_and_keeps_the_rest():
    mask = disc(40)
    noisy = mask.copy()
    noisy[10, 10] = True
    noisy[80, 80] = False
    noisy[39:42, 79:82] = True
    smoothed = smooth(noisy, 4)
    assert not smoothed[10, 10]
    assert smoothed[80, 80]
    assert (smoothed ^ mask).mean() < 0.002
