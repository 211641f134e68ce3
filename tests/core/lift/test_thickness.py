"""Limbs are round, bodies are flatter, and the rim is where they meet nothing."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.thickness import FULL_BODY, FULLNESS, RIM_SLOPE, Thickness
from tests import shapes

EXACT = 1e-9
STAIRCASE = 1.0  # px: where an outline is, on a grid
masks = pytest.mark.parametrize("name", shapes.MASKS)


def _strip(half: float, length: int = 360) -> Mask:
    width = round(2 * half)
    mask = np.zeros((width + 40, length + 40), bool)
    mask[20 : 20 + width, 20 : 20 + length] = True
    return mask


def _disc(radius: float) -> Mask:
    side = int(2 * radius + 41)
    y, x = np.mgrid[:side, :side] + 0.5 - side / 2
    return np.hypot(x, y) < radius


def _half(mask: Mask, xy: F64) -> F64:
    outline = ReliefSilhouette.of(mask)
    return Thickness.of(outline).sample(outline.grid_xy(xy), outline.cell)[0]


def _middle(mask: Mask) -> float:
    rows, columns = np.nonzero(mask)
    return float(_half(mask, np.array([[columns.mean() + 0.5, rows.mean() + 0.5]]))[0])


def _ball(radius: float, extent: float) -> float:
    """Half-thickness in the middle of a disc, as the module's constants say."""
    squared = 1 / (1 + (radius / (FULL_BODY * extent)) ** 2)
    crease = squared * radius / RIM_SLOPE
    return FULLNESS * (np.hypot(np.sqrt(squared) * radius, crease) - crease)


@pytest.mark.parametrize("half", [6.5, 10.5, 20.5])
def test_a_strip_becomes_a_limb_as_thick_as_it_is_wide(half):
    assert _middle(_strip(half)) == pytest.approx(half, rel=0.12)


def test_the_cross_section_of_a_strip_is_round():
    half = 20.5
    across = np.arange(-18, 18.5, 1.0)
    found = _half(_strip(half), np.column_stack([np.full(len(across), 200.0), across + 40.5]))
    circle = np.sqrt(half**2 - across**2)
    assert np.abs(found - circle).max() < 0.17 * half, "but for the crease at its rim"
    assert np.abs(found - circle)[8:-8].max() < 0.1 * half


@pytest.mark.parametrize("radius", [40, 80, 120])
def test_a_disc_becomes_a_ball_flattened_as_a_full_body_is(radius):
    found = _middle(_disc(radius))
    assert found == pytest.approx(_ball(radius, 2 * radius), rel=0.04)
    assert 0.7 * radius < found < 0.9 * radius, "no balloon, no plate"


def test_a_wide_limb_is_thicker_than_a_narrow_one():
    heights = [_middle(_strip(half, 560)) for half in (5.5, 10.5, 20.5)]
    assert heights[0] * 1.6 < heights[1]
    assert heights[1] * 1.6 < heights[2]


@pytest.mark.parametrize("name", ["disc", "star", "ring", "thin"])
@pytest.mark.parametrize("scale", [2, 5])
def test_the_same_object_in_a_larger_photo_has_the_same_shape(name, scale):
    small, large = shapes.mask(name), shapes.mask(name, 160 * scale, 120 * scale)
    y, x = np.nonzero(ReliefSilhouette.of(small).depth > 2)
    outline = ReliefSilhouette.of(small)
    xy = outline.photo_xy(np.column_stack([x, y]).astype(np.float64))
    one, many = _half(small, xy), _half(large, scale * xy) / scale
    # Thin parts are finer on a finer grid: half a cell of a limb of six.
    assert np.abs(one - many).max() < 2.2 * STAIRCASE
    assert np.abs(one - many).mean() < 0.7 * STAIRCASE


@masks
def test_the_mirror_image_has_the_mirrored_shape(name):
    mask = shapes.mask(name)
    here = Thickness.of(ReliefSilhouette.of(mask))
    there = Thickness.of(ReliefSilhouette.of(mask[:, ::-1]))
    assert np.abs(here.square - there.square[:, ::-1]).max() < 1e-6 * here.square.max()
    assert np.abs(here.crease - there.crease[:, ::-1]).max() < 1e-6 * here.crease.max()


@masks
def test_it_is_thin_at_the_outline_and_nothing_beyond(name):
    mask = shapes.mask(name)
    outline = ReliefSilhouette.of(mask)
    thickness = Thickness.of(outline)
    middles, _ = outline.contour
    # but for the cut: the silhouette reaches past the photo's frame there
    middles = middles[(middles < [155, 115]).all(1)] if name == "frame" else middles
    at_rim = thickness.sample(outline.grid_xy(middles), outline.cell)[0]
    # The contour runs through the outermost pixels: half of one inside.
    assert np.quantile(at_rim, 0.9) < 5 * STAIRCASE
    beyond = middles + 3 * outline.outward(middles)
    assert thickness.sample(outline.grid_xy(beyond), outline.cell)[0].max() < STAIRCASE


@masks
def test_no_rim_is_steeper_than_the_photo_can_show(name):
    outline = ReliefSilhouette.of(shapes.mask(name))
    y, x = np.nonzero(outline.inside)
    _, slope = Thickness.of(outline).sample(np.column_stack([x, y]).astype(float), outline.cell)
    assert np.linalg.norm(slope, axis=1).max() < 1.2 * FULLNESS * RIM_SLOPE


@pytest.mark.parametrize("name", ["disc", "ellipse", "frame", "parts", "ring", "star"])
def test_the_slope_is_that_of_the_thickness(name):
    outline = ReliefSilhouette.of(shapes.mask(name))
    thickness = Thickness.of(outline)
    y, x = np.nonzero(outline.depth > 3)
    at = np.column_stack([x, y]).astype(np.float64)
    _, slope = thickness.sample(at, outline.cell)
    for axis in range(2):
        step = np.eye(2)[axis]
        ahead, behind = (thickness.sample(at + s * step, 1.0)[0] for s in (1, -1))
        gap = np.abs(0.5 * (ahead - behind) - slope[:, axis])
        assert np.quantile(gap, 0.9) < 0.15


def test_parts_do_not_know_of_each_other():
    part = _disc(30)
    alone, both = (
        Thickness.of(ReliefSilhouette.of(part)),
        ReliefSilhouette.of(np.hstack([part, part])),
    )
    pair = Thickness.of(both)
    side = alone.square.shape[1] - 6
    # A part of a larger whole is less flattened, and no thinner.
    ratio = pair.square[3:-3, 3:side].max() / alone.square.max()
    assert 1 <= ratio < 1.7
    h = pair.square.shape[0] // 2
    gap = both.shape[1] // 2
    assert pair.square[h, gap] <= 0


@pytest.mark.parametrize("factor", [0.3, 1.8])
def test_times_is_exactly_so_much_thicker(factor):
    outline = ReliefSilhouette.of(shapes.mask("star"))
    one = Thickness.of(outline)
    y, x = np.nonzero(outline.inside)
    at = np.column_stack([x, y]).astype(np.float64)
    half, slope = one.sample(at, 1.0)
    other, steeper = one.times(np.full(outline.shape, factor)).sample(at, 1.0)
    thick = half > 0.1  # thinner than that the crease's floor, a thousandth of a px, counts
    assert np.abs(other - factor * half)[thick].max() < 1e-3
    assert np.abs(steeper - factor * slope)[thick].max() < 1e-2


def test_the_mean_with_its_image_is_symmetric():
    mask = shapes.mask("star")
    outline = ReliefSilhouette.of(mask)
    thickness = Thickness.of(outline)
    image = outline.cells.copy()
    image[..., 0] = outline.shape[1] - 1 - image[..., 0]
    mean = thickness.mean_with(image)
    inside = (mean.square > 0) & (thickness.square > 0) & (thickness.square[:, ::-1] > 0)
    gap = np.abs(mean.square - mean.square[:, ::-1])[inside & inside[:, ::-1]]
    assert gap.max() < 1e-2 * mean.square.max()  # bilinear stops a thousandth before the edge


def test_where_the_object_leaves_the_photo_it_does_not_close():
    at_frame, inner = _half(shapes.mask("frame"), np.array([[130.0, 119.0], [130.0, 105.0]]))
    assert at_frame > 0.7 * inner
