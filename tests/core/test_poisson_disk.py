"""Thinning to a spacing: nothing nearer, nothing missing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from objectmorpher_core.base.poisson_disk import thin_to_spacing
from tests import shapes

CLOUD = shapes.ball(5000)
ORDER = np.random.default_rng(0).permutation(5000)


@pytest.mark.parametrize("spacing", [0.02, 0.1, 0.5, 3.0])
def test_no_two_kept_points_are_nearer_than_the_spacing(spacing):
    kept = CLOUD[thin_to_spacing(CLOUD, spacing, ORDER)]
    gaps = cKDTree(kept).query(kept, k=2)[0][:, 1]
    assert gaps.min() >= spacing


@pytest.mark.parametrize("spacing", [0.02, 0.1, 0.5, 3.0])
def test_every_dropped_point_is_near_a_kept_one(spacing):
    kept = CLOUD[thin_to_spacing(CLOUD, spacing, ORDER)]
    assert cKDTree(kept).query(CLOUD)[0].max() < spacing


def test_the_first_point_offered_is_kept():
    assert ORDER[0] in thin_to_spacing(CLOUD, 0.3, ORDER)


def test_indices_are_ascending_and_distinct():
    kept = thin_to_spacing(CLOUD, 0.1, ORDER)
    assert (np.diff(kept) > 0).all()


def test_coincident_points_are_kept_once():
    cloud = np.repeat(shapes.ball(20), 3, axis=0)
    assert len(thin_to_spacing(cloud, 1e-6, np.arange(60))) == 20


def test_one_point_stays():
    assert list(thin_to_spacing(np.zeros((1, 3)), 0.1, np.array([0]))) == [0]


def test_where_the_cloud_lies_does_not_matter():
    far = thin_to_spacing(CLOUD + 1000.0, 0.1, ORDER)
    # a pair whose distance rounds across the spacing may decide otherwise
    assert len(np.setxor1d(far, thin_to_spacing(CLOUD, 0.1, ORDER))) <= 4


def test_the_first_offered_wins_as_if_all_were_compared():
    spacing, kept = 0.15, []
    for i in ORDER[:1500]:
        if all(np.linalg.norm(CLOUD[i] - CLOUD[j]) >= spacing for j in kept):
            kept.append(i)
    # those not offered are not kept
    assert np.array_equal(thin_to_spacing(CLOUD, spacing, ORDER[:1500]), np.sort(kept))


def test_two_sides_that_touch_are_thinned_each_by_itself():
    sheet = np.column_stack([np.random.default_rng(1).random((800, 2)), np.zeros(800)])
    cloud, normals = np.tile(sheet, (2, 1)), np.repeat([[0, 0, 1.0], [0, 0, -1.0]], 800, axis=0)
    order = np.random.default_rng(2).permutation(1600)
    kept = thin_to_spacing(cloud, 0.1, order, normals)
    for side in (kept[kept < 800], kept[kept >= 800]):
        assert cKDTree(cloud[side]).query(cloud)[0].max() < 0.1
        assert cKDTree(cloud[side]).query(cloud[side], k=2)[0][:, 1].min() >= 0.1


def test_none_are_thinned_to_none():
    assert len(thin_to_spacing(np.empty((0, 3)), 0.1, np.empty(0, int))) == 0
