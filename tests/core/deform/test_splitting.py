"""Splitting: pieces that together are the Gaussian they came from."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.deform.resampling import MOST_PIECES, split_stretched
from objectmorpher_core.document.gaussians import Gaussians
from tests import shapes

F32 = 1e-5
CLOUD = shapes.gaussians_at(shapes.ball(500))


def _stretched_along_x(amount: float, count: int = len(CLOUD)) -> np.ndarray:
    return np.tile(np.diag([amount, 1.0, 1.0]), (count, 1, 1))


@pytest.mark.parametrize("amount", [2.5, 4.0, 9.0, 40.0])
def test_the_pieces_have_together_the_moments_of_the_original(amount):
    split = split_stretched(CLOUD, _stretched_along_x(amount))
    assert len(split.parents) > len(CLOUD)
    covariances, means = split.gaussians.covariances(), split.gaussians.means.astype(np.float64)
    for i in range(len(CLOUD)):
        own = split.parents == i
        assert np.abs(means[own].mean(0) - CLOUD.means[i]).max() < F32
        gaps = means[own] - means[own].mean(0)
        together = covariances[own].mean(0) + gaps.T @ gaps / own.sum()
        assert np.abs(together - CLOUD.covariances()[i]).max() < F32 * CLOUD.scales[i].max() ** 2


def test_pieces_lie_in_the_plane_of_their_parent_and_keep_the_rest_of_it():
    split = split_stretched(CLOUD, _stretched_along_x(6.0))
    parents = CLOUD.select(split.parents)
    assert np.abs(split.gaussians.normals - parents.normals).max() < F32
    assert np.array_equal(split.gaussians.scales[:, 2], parents.scales[:, 2])
    assert np.array_equal(split.gaussians.opacities, parents.opacities)
    assert np.array_equal(split.gaussians.colors, parents.colors)
    gaps = split.gaussians.means - parents.means
    assert np.abs((gaps * parents.normals).sum(1)).max() < F32
    assert np.array_equal(np.unique(split.parents), np.arange(len(CLOUD)))


def test_nothing_splits_where_nothing_is_stretched():
    turned = 1.9 * shapes.rotations(len(CLOUD))
    split = split_stretched(CLOUD, turned)
    assert split.gaussians is CLOUD
    assert np.array_equal(split.parents, np.arange(len(CLOUD)))


def test_stretching_across_the_plane_splits_nothing():
    normals = CLOUD.normals.astype(np.float64)
    across = np.eye(3) + 9 * normals[:, :, None] * normals[:, None, :]
    assert len(split_stretched(CLOUD, across).parents) == len(CLOUD)


def test_those_that_are_not_stretched_stay_to_the_last_digit():
    linear = _stretched_along_x(1.0)
    linear[100] = 5 * np.eye(3)
    split = split_stretched(CLOUD, linear)
    assert np.bincount(split.parents)[100] == 3
    others = split.parents != 100
    for name in ("means", "quats", "scales"):
        kept = getattr(split.gaussians, name)[others]
        assert np.array_equal(kept, np.delete(getattr(CLOUD, name), 100, axis=0))


@pytest.mark.parametrize(("amount", "pieces"), [(2.0, 1), (2.1, 2), (4.0, 2), (4.1, 3), (99, 8)])
def test_the_number_of_pieces_is_that_of_the_stretch(amount, pieces):
    assert MOST_PIECES == 8
    split = split_stretched(CLOUD, amount * np.tile(np.eye(3), (len(CLOUD), 1, 1)))
    assert (np.bincount(split.parents) == pieces).all()


def test_a_sheet_drawn_out_to_four_times_its_length_has_no_gap():
    """Coverage 1 - prod(1 - opacity x footprint) along its middle, and how long the splats are."""
    x, y = np.meshgrid(np.arange(40.0), np.arange(7.0) - 3)
    means = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    count = len(means)
    upright = np.tile([1.0, 0, 0, 0], (count, 1))
    scales = np.tile([0.7, 0.7, 0.05], (count, 1))
    sheet = Gaussians(means, upright, scales, np.full(count, 0.9), np.ones((count, 3)))
    f = np.diag([4.0, 1.0, 1.0])
    split = split_stretched(sheet, np.tile(f, (count, 1, 1)))
    drawn = split.gaussians.moved(split.gaussians.means @ f, np.tile(f, (len(split.parents), 1, 1)))
    at = np.column_stack([np.linspace(20, 136, 500), np.zeros(500)])
    gaps = at[:, None] - drawn.means[None, :, :2]
    inverse = np.linalg.inv(drawn.covariances()[:, :2, :2])
    footprint = np.exp(-0.5 * np.einsum("pna,nab,pnb->pn", gaps, inverse, gaps))
    coverage = 1 - np.prod(1 - drawn.opacities * footprint, axis=1)
    assert coverage.min() > 0.95
    assert drawn.scales.max() < 0.75 * 4 * 0.7


def test_a_limit_of_nothing_is_refused():
    with pytest.raises(ValueError, match="must be > 0"):
        split_stretched(CLOUD, _stretched_along_x(1.0), most=0.0)
