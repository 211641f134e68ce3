"""Growing, shrinking, smoothing, softening selections: what must hold for any of them."""

from __future__ import annotations

from time import process_time

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
    remove_islands,
    shrink,
    smooth,
)
from tests import shapes
from tests.tree import over

LARGE = (4000, 6000)  # px: the photo that times are asked of
MOST_SECONDS = 6.0  # of the process, for each; on an idle core it is less than half

PIXEL_ROUNDING = 0.03  # share of a disc's area
CHANGES = {
    "grow": lambda s: grow(s, 4.5),
    "shrink": lambda s: shrink(s, 4.5),
    "smooth": lambda s: smooth(s, 3),
    "grow far": lambda s: grow(s, 47),
    "fill": fill_holes,
    "islands": remove_islands,
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


@over("name", shapes.MASKS)
@over("px", [1, 6, 300])
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


def archipelago() -> np.ndarray:
    """A large piece, one of a tenth of it that touches the frame, specks, and holes in all."""
    mask = disc(45) & ~disc(8)
    mask[:24, :24] = True
    mask[4:8, 4:8] = False
    mask[150:153, 10:13], mask[5, 150], mask[6, 151] = True, True, True
    return mask


def test_islands_are_what_is_small_beside_the_largest_piece():
    mask = archipelago()
    kept = remove_islands(mask)
    assert not kept[150:153, 10:13].any()
    assert not kept[5:7, 150:152].any()
    np.testing.assert_array_equal(kept[:140, :140], mask[:140, :140])
    assert not remove_islands(mask, 1.0)[:24, :24].any()
    np.testing.assert_array_equal(remove_islands(mask, 0.0), mask)


def test_an_island_goes_with_its_soft_rim_and_leaves_that_of_others():
    soft = feather(archipelago(), 4)
    kept = remove_islands(soft)
    assert not kept[140:, :20].any()
    np.testing.assert_array_equal(kept[:140, :140], soft[:140, :140])
    faint = np.where(disc(30), 90, 0).astype(np.uint8)  # glass: nothing of it is selected
    np.testing.assert_array_equal(remove_islands(faint), faint)


@pytest.mark.parametrize("change", [fill_holes, remove_islands])
def test_filling_and_removing_again_changes_nothing(change):
    for selection in (archipelago(), soft_picture(), feather(archipelago(), 4)):
        once = change(selection)
        np.testing.assert_array_equal(change(once), once)


@pytest.mark.parametrize("change", [fill_holes, remove_islands])
@pytest.mark.parametrize("times", [2, 5])
def test_holes_and_islands_are_the_same_at_any_size(change, times):
    mask = archipelago()
    large = np.kron(mask, np.ones((times, times), bool))
    np.testing.assert_array_equal(
        change(large), np.kron(change(mask), np.ones((times, times), bool))
    )


@pytest.mark.parametrize("change", [grow, shrink])
def test_an_edge_moves_as_far_at_any_size(change):
    """In a photo of four times the size by four times the px: to a px and its diagonal."""
    mask, block = archipelago(), np.ones((4, 4), bool)
    large = change(np.kron(mask, block), 4 * 5.5)
    small = change(mask, 5.5)
    assert large[np.kron(shrink(small, 1.5), block)].all()
    assert not large[~np.kron(grow(small, 1.5), block)].any()


@pytest.mark.parametrize(("px", "count"), [(1, 5), (1.2, 5), (1.42, 9), (2, 13), (2.24, 21)])
def test_a_fraction_of_a_pixel_counts(px, count):
    dot = np.zeros((9, 9), bool)
    dot[4, 4] = True
    assert grow(dot, px).sum() == count
    assert grow(mask_edit.as_coverage(dot), px).sum() == 255 * count
    assert (~shrink(~dot, px)).sum() == count


def test_a_soft_edge_that_grows_far_stays_as_soft():
    """What is farther than WIDE_REACH is found at half the size."""
    soft = feather(disc(30, 400), 12)
    far = grow(soft, 60)
    expected = mask_edit._dilated_by_rows(soft, 60)
    assert np.abs(far.astype(int) - expected).max() < 255 * 1.5 / 12, "a px and a half of its ramp"
    np.testing.assert_array_equal(far == 255, expected == 255)
    np.testing.assert_array_equal(far == 0, expected == 0)


@pytest.mark.slow
@pytest.mark.parametrize("is_soft_edge", [False, True])
def test_every_change_of_a_photo_of_24_mp_is_quick(is_soft_edge):
    y, x = np.ogrid[: LARGE[0], : LARGE[1]]
    mask = (x - 3000) ** 2 + (y - 2000) ** 2 < 1500**2
    mask[1900:1950, 2900:3000], mask[50:90, 50:90] = False, True
    selection = feather(mask, 60) if is_soft_edge else mask
    more = {"far": lambda s: grow(s, 300), "widely": lambda s: smooth(s, 120)}
    for name, change in (CHANGES | more).items():
        start = process_time()
        change(selection)
        assert process_time() - start < MOST_SECONDS, name
