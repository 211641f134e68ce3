"""An object out of a splat file: without floaters, centred, facing outwards."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.base.rotations import quats_along
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import SplatFileError, encode, read, read_object
from objectmorpher_core.splat_files.splats.objects import (
    as_object,
    core_box,
    is_of_object,
    thinnest_last,
)
from tests import shapes
from tests.core.splat_files.clouds import gaussians, turn_between


def shell(count: int = 3000, seed: int = 0) -> Gaussians:
    """Flat Gaussians on a unit ball, their axes in any order, their normals in or out."""
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(count, 3))
    means /= np.linalg.norm(means, axis=1, keepdims=True)
    frames = quats_along(means * rng.choice([-1.0, 1.0], count)[:, None])
    spread = np.sqrt(4 * np.pi / count) * 0.6
    parts = (means, frames, np.tile([spread, spread, spread / 8], (count, 1)),
             np.full(count, 0.9), rng.random((count, 3)))  # fmt: skip
    flat = Gaussians(*(part.astype(np.float32) for part in parts))
    return shuffled_axes(flat, rng)


def shuffled_axes(cloud: Gaussians, rng: np.random.Generator) -> Gaussians:
    """The same Gaussians, each with its axes in a cyclic order of its own."""
    scales, quats = cloud.scales.copy(), cloud.quats.copy()
    third = np.array([0.5, 0.5, 0.5, 0.5])  # x -> y -> z -> x
    for turns in (1, 2):
        rows = rng.random(len(cloud)) < 0.4
        for _ in range(turns):
            w, v = quats[rows, :1], quats[rows, 1:]
            quats[rows] = np.concatenate(
                [w * third[0] - v @ third[1:, None],
                 w * third[1:] + v * third[0] + np.cross(v, third[1:])], axis=1)  # fmt: skip
            scales[rows] = np.roll(scales[rows], -1, axis=1)
    return Gaussians(cloud.means, quats, scales, cloud.opacities, cloud.colors)


def with_floaters(cloud: Gaussians, places: list[list[float]], opacity: float = 0.9) -> Gaussians:
    count = len(places)
    return Gaussians(
        np.concatenate([cloud.means, np.array(places, np.float32)]),
        np.concatenate([cloud.quats, np.tile(np.float32([1, 0, 0, 0]), (count, 1))]),
        np.concatenate([cloud.scales, np.full((count, 3), 0.01, np.float32)]),
        np.concatenate([cloud.opacities, np.full(count, opacity, np.float32)]),
        np.concatenate([cloud.colors, np.zeros((count, 3), np.float32)]),
    )


def test_giant_outliers_are_floaters_and_the_object_is_not():
    far = [[1e6, 0, 0], [0, -5e8, 3], [0, 0, 40], [-7, 7, 7]]
    kept = is_of_object(with_floaters(shell(), far))
    assert kept[:3000].all()
    assert not kept[3000:].any()


def test_outliers_do_not_make_the_object_small(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(encode(with_floaters(shell(), [[1e6, 0, 0]] * 5), path))
    cloud = read_object(path)
    assert len(cloud) == 3000
    assert np.ptp(cloud.means, axis=0).min() > 0.95


def test_a_thin_limb_is_no_floater():
    """A tail as long as the body, of one Gaussian in fifty."""
    tail = np.column_stack([np.linspace(1, 3, 60), np.zeros(60), np.zeros(60)]).tolist()
    assert is_of_object(with_floaters(shell(), tail)).all()


def test_haze_and_what_is_too_faint_is_left_out():
    cloud = with_floaters(shell(), [[0.0, 0, 0]], opacity=0.01)
    scales = cloud.scales.copy()
    scales[7] = 5.0
    kept = is_of_object(Gaussians(cloud.means, cloud.quats, scales, cloud.opacities, cloud.colors))
    assert not kept[3000] and not kept[7]
    assert kept.sum() == 2999


def test_a_plain_conversion_keeps_floaters(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(encode(with_floaters(shell(), [[1e6, 0, 0]]), path))
    assert len(read(path)) == 3001


def test_the_core_box_weighs_opacity():
    points = np.concatenate([np.linspace(0, 1, 1000), np.linspace(90, 100, 1000)])
    weights = np.concatenate([np.ones(1000), np.full(1000, 1e-6)])
    low, high = core_box(np.repeat(points[:, None], 3, axis=1), weights)
    assert (low >= 0).all() and (high <= 1).all()


def test_the_thinnest_axis_comes_last_and_shapes_stay():
    cloud = thinnest_last(gaussians(300))
    assert (np.diff(cloud.scales, axis=1) <= 0).all()
    np.testing.assert_allclose(cloud.covariances(), gaussians(300).covariances(), atol=1e-7)


def test_what_is_in_order_stays_as_it_is():
    cloud = thinnest_last(gaussians(300))
    assert thinnest_last(cloud) is cloud
    assert turn_between(thinnest_last(cloud), cloud).max() == 0


def test_normals_point_out_of_a_closed_shell():
    cloud = as_object(shell())
    outward = (cloud.means * cloud.normals).sum(1)
    assert (outward > 0).mean() > 0.99


def test_normals_point_out_of_a_bent_body_too():
    """A ring of a tube: away from the middle is inwards on the inner side."""
    rng = np.random.default_rng(1)
    along, around = (rng.uniform(0, 2 * np.pi, 6000) for _ in range(2))
    ring = np.column_stack([np.cos(along), np.sin(along), np.zeros(6000)])
    out = np.cos(around)[:, None] * ring + np.sin(around)[:, None] * np.array([0, 0, 1.0])
    flips = rng.choice([-1.0, 1.0], 6000)[:, None]
    parts = (ring + 0.3 * out, quats_along(out * flips), np.tile([0.03, 0.03, 0.003], (6000, 1)),
             np.ones(6000), np.ones((6000, 3)))  # fmt: skip
    cloud = as_object(Gaussians(*(part.astype(np.float32) for part in parts)))
    assert ((cloud.normals * out).sum(1) > 0).mean() > 0.98


def test_an_object_is_centred_and_one_unit_large():
    cloud = as_object(with_floaters(shell(), [[50.0, 50, 50]]))
    low, high = cloud.means.min(0), cloud.means.max(0)
    np.testing.assert_allclose(low + high, 0, atol=1e-5)
    assert (high - low).max() == pytest.approx(1)


def test_the_scales_shrink_with_the_object():
    cloud, small = shell(), as_object(shell())
    assert np.median(small.scales) == pytest.approx(np.median(cloud.scales) / 2, rel=0.02)


def test_a_single_point_and_an_invisible_cloud_are_no_object():
    with pytest.raises(SplatFileError, match="in one point"):
        as_object(gaussians(1))
    unseen = gaussians(50)
    with pytest.raises(SplatFileError, match="can be seen"):
        as_object(Gaussians(unseen.means, unseen.quats, unseen.scales,
                            np.zeros(50, np.float32), unseen.colors))  # fmt: skip


def test_a_solid_body_stays_whole():
    """Gaussians all through a ball, as some trainers leave them."""
    means = shapes.ball(3000).astype(np.float32)
    base = gaussians(3000)
    cloud = Gaussians(means, base.quats, np.full((3000, 3), 0.05, np.float32), base.opacities,
                      base.colors)  # fmt: skip
    assert len(as_object(cloud)) >= 0.98 * 3000
