"""The silhouette: distances from its outline, its largest discs, and its outline itself."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.document.model import Matte
from objectmorpher_core.lift.relief.silhouette import (
    GRID,
    ReliefSilhouette,
    lower_hull,
    solid_part,
)
from tests import shapes

EXACT = 1e-9
masks = pytest.mark.parametrize("name", shapes.MASKS)


def _disc(radius: float, scale: float = 1.0) -> Mask:
    side = int(scale * (2 * radius + 21))
    y, x = np.mgrid[:side, :side] + 0.5 - side / 2
    return np.hypot(x, y) < scale * radius


@masks
def test_the_grid_and_the_photo_are_told_apart_and_together(name):
    outline = ReliefSilhouette.of(shapes.mask(name))
    xy = np.random.default_rng(0).uniform(-50, 200, (30, 2))
    assert np.abs(outline.photo_xy(outline.grid_xy(xy)) - xy).max() < EXACT


def test_it_is_the_mask_itself_where_that_is_small():
    mask = shapes.mask("star")
    outline = ReliefSilhouette.of(mask)
    assert outline.cell == 1
    rows, columns = np.nonzero(outline.inside)
    x, y = outline.photo_xy(np.column_stack([columns, rows]).astype(float)).T
    drawn = np.zeros_like(mask)
    drawn[np.floor(y).astype(int), np.floor(x).astype(int)] = True
    assert np.array_equal(drawn, mask)


@pytest.mark.parametrize("side", [700, 1333, 2600])
def test_a_large_mask_keeps_its_area_and_its_place(side):
    mask = shapes.mask("star", side, round(0.75 * side))
    outline = ReliefSilhouette.of(mask)
    assert max(outline.shape) <= GRID + 3
    assert outline.inside.sum() * outline.cell**2 == pytest.approx(mask.sum(), rel=0.01)
    rows, columns = np.nonzero(outline.inside)
    middle = outline.photo_xy(np.array([[columns.mean(), rows.mean()]]))[0]
    y, x = np.nonzero(mask)
    assert np.abs(middle - [x.mean() + 0.5, y.mean() + 0.5]).max() < 0.1 * outline.cell


@masks
def test_the_outermost_ring_is_outside(name):
    inside = ReliefSilhouette.of(shapes.mask(name)).inside
    assert not (inside[0].any() or inside[-1].any() or inside[:, 0].any() or inside[:, -1].any())


def test_the_depth_in_a_disc_is_the_way_to_its_rim():
    outline = ReliefSilhouette.of(_disc(40))
    y, x = outline.cells[..., 1], outline.cells[..., 0]
    middle = (np.array(outline.shape) - 1) / 2
    expected = 40 - np.hypot(x - middle[1], y - middle[0])
    assert np.abs(outline.depth - expected)[outline.inside].max() < 1  # px, of the staircase


def test_every_place_in_a_strip_has_the_strips_radius():
    mask = np.zeros((60, 240), bool)
    mask[20:41, 20:220] = True
    outline = ReliefSilhouette.of(mask)
    inner = np.zeros_like(outline.inside)
    inner[2:-2, 15:-15] = True
    assert np.abs(outline.radius[inner & outline.inside] - 10.5).max() <= 0.5


@masks
def test_a_disc_that_covers_a_place_is_no_smaller_than_the_way_to_the_outline(name):
    outline = ReliefSilhouette.of(shapes.mask(name))
    assert (outline.radius >= outline.depth - EXACT).all()
    assert outline.radius.max() <= outline.depth.max() + EXACT


@pytest.mark.parametrize("turns", range(4))
def test_an_open_side_is_no_outline(turns):
    """A strip that leaves the photo is as deep at the frame as in its middle."""
    mask = np.zeros((200, 200), bool)
    mask[:150, 90:111] = True
    outline = ReliefSilhouette.of(np.rot90(mask, turns))
    assert sum(outline.is_open) == 1
    depth = np.rot90(outline.depth, -turns)
    assert depth[1].max() == pytest.approx(10.5, abs=0.5)
    assert depth[-3].max() < 3


def test_the_contour_runs_along_the_rim_once():
    outline = ReliefSilhouette.of(_disc(40))
    middles, offsets = outline.contour
    middle = middles.mean(0)
    assert np.abs(np.hypot(*(middles - middle).T) - 40).max() < 1.5  # px
    lengths = np.linalg.norm(offsets, axis=1).sum()
    assert 2 * np.pi * 40 * 0.95 < lengths < 2 * np.pi * 40 * 1.1  # a staircase is longer
    assert np.abs(offsets.sum(0)).max() < EXACT, "it closes"


def test_the_contour_of_a_ring_runs_around_its_hole_too():
    middles, _ = ReliefSilhouette.of(shapes.mask("ring")).contour
    gap = np.hypot(*(middles - [80, 60]).T)
    assert (gap < 25).sum() > 60
    assert (gap > 40).sum() > 100


def test_the_contour_runs_along_the_cut_where_the_object_leaves_the_photo():
    """There it is sawn off, not hollow."""
    outline = ReliefSilhouette.of(shapes.mask("frame"))
    middles, offsets = outline.contour
    grid = outline.grid_xy(middles)
    h, w = outline.shape
    assert ((grid[:, 0] > w - 3) & (np.abs(offsets[:, 0]) < EXACT)).sum() > 20
    assert ((grid[:, 1] > h - 3) & (np.abs(offsets[:, 1]) < EXACT)).sum() > 20


def test_outward_is_away_from_a_disc():
    outline = ReliefSilhouette.of(_disc(40))
    angle = np.linspace(0, 2 * np.pi, 37)
    away = np.column_stack([np.cos(angle), np.sin(angle)])
    middle = outline.photo_xy((np.array(outline.shape[::-1]) - 1)[None] / 2)
    for radius in (42, 55, 120):
        found = outline.outward(middle + radius * away)
        assert (found * away).sum(1).min() > 0.98
        assert np.abs(np.linalg.norm(found, axis=1) - 1).max() < EXACT


def test_the_lower_outline_of_a_disc_is_its_lower_half():
    x, y = ReliefSilhouette.of(_disc(40)).lower_outline
    middle = 61 / 2 + 20
    assert (np.diff(x) > 0).all()
    expected = middle + np.sqrt(np.maximum(40**2 - (x - middle) ** 2, 0))
    assert np.abs(y - expected)[4:-4].max() < 1.5


def test_a_hull_is_below_everything_and_bends_one_way():
    rng = np.random.default_rng(1)
    x, y = np.arange(200.0), rng.normal(size=200).cumsum()
    hull = lower_hull(x, y)
    assert hull[0] == 0
    assert hull[-1] == 199
    assert (np.interp(x, x[hull], y[hull]) >= y - EXACT).all()
    assert (np.diff(np.diff(y[hull]) / np.diff(x[hull])) < EXACT).all()


def test_one_pixel_is_a_silhouette():
    mask = np.zeros((30, 40), bool)
    mask[10, 20] = True
    outline = ReliefSilhouette.of(mask)
    assert outline.inside.sum() == 1
    assert outline.depth.max() > 0


def test_a_hair_of_a_huge_photo_is_not_lost():
    mask = np.zeros((900, 2000), bool)
    mask[450, 100:1900] = True  # a seventh of a cell
    assert ReliefSilhouette.of(mask).inside.any()


@pytest.mark.parametrize("height", range(400, 412))
def test_what_leaves_the_photo_has_no_outline_at_the_frame(height):
    mask = np.zeros((height, height + 50), bool)
    mask[100:, 120:] = True
    outline = ReliefSilhouette.of(mask)
    assert outline.inside[-2, -2]
    far = outline.depth[-2, -2]
    assert far > 0.9 * outline.depth.max()


def _matte(alpha: np.ndarray) -> Matte:
    return Matte(0, 0, alpha.astype(np.float32), np.zeros((*alpha.shape, 3), np.float32))


@masks
def test_what_is_covered_is_solid_however_thin_it_is(name):
    mask = shapes.mask(name)
    near = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.5)
    drawn = np.where(mask, np.maximum(near, 0.5), near)  # glass, too, is never less than selected
    for alpha in (mask, near, drawn, 0.6 * mask):
        assert solid_part(mask, _matte(alpha)) is mask


@pytest.mark.parametrize("width", [30, 5])
def test_gaps_between_hairs_and_single_hairs_are_not_solid(width: int):
    """Also where they are narrow, as around a long-haired dog, and a side would stand behind."""
    y, x = np.mgrid[:240, :320] + 0.5
    away = np.hypot(x - 160, y - 120)
    hairs = np.sin(60 * np.arctan2(y - 120, x - 160)) > 0.6
    limb = (np.abs(y - 120) < 2) & (x < 160) & (x > 20)
    alpha = (away < 60) | (away < 60 + width) & hairs | limb
    mask = (away < 60 + width) | limb
    solid = solid_part(mask, _matte(alpha))
    assert solid[away < 55].all()
    assert not solid[(away > 60 + width / 3) & (x > 160)].any()
    assert solid[limb & (x < 60)].all(), "what is thin and apart from hair stays"
