"""Points on the body: evenly on all of its sides, and around it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift.relief.body import BACK, FRONT, MIDDLE, ReliefBody
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.spreading import (
    BRIM,
    MIN_SPACING,
    PACKING,
    SurfacePoints,
    spread,
)
from tests import shapes
from tests.core.lift.standing_things import Box, View

EXACT = 1e-9
BAND = 2.0  # px
masks = pytest.mark.parametrize("name", [*shapes.MASKS, "box"])


@cache
def _body(name: str) -> ReliefBody:
    if name == "box":
        view = View(Camera.from_fov(320, 240), 15.0)
        outline = ReliefSilhouette.of(view.hull(Box(view.ahead, angle=30.0).points))
        return ReliefBody.of(outline, view.camera, LiftSettings(horizon=view.horizon))
    return ReliefBody.of(ReliefSilhouette.of(shapes.mask(name)), shapes.camera(), LiftSettings())


@cache
def _spread(name: str, count: int = 3000) -> tuple[SurfacePoints, float]:
    return spread(_body(name), count, BAND, np.random.default_rng(0))


def _points(surface: SurfacePoints) -> F64:
    return np.column_stack([surface.xy, surface.height])


@masks
def test_the_sheets_lie_where_the_body_is(name):
    surface, _ = _spread(name)
    body = _body(name)
    for side, chosen in ((FRONT, surface.is_front & ~surface.is_brim), (MIDDLE, surface.is_brim)):
        height, _ = body.sample(surface.xy[chosen], side)
        assert np.abs(height - surface.height[chosen]).max() < EXACT
    behind = ~surface.is_front
    low, high = (body.sample(surface.xy[behind], side)[0] for side in (BACK, FRONT))
    assert (surface.height[behind] >= low - EXACT).all()
    assert (surface.height[behind] <= high + EXACT).all()


@pytest.mark.parametrize("name", ["disc", "ellipse", "frame", "parts", "ring", "star", "box"])
def test_normals_are_unit_and_point_out(name):
    surface, spacing = _spread(name)
    assert np.abs(np.linalg.norm(surface.normals, axis=1) - 1).max() < EXACT
    body = _body(name)
    ahead = _points(surface) + 0.2 * spacing * surface.normals
    front, back = (body.sample(ahead[:, :2], side)[0] for side in (FRONT, BACK))
    outline = body.silhouette
    column, row = np.rint(outline.grid_xy(ahead[:, :2])).astype(int).T
    h, w = outline.shape
    is_in = (column >= 0) & (row >= 0) & (column < w) & (row < h)
    is_in[is_in] = outline.inside[row[is_in], column[is_in]]
    is_in &= (ahead[:, 2] < front) & (ahead[:, 2] > back)
    assert is_in.mean() < 0.05  # tips are as fine as the spacing


@masks
def test_no_two_points_of_a_sheet_are_nearer_than_their_spacing_says(name):
    surface, spacing = _spread(name)
    is_wall = ~surface.is_front & (surface.normals[:, 2] == 0)
    brim = surface.is_brim
    for sheet in (brim, surface.is_front & ~brim, is_wall, ~surface.is_front & ~is_wall):
        if sheet.sum() > 1:
            gap = cKDTree(_points(surface)[sheet]).query(_points(surface)[sheet], k=2)[0][:, 1]
            assert gap.min() >= spacing * np.sqrt(PACKING) - EXACT


@masks
def test_no_place_of_the_front_is_without_a_point(name):
    surface, spacing = _spread(name)
    body = _body(name)
    rows, columns = np.nonzero(body.silhouette.inside)
    xy = body.silhouette.photo_xy(np.column_stack([columns, rows]).astype(np.float64))
    height, _ = body.sample(xy, FRONT)
    own = surface.is_front & ~surface.is_brim
    gap = cKDTree(_points(surface)[own]).query(np.column_stack([xy, height]))[0]
    # Where the rim is steep a cell holds more of the front than its middle.
    assert np.quantile(gap, 0.99) < 1.2 * spacing
    assert gap.max() < 3 * max(spacing, body.silhouette.cell)


@pytest.mark.parametrize("name", ["disc", "ellipse", "frame", "star"])
def test_no_gap_opens_where_the_front_is_seen_edge_on(name):
    """A lid of which the photo shows a line: one px from its rim is 20 deep."""
    plain = _body(name)
    outline = plain.silhouette
    rows = np.arange(outline.shape[0])[:, None]
    body = plain.nearer(20 * outline.cell * rows * np.ones(outline.shape))
    surface, spacing = spread(body, 6000, BAND, np.random.default_rng(0))
    tree, cells = cKDTree(_points(surface)), np.argwhere(outline.inside)[:, ::-1]
    for down in np.linspace(-0.4, 0.4, 5):
        xy = outline.photo_xy(cells + np.array([0.0, down]))
        height, _ = body.sample(xy, FRONT)
        gap = tree.query(np.column_stack([xy, height]))[0]
        assert gap.max() < 1.2 * spacing


@pytest.mark.parametrize("count", [500, 2000, 6000])
def test_about_as_many_points_as_asked(count):
    surface, _ = spread(_body("box"), count, BAND, np.random.default_rng(0))
    assert 0.75 * count < (~surface.is_brim).sum() < 1.25 * count


def test_there_are_never_more_points_than_pixels():
    surface, spacing = spread(_body("disc"), 500_000, BAND, np.random.default_rng(0))
    assert spacing == MIN_SPACING
    assert (surface.is_front & ~surface.is_brim).sum() < 4 * np.pi * 40**2


@masks
def test_the_brim_reaches_past_the_soft_edge_and_not_much_farther(name):
    surface, spacing = _spread(name)
    outline = _body(name).silhouette
    rows, columns = np.nonzero(outline.inside)
    cells = outline.photo_xy(np.column_stack([columns, rows]).astype(np.float64))
    gap = cKDTree(cells).query(surface.xy[surface.is_brim])[0]
    reach = BAND + BRIM * spacing
    assert gap.max() < reach + 2 * outline.cell
    assert gap.max() > 0.8 * reach
    assert gap.min() > 0.3 * outline.cell, "none lies inside"


def test_a_wall_joins_the_sheets_of_a_box_from_front_to_back():
    surface, spacing = _spread("box")
    body = _body("box")
    is_wall = ~surface.is_front & (surface.normals[:, 2] == 0)
    assert is_wall.sum() > 50
    middles, _ = body.silhouette.contour
    rims = np.concatenate(
        [np.column_stack([middles, body.sample(middles, side)[0]]) for side in (FRONT, BACK)]
    )
    thick = (body.sample(middles, FRONT)[0] - body.sample(middles, BACK)[0]) > 3 * spacing
    gap = cKDTree(_points(surface)[is_wall]).query(rims[np.tile(thick, 2)])[0]
    assert np.quantile(gap, 0.95) < 1.5 * spacing


def test_the_same_dice_give_the_same_points():
    one, two = (spread(_body("star"), 800, BAND, np.random.default_rng(5))[0] for _ in range(2))
    assert np.array_equal(_points(one), _points(two))
