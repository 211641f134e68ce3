"""The deformable graph: symmetric, along the surface, across no gap, robust against odd clouds."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.graph import (
    AUXILIARY_RADIUS,
    FALLOFF,
    LINK_RADIUS,
    REACH,
    ControlGraph,
    build_graph,
)
from objectmorpher_core.document.rig import Seam
from objectmorpher_core.document.settings import DeformSettings
from tests import shapes
from tests.tree import over

F64 = 1e-9
FAITHFUL = DeformSettings(is_faithful=True)
EUCLIDEAN = DeformSettings(links="euclidean")
EVERY = {"default": DeformSettings(), "faithful": FAITHFUL, "euclidean": EUCLIDEAN}

BALL = shapes.even(shapes.ball(3000), 60)
CLOUDS = {
    "ball": shapes.even(shapes.ball(3000), 150),
    "bar": shapes.even(shapes.bar(3000), 120),
    "sheet": shapes.sheet(),
    "horseshoe": shapes.even(shapes.horseshoe(3000), 200),
    "two parts": np.concatenate([BALL, BALL + [3.0, 0, 0]]),
    "chance": shapes.ball(80),  # uneven: falls into many parts
}
ODD = {
    "four": shapes.ball(4),
    "line": np.linspace(0, 1, 30)[:, None] * [1.0, 2.0, 3.0],
    "plane": shapes.sheet(),
    "one place": np.ones((6, 3)),
    "pairs": np.repeat(BALL, 2, axis=0),
    "far point": np.concatenate([BALL, [[40.0, 0, 0]]]),
}
clouds = pytest.mark.parametrize("points", CLOUDS.values(), ids=CLOUDS.keys())
odd = pytest.mark.parametrize("points", [*CLOUDS.values(), *ODD.values()], ids=[*CLOUDS, *ODD])
every = pytest.mark.parametrize("settings", EVERY.values(), ids=EVERY.keys())


def _distances(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


def _geodesics(graph: ControlGraph) -> np.ndarray:
    """(M, M) all distances along the surface."""
    return np.stack([graph.distances_from(i) for i in range(len(graph.components))])


@odd
@every
def test_weights_are_symmetric_positive_and_free_of_self_links(points, settings):
    graph = build_graph(points, settings)
    for matrix in (graph.weights, graph.auxiliary):
        assert (matrix != matrix.T).nnz == 0
        assert matrix.has_sorted_indices
        assert not matrix.diagonal().any()
        assert (matrix.data > 0).all() and np.isfinite(matrix.data).all()
    assert graph.weights.max() <= 1


@odd
@every
def test_links_hold_together_what_the_auxiliary_graph_does(points, settings):
    graph = build_graph(points, settings)
    reached = np.isfinite(_geodesics(graph))
    together = graph.components[:, None] == graph.components
    assert (together >= reached).all()
    is_alone = (reached.sum(1) == 1) & (together.sum(1) == 1)
    assert ((np.diff(graph.weights.indptr) > 0) | is_alone).all()


@clouds
def test_the_way_along_the_surface_is_never_shorter_than_the_straight_one(points):
    assert (_geodesics(build_graph(points)) >= _distances(points) - F64).all()


@clouds
def test_distances_along_the_surface_obey_the_triangle_inequality(points):
    g = _geodesics(build_graph(points))
    through = (g[:, :40, None] + g[None, :40, :]).min(1)
    assert (g <= through + F64).all()


@clouds
@over("stiffness", [0.25, 1.0, 2.0])
def test_no_link_is_longer_than_the_radius_and_none_within_it_is_missing(points, stiffness):
    graph = build_graph(points, DeformSettings(stiffness=stiffness))
    spacing = graph.mean_spacing
    limit = stiffness * min(LINK_RADIUS * _distances(points).max(), REACH * FALLOFF * spacing)
    geodesics = _geodesics(graph)
    within = (geodesics <= limit) | (graph.auxiliary.toarray() > 0)
    np.fill_diagonal(within, False)
    assert np.array_equal(graph.weights.toarray() > 0, within)
    expected = np.exp(
        -((np.where(within, geodesics, 0) / (FALLOFF * stiffness * spacing)) ** 2) / 2
    )
    is_usual = within & (geodesics <= limit)
    assert np.abs(graph.weights.toarray() - expected)[is_usual].max(initial=0) < F64


@clouds
def test_the_faithful_graph_is_the_papers(points):
    distances = _distances(points)
    np.fill_diagonal(distances, np.inf)
    spacing = distances.min(1).mean()
    np.fill_diagonal(distances, 0)
    g = np.where(distances <= AUXILIARY_RADIUS * spacing * (1 + F64), distances, np.inf)
    for k in range(len(g)):  # Floyd and Warshall
        g = np.minimum(g, g[:, k, None] + g[k])
    linked = g <= LINK_RADIUS * distances.max()
    np.fill_diagonal(linked, False)
    falloff = g[linked].mean()
    expected = np.where(linked, np.exp(-(np.where(linked, g, 0) ** 2) / (2 * falloff**2)), 0)
    assert np.abs(build_graph(points, FAITHFUL).weights.toarray() - expected).max() < F64


@odd
def test_neighbours_are_the_nearest_along_the_surface(points):
    graph = build_graph(points)
    geodesics = np.sort(_geodesics(graph), axis=1)[:, :16]
    assert graph.neighbours.shape == geodesics.shape
    assert np.array_equal(graph.neighbours[:, 0], np.arange(len(points)))
    for i, own in enumerate(graph.neighbours):
        known = own[own >= 0]
        assert len(np.unique(known)) == len(known) == np.isfinite(geodesics[i]).sum()
        found = graph.distances_from(i)[known]
        assert np.abs(found - geodesics[i, : len(known)]).max() < F64


def test_two_far_parts_are_two_components_without_a_link():
    graph = build_graph(CLOUDS["two parts"])
    assert graph.component_count == 2
    assert graph.weights[:60, 60:].nnz == 0
    assert np.isinf(graph.distances_from(0)[60:]).all()
    assert len(set(graph.components[:60])) == 1


def test_each_link_is_counted_once():
    graph = build_graph(shapes.ball(50))
    assert graph.link_count == np.count_nonzero(np.triu(graph.weights.toarray()))


def test_the_ends_of_a_horseshoe_are_near_but_not_linked():
    points = CLOUDS["horseshoe"]
    tip = np.abs(np.arctan2(points[:, 1], points[:, 0])) < 0.4
    upper, lower = tip & (points[:, 1] > 0), tip & (points[:, 1] < 0)
    assert build_graph(points).weights[upper][:, lower].nnz == 0
    assert build_graph(points, EUCLIDEAN).weights[upper][:, lower].nnz > 0, "the ablation does"


def test_sheets_farther_apart_than_the_auxiliary_radius_share_no_link():
    points = shapes.two_sheets(gap=0.4)
    graph = build_graph(points)
    assert AUXILIARY_RADIUS * graph.mean_spacing < 0.4
    half = len(points) // 2
    assert graph.weights[:half, half:].nnz == 0
    assert graph.component_count == 2


def test_euclidean_links_ignore_the_surface():
    points = CLOUDS["horseshoe"]
    graph = build_graph(points, EUCLIDEAN)
    limit = min(LINK_RADIUS * _distances(points).max(), REACH * FALLOFF * graph.mean_spacing)
    within = _distances(points) <= limit
    np.fill_diagonal(within, False)
    assert np.array_equal(graph.weights.toarray() > 0, within)


def test_coincident_points_are_linked_and_break_nothing():
    graph = build_graph(np.concatenate([BALL, BALL[:10]]))
    for i in range(10):
        assert graph.distances_from(i)[60 + i] < F64
        assert graph.weights[i, 60 + i] > 0.99
    assert graph.component_count == 1


def test_one_far_point_leaves_the_others_linked():
    """Its distance raises the mean spacing, not the links' radius below it."""
    graph = build_graph(ODD["far point"])
    assert graph.component_count == 2
    assert len(set(graph.components[:60])) == 1


@every
@clouds
def test_a_stiffer_object_has_more_links(points, settings):
    stiffness = (0.25, 0.5, 1.0, 2.0, 4.0)
    settings = [DeformSettings(settings.mode, settings.links, settings.is_faithful, s)
                for s in stiffness]  # fmt: skip
    counts = [build_graph(points, s).link_count for s in settings]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


@pytest.mark.parametrize(
    ("points", "settings", "sentence"),
    [
        (BALL, DeformSettings(links="magic"), "links must be geodesic or euclidean, not 'magic'"),
        (BALL, DeformSettings(stiffness=5.0), "stiffness must be between 0.25 and 4, not 5"),
        (BALL, DeformSettings(stiffness=np.nan), "stiffness must be between 0.25 and 4, not nan"),
        (BALL[:1], DeformSettings(), "at least two control points, not 1"),
        (np.where(BALL[3, 1] == BALL, np.nan, BALL), DeformSettings(), "not finite"),
        (np.where(BALL[3, 1] == BALL, np.inf, BALL), DeformSettings(), "not finite"),
    ],
)
def test_what_makes_no_graph_is_refused_in_one_sentence(points, settings, sentence):
    with pytest.raises(ValueError, match=sentence):
        build_graph(points, settings)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_size_and_motion_of_the_object_do_not_change_its_weights(scale):
    points = shapes.horseshoe(150)
    moved = scale * (points @ shapes.rotation(3).T) + scale * np.array([5.0, -2.0, 9.0])
    # 1e-7: coordinates of size 10 keep distances of size 0.1 to 1e-14 / 0.1, squared in exp
    assert abs(build_graph(moved).weights - build_graph(points).weights).max() < 1e-7


# ---- seams ----------------------------------------------------------------------------------

BAR = shapes.sheet(30, 18)
LEFT, RIGHT = (np.flatnonzero(BAR[:, 0] * side > 0.0) for side in (-1, 1))
LOWER_LEFT, LOWER_RIGHT = (i[BAR[i, 1] < 0.1] for i in (LEFT, RIGHT))


@every
def test_a_cut_through_makes_two_parts(settings):
    graph = build_graph(BAR, settings, seams=(Seam(LEFT, RIGHT),))
    assert graph.component_count == 2
    assert graph.weights[LEFT][:, RIGHT].nnz == graph.auxiliary[LEFT][:, RIGHT].nnz == 0


@every
def test_the_way_leads_around_a_cut(settings):
    whole = build_graph(BAR, settings)
    graph = build_graph(BAR, settings, seams=(Seam(LOWER_LEFT, LOWER_RIGHT),))
    assert graph.component_count == 1
    assert graph.weights[LOWER_LEFT][:, LOWER_RIGHT].nnz == 0
    assert (_geodesics(graph) >= _geodesics(whole) - F64).all()
    i, j = LOWER_LEFT[BAR[LOWER_LEFT].sum(1).argmin()], LOWER_RIGHT[0]
    assert graph.distances_from(i)[j] > whole.distances_from(i)[j] + F64


@every
def test_glue_joins_two_parts(settings):
    points = CLOUDS["two parts"]
    first, second = np.argsort(points[:60, 0])[-5:], 60 + np.argsort(points[60:, 0])[:5]
    graph = build_graph(points, settings, seams=(Seam(first, second, is_glued=True),))
    assert graph.component_count == 1
    glue = graph.auxiliary[first][:, second]
    assert (np.diff(glue.indptr) > 0).all() and (np.diff(glue.T.tocsr().indptr) > 0).all()
    assert np.allclose(glue.data, graph.mean_spacing, rtol=F64)
    assert graph.weights[first][:, second].nnz >= glue.nnz
    assert (graph.weights != graph.weights.T).nnz == 0


def test_a_cut_wins_over_glue():
    seams = Seam(LEFT, RIGHT), Seam(LEFT, RIGHT, is_glued=True)
    assert build_graph(BAR, seams=seams).component_count == 2
    assert build_graph(BAR, seams=seams[::-1]).component_count == 2


@pytest.mark.parametrize("is_glued", [False, True])
def test_an_empty_region_changes_nothing(is_glued):
    none = np.empty(0, np.int32)
    seams = Seam(LEFT, none, is_glued), Seam(none, RIGHT, is_glued)
    assert (build_graph(BAR, seams=seams).weights != build_graph(BAR).weights).nnz == 0


def test_a_region_glued_to_itself_and_cut_from_itself_is_no_error():
    glued = build_graph(BAR, seams=(Seam(LEFT, LEFT, is_glued=True),))
    assert not glued.auxiliary.diagonal().any()
    cut = build_graph(BAR, seams=(Seam(LEFT, LEFT),))
    assert cut.weights[LEFT][:, LEFT].nnz == 0


@pytest.mark.parametrize("number", [-1, len(BAR)])
def test_a_seam_of_other_control_points_is_refused(number):
    with pytest.raises(ValueError, match="a seam names control points that are not among"):
        build_graph(BAR, seams=(Seam(LEFT, np.array([number])),))
