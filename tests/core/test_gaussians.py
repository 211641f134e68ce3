"""Sets of Gaussians: what is refused, and how they deform."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from objectmorpher_core.base.rotations import matrices_from_quats
from objectmorpher_core.document.gaussians import Gaussians
from tests import shapes

F32 = 2e-6  # quaternions and scales are stored as float32 of numbers below 1
CLOUD = shapes.gaussians_at(shapes.ball(40), sigma=0.5)
LINEAR = np.random.default_rng(3).normal(size=(40, 3, 3)) * 0.4 + np.eye(3)


def test_arrays_are_read_only_float32():
    for name in (f.name for f in fields(Gaussians)):
        array = getattr(CLOUD, name)
        assert array.dtype == np.float32
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "colors"])
def test_wrong_shapes_and_numbers_are_refused_by_name(name):
    good = getattr(CLOUD, name)
    with pytest.raises(ValueError, match=r"is \(\d+,.*expected" if name != "means" else "expected"):
        replace(CLOUD, **{name: good[:-1]})
    bad = good.copy()
    bad[3] = np.nan
    with pytest.raises(ValueError, match=f"{name} holds values that are not finite"):
        replace(CLOUD, **{name: bad})


def test_a_covariance_has_the_scales_along_the_axes():
    covariances = CLOUD.covariances()
    axes = matrices_from_quats(CLOUD.quats.astype(np.float64))
    for k in range(3):
        stretched = np.einsum("nab,nb->na", covariances, axes[:, :, k])
        expected = axes[:, :, k] * CLOUD.scales[:, k : k + 1].astype(np.float64) ** 2
        assert np.abs(stretched - expected).max() < F32


def test_moving_deforms_the_covariance():
    moved = CLOUD.moved(CLOUD.means + 1, LINEAR)
    expected = LINEAR @ CLOUD.covariances() @ LINEAR.transpose(0, 2, 1)
    assert np.abs(moved.covariances() - expected).max() < 1e-5  # float32 scales, up to 3
    assert np.array_equal(moved.means, CLOUD.means + 1)
    assert np.array_equal(moved.colors, CLOUD.colors)


def test_moved_gaussians_keep_unit_quaternions_and_sorted_axes():
    moved = CLOUD.moved(CLOUD.means, LINEAR)
    assert np.abs(np.linalg.norm(moved.quats, axis=1) - 1).max() < F32
    assert (np.diff(moved.scales, axis=1) <= 0).all()


def test_the_normal_of_a_flat_gaussian_stays_the_normal_of_its_surface():
    flat = replace(CLOUD, scales=CLOUD.scales * np.array([1.0, 1.0, 0.01], np.float32))
    normals = flat.moved(flat.means, LINEAR).normals
    expected = np.einsum("nba,nb->na", np.linalg.inv(LINEAR), flat.normals)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert (normals * expected).sum(1).min() > 0.99  # not 1: it is thin, not infinitely so


def test_no_motion_leaves_the_gaussians_as_they_are():
    moved = CLOUD.moved(CLOUD.means, np.tile(np.eye(3), (40, 1, 1)))
    assert np.abs(moved.covariances() - CLOUD.covariances()).max() < F32


def test_a_rotation_turns_normals_with_it():
    r = shapes.rotation(4)
    moved = CLOUD.moved(CLOUD.means, np.tile(r, (40, 1, 1)))
    assert np.abs(moved.normals - CLOUD.normals @ r.T).max() < 1e-4  # eigenvectors of float32


def test_selecting_takes_the_same_rows_of_everything():
    chosen = CLOUD.select(np.array([5, 2]))
    assert len(chosen) == 2
    for name in (f.name for f in fields(Gaussians)):
        assert np.array_equal(getattr(chosen, name), getattr(CLOUD, name)[[5, 2]])
