"""Farthest point sampling: even, deterministic, no point twice."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from objectmorpher_core.deform.control_points import (
    COUNT,
    MAX_COUNT,
    MIN_COUNT,
    sample_control_points,
    with_more_points,
)
from tests import shapes
from tests.tree import over

F32 = 1e-6  # points come back as float32 of numbers below 1

CLOUDS = {
    "ball": shapes.ball(3000),
    "horseshoe": shapes.horseshoe(1000) + 100.0,
    "sheet": shapes.sheet(40, 30),  # a grid: many are equally far
    "line": np.linspace(0, 1, 300)[:, None] * [1.0, 2.0, 3.0],
    "outlier": np.concatenate([shapes.bar(500), [[1e6, 0, 0]]]),
    "twins": np.repeat(shapes.ball(200), 3, axis=0),
}
clouds = pytest.mark.parametrize("cloud", CLOUDS.values(), ids=CLOUDS.keys())


def _sample(points: np.ndarray, count: int, opacity: float = 1.0) -> np.ndarray:
    return sample_control_points(points, np.full(len(points), opacity), count)


def _plain(points: np.ndarray, count: int) -> np.ndarray:
    """The same sampling as one looks it up: every point, every time."""
    chosen = [int(((points - points.mean(0)) ** 2).sum(1).argmax())]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < count:
        x, y, z = ((points - points[chosen[-1]]) ** 2).T
        nearest = np.minimum(nearest, x + y + z)
        if nearest.max() <= 0:
            break
        chosen.append(int(nearest.argmax()))
    return points[chosen].astype(np.float32)


@clouds
@over("count", [4, 150, MAX_COUNT])
def test_the_blocks_choose_what_the_plain_loop_chooses(cloud, count):
    assert np.array_equal(_sample(cloud, count), _plain(cloud, min(count, len(cloud))))


@clouds
@over("share", [0.1, 0.4])
def test_more_are_added_until_none_is_farther_than_a_gap_and_none_nearer(cloud, share):
    kept = _sample(cloud[: len(cloud) // 3], 6)
    gap = share * float(np.median(np.linalg.norm(cloud - cloud[0], axis=1)))
    points = with_more_points(kept, cloud, gap)
    rounding = F32 * np.abs(cloud).max()
    assert np.array_equal(points[: len(kept)], kept)
    assert cKDTree(points).query(cloud)[0].max() <= gap + rounding
    apart = cKDTree(points).query(points[len(kept) :], k=2)[0][:, 1]
    assert len(apart)
    assert apart.min() >= gap - rounding


def test_the_same_cloud_gives_the_same_points():
    cloud = shapes.ball(500)
    assert np.array_equal(_sample(cloud, 64), _sample(cloud, 64))


def test_the_order_of_the_gaussians_does_not_matter_where_none_are_equally_far():
    cloud = shapes.ball(2000)
    shuffled = cloud[np.random.default_rng(3).permutation(len(cloud))]
    assert np.array_equal(_sample(shuffled, 200), _sample(cloud, 200))


def test_control_points_are_distinct_gaussians():
    cloud = shapes.ball(500).astype(np.float32)
    chosen = _sample(cloud, 64)
    distance, index = cKDTree(cloud).query(chosen)
    assert distance.max() <= F32
    assert len(np.unique(index)) == 64


def test_no_gaussian_is_farther_from_a_control_point_than_two_of_them_are_apart():
    """The property that farthest point sampling has: covering radius <= packing distance."""
    cloud = shapes.horseshoe(600)
    chosen = _sample(cloud, 50)
    covering = cKDTree(chosen).query(cloud)[0].max()
    packing = cKDTree(chosen).query(chosen, k=2)[0][:, 1].min()
    assert covering <= packing + F32


def test_covering_is_near_the_best_possible():
    """At most twice the optimum (Gonzalez 1985); the optimum of a sphere is known from area."""
    chosen = _sample(shapes.ball(4000), 100)
    covering = cKDTree(chosen).query(shapes.ball(4000, seed=1))[0].max()
    hexagonal = np.sqrt(2 * np.pi * 0.25 * 4 / 100 / (3 * np.sqrt(3)))  # m hexagons tile its area
    assert covering <= 2 * hexagonal


def test_fewer_gaussians_than_asked_all_become_control_points():
    cloud = shapes.ball(30)
    chosen = _sample(cloud, COUNT)
    assert len(chosen) == 30
    assert cKDTree(chosen).query(cloud)[0].max() <= F32


def test_coincident_gaussians_count_once():
    cloud = np.repeat(shapes.ball(10), 5, axis=0)
    assert len(_sample(cloud, 40)) == 10


def test_transparent_gaussians_are_not_chosen():
    solid, ghost = shapes.ball(200), shapes.ball(200) + [5.0, 0, 0]
    opacities = np.repeat([1.0, 0.2], 200)
    chosen = sample_control_points(np.concatenate([solid, ghost]), opacities, 50)
    assert chosen[:, 0].max() < 1


def test_the_threshold_falls_where_too_few_are_solid():
    assert len(_sample(shapes.ball(100), 50, opacity=0.3)) == 50


@pytest.mark.parametrize("cloud", [np.empty((0, 3)), shapes.ball(MIN_COUNT - 1), np.zeros((50, 3))])
def test_too_few_distinct_gaussians_are_refused(cloud):
    with pytest.raises(ValueError, match="distinct Gaussians, too few to deform"):
        _sample(cloud, 50)


@pytest.mark.parametrize(
    ("count", "limit"), [(MIN_COUNT - 1, "at least 4 are needed"), (MAX_COUNT + 1, "at most 4096")]
)
def test_too_few_and_too_many_control_points_are_refused(count, limit):
    with pytest.raises(ValueError, match=limit):
        _sample(shapes.ball(100), count)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_gaussians_that_are_not_finite_are_refused(value):
    cloud, opacities = shapes.ball(50), np.ones(50)
    broken = cloud.copy()
    broken[7, 1] = value
    with pytest.raises(ValueError, match="not finite"):
        sample_control_points(broken, opacities, 10)
    opacities[7] = value
    with pytest.raises(ValueError, match="not finite"):
        sample_control_points(cloud, opacities, 10)
