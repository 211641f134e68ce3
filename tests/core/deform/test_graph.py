"""The deformable graph: symmetric, along the surface, robust against odd clouds."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.graph import AUXILIARY_RADIUS, LINK_RADIUS, build_graph
from tests import shapes

F64 = 1e-9

BALL = shapes.even(shapes.ball(3000), 60)
CLOUDS = {
    "ball": shapes.even(shapes.ball(3000), 150),
    "bar": shapes.even(shapes.bar(3000), 120),
    "sheet": shapes.sheet(),
    "horseshoe": shapes.even(shapes.horseshoe(3000), 200),
    "two parts": np.concatenate([BALL, BALL + [3.0, 0, 0]]),
    "chance": shapes.ball(80),  # uneven: falls into many parts
}
clouds = pytest.mark.parametrize("points", CLOUDS.values(), ids=CLOUDS.keys())


def _distances(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


@clouds
@pytest.mark.parametrize("links", ["geodesic", "euclidean"])
def test_weights_are_symmetric_positive_and_free_of_self_links(points, links):
    weights = build_graph(points, links).weights
    assert np.array_equal(weights, weights.T)
    assert weights.min() >= 0
    assert weights.max() <= 1
    assert not weights.diagonal().any()


@clouds
def test_the_way_along_the_surface_is_never_shorter_than_the_straight_one(points):
    graph = build_graph(points)
    assert (graph.geodesics >= _distances(points) - F64).all()


@clouds
def test_distances_along_the_surface_obey_the_triangle_inequality(points):
    g = build_graph(points).geodesics
    through = (g[:, :40, None] + g[None, :40, :]).min(1)
    assert (g <= through + F64).all()


@clouds
def test_no_link_is_longer_than_the_radius_and_none_within_it_is_missing(points):
    graph = build_graph(points)
    limit = LINK_RADIUS * _distances(points).max()
    within = graph.geodesics <= limit
    np.fill_diagonal(within, False)
    assert np.array_equal(graph.weights > 0, within)


@clouds
def test_weights_fall_with_the_distance_along_the_surface(points):
    graph = build_graph(points)
    linked = graph.weights > 0
    order = np.argsort(graph.geodesics[linked])
    assert (np.diff(graph.weights[linked][order]) <= F64).all()


def test_two_far_parts_are_two_components_without_a_link():
    graph = build_graph(CLOUDS["two parts"])
    assert graph.component_count == 2
    assert not graph.weights[:60, 60:].any()
    assert np.isinf(graph.geodesics[:60, 60:]).all()
    assert len(set(graph.components[:60])) == 1


def test_each_link_is_counted_once():
    graph = build_graph(shapes.ball(50))
    assert graph.link_count == np.count_nonzero(np.triu(graph.weights))


def test_the_ends_of_a_horseshoe_are_near_but_not_linked():
    points = shapes.even(shapes.horseshoe(3000), 200)
    tip = np.abs(np.arctan2(points[:, 1], points[:, 0])) < 0.4
    upper, lower = tip & (points[:, 1] > 0), tip & (points[:, 1] < 0)
    between = np.ix_(np.flatnonzero(upper), np.flatnonzero(lower))
    assert not build_graph(points).weights[between].any()
    assert build_graph(points, "euclidean").weights[between].any(), "the ablation does link them"


def test_sheets_farther_apart_than_the_auxiliary_radius_share_no_link():
    points = shapes.two_sheets(gap=0.4)
    spacing = build_graph(points).mean_spacing
    assert AUXILIARY_RADIUS * spacing < 0.4
    half = len(points) // 2
    assert not build_graph(points).weights[:half, half:].any()
    assert build_graph(points).component_count == 2


def test_sheets_nearer_than_the_auxiliary_radius_do_share_links():
    """What the paper's rule cannot tell apart: DESIGN section 4 says so, this pins it down."""
    points = shapes.two_sheets(gap=0.05)
    half = len(points) // 2
    assert build_graph(points).weights[:half, half:].any()
    assert build_graph(points).component_count == 1


def test_euclidean_links_ignore_the_surface():
    points = shapes.even(shapes.horseshoe(3000), 200)
    weights = build_graph(points, "euclidean").weights
    limit = LINK_RADIUS * _distances(points).max()
    within = _distances(points) <= limit
    np.fill_diagonal(within, False)
    assert np.array_equal(weights > 0, within)


def test_an_unknown_kind_of_link_is_refused():
    with pytest.raises(ValueError, match="links must be geodesic or euclidean, not 'magic'"):
        build_graph(shapes.ball(20), "magic")


def test_coincident_points_are_linked_and_break_nothing():
    points = np.concatenate([BALL, BALL[:10]])
    graph = build_graph(points)
    twins = np.arange(10), np.arange(60, 70)
    assert (graph.geodesics[twins] < F64).all()
    assert (graph.weights[twins] > 0.99).all()
    assert np.isfinite(graph.weights).all()
    assert graph.component_count == 1


def test_one_far_point_leaves_the_others_linked():
    """Its distance raises the mean spacing, not the links' radius below it."""
    points = np.concatenate([BALL, [[40.0, 0, 0]]])
    graph = build_graph(points)
    assert graph.component_count == 2
    assert len(set(graph.components[:60])) == 1


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_size_and_motion_of_the_object_do_not_change_its_weights(scale):
    points = shapes.horseshoe(150)
    moved = scale * (points @ shapes.rotation(3).T) + scale * np.array([5.0, -2.0, 9.0])
    # 1e-7: coordinates of size 10 keep distances of size 0.1 to 1e-14 / 0.1, squared in exp
    assert np.abs(build_graph(moved).weights - build_graph(points).weights).max() < 1e-7


def _two_legs(gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Two upright round bars `gap` apart, 1 long: points (N, 3) and outward normals."""
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 12, endpoint=False), np.linspace(0, 1, 25))
    normals = np.stack([np.cos(around), np.sin(around), 0 * up], -1).reshape(-1, 3)
    leg = 0.08 * normals + np.column_stack([0 * up.ravel(), 0 * up.ravel(), up.ravel()])
    other = leg + [0.16 + gap, 0.0, 0.0]
    return np.concatenate([leg, other]), np.concatenate([normals, normals])


def test_legs_that_stand_close_together_are_two_parts():
    points, normals = _two_legs(0.04)
    half = len(points) // 2
    spacing = build_graph(points).mean_spacing
    assert AUXILIARY_RADIUS * spacing > 0.04
    papers = np.count_nonzero(build_graph(points).weights[:half, half:])
    ours = np.count_nonzero(build_graph(points, normals=normals).weights[:half, half:])
    assert papers > 100
    assert ours <= 0.01 * papers


def test_the_two_sides_of_a_thin_sheet_stay_joined():
    points = shapes.sheet(30, 18, thickness=0.02)
    half = len(points) // 2
    normals = np.repeat([[0.0, 0, 1], [0.0, 0, -1]], half, axis=0)
    graph = build_graph(points, normals=normals)
    assert graph.component_count == 1
    assert (graph.weights[:half, half:] > 0).any(1).all(), "every point is linked through the sheet"


def test_the_papers_graph_knows_no_normals():
    points, normals = _two_legs(0.04)
    weights = build_graph(points, is_faithful=True, normals=normals).weights
    assert np.array_equal(weights, build_graph(points, is_faithful=True).weights)
